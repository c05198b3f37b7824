//! `viola align-job`: the child process that aligns the clip of one job; see `jobs`.

use crate::cli::args::MethodArguments;
use crate::cli::video_tools::{own_program, video_tools};
use crate::jobs::{ChildOrder, ChildParams, JobParams, serve_child};
use anyhow::{Context, Result};
use clap::Args;
use std::env;
use std::ffi::OsString;
use std::io;
use std::path::PathBuf;
use viola_geometry::LevelName;

/// Environment variables that a child needs: to find programs and libraries, and to use the machine as its
/// operator wants. All others stay with the service, since they may be secrets.
const KEPT: [&str; 8] =
    ["PATH", "HOME", "TMPDIR", "LANG", "TZ", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "ORT_DYLIB_PATH"];
/// Prefixes of further ones.
const KEPT_PREFIXES: [&str; 7] = ["LC_", "RUST_", "RAYON_", "OMP_", "MALLOC_", "CUDA_", "NVIDIA_"];

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
    /// Limit of memory, in addition to the loaded networks.
    #[arg(long, value_name = "BYTES")]
    memory_bytes: u64,
}

pub fn run(arguments: AlignJobArguments) -> Result<()> {
    let AlignJobArguments { method, clip, unknown_scale, level: levels, into, memory_bytes } = arguments;
    let order = ChildOrder { clip, unknown_scale, levels, into, memory_bytes };
    let params = || {
        let Some(method) = method else {
            return Ok(JobParams { video: video_tools(), ..JobParams::default() });
        };
        let method: MethodArguments = serde_json::from_str(&method).map_err(|error| error.to_string())?;
        method.params().map_err(|error| format!("{error:#}"))
    };
    serve_child(&order, params, io::stdout()).context("nobody listens")
}

/// Returns the command that starts this program as a child that aligns with the same arguments.
pub fn child_params(method: &MethodArguments) -> Result<ChildParams> {
    let method = serde_json::to_string(method).context("a path is not UTF-8")?;
    child(&["align-job", "--method", &method])
}

/// Returns the command that starts this program with `arguments`, without the service's secrets.
pub fn child(arguments: &[&str]) -> Result<ChildParams> {
    let is_kept = |name: &OsString| {
        let name = name.to_string_lossy();
        KEPT.contains(&&*name) || KEPT_PREFIXES.iter().any(|prefix| name.starts_with(prefix))
    };
    Ok(ChildParams {
        program: own_program().context("the path of this program is not known")?,
        arguments: arguments.iter().map(OsString::from).collect(),
        environment: env::vars_os().filter(|(name, _)| is_kept(name)).collect(),
    })
}
