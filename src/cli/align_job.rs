//! `viola align-job`: the child process that aligns the clip of one job; see `jobs`.

use super::method::MethodArguments;
use super::video_tools::video_tools;
use crate::jobs::{ChildOrder, ChildParams, JobParams, serve_child};
use anyhow::{Context, Result};
use clap::Args;
use std::env;
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use viola_geometry::LevelName;

/// Prefixes of environment variables that may hold secrets of the service, which the child does not need.
const SECRET: [&str; 4] = ["VIOLA_", "OTEL_", "AWS_", "PG"];

#[derive(Args)]
pub struct AlignJobArguments {
    /// Arguments of the method, as JSON; its defaults if absent.
    #[arg(long, value_name = "JSON")]
    method: Option<String>,
    /// The clip's file.
    #[arg(long, value_name = "FILE")]
    clip: PathBuf,
    /// The unit of the clip is unknown.
    #[arg(long)]
    unknown_scale: bool,
    /// Levels of the home; each has its LiDAR map in the folder for the answer, as `lidar-map-LEVEL`.
    #[arg(long, value_name = "LEVEL")]
    level: Vec<LevelName>,
    /// Folder for the answer.
    #[arg(long, value_name = "DIR")]
    into: PathBuf,
}

pub fn run(arguments: &AlignJobArguments) -> Result<()> {
    let AlignJobArguments { method, clip, unknown_scale, level, into } = arguments;
    let order = ChildOrder {
        clip: clip.clone(),
        unknown_scale: *unknown_scale,
        levels: level.clone(),
        into: into.clone(),
    };
    let params = || {
        let Some(method) = method else {
            return Ok(JobParams { video: video_tools(), ..JobParams::default() });
        };
        let method: MethodArguments = serde_json::from_str(method).map_err(|error| error.to_string())?;
        method.params().map_err(|error| format!("{error:#}"))
    };
    serve_child(&order, params, io::stdout()).context("nobody listens")
}

/// Returns the command that starts this program as a child that aligns with the same arguments.
pub(super) fn child_params(method: &MethodArguments) -> Result<ChildParams> {
    let method = serde_json::to_string(method).context("a path is not UTF-8")?;
    child(&["align-job", "--method", &method])
}

/// Returns the command that starts this program with `arguments`, without the service's secrets.
pub(super) fn child(arguments: &[&str]) -> Result<ChildParams> {
    let is_secret = |name: &OsString| SECRET.iter().any(|secret| name.to_string_lossy().starts_with(secret));
    Ok(ChildParams {
        program: own_program().context("the path of this program is not known")?,
        arguments: arguments.iter().map(OsString::from).collect(),
        environment: env::vars_os().filter(|(name, _)| !is_secret(name)).collect(),
    })
}

/// Returns the path of the running program; on Linux it stays valid when another version replaces the file.
fn own_program() -> io::Result<PathBuf> {
    let running = Path::new("/proc/self/exe");
    if running.exists() { Ok(running.to_owned()) } else { env::current_exe() }
}
