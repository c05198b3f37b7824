//! `viola merge-home`: the child process that does the work of a merge; see `jobs`. Its standard input has the order and the
//! files that it asks for on its standard output.

use super::align_job::child;
use crate::cli::args::MethodArguments;
use crate::jobs::{ChildParams, serve_merge};
use anyhow::{Context, Result};
use clap::Args;
use std::io;

#[derive(Args)]
pub struct MergeHomeArguments {
    /// Arguments of the method, as JSON; without them there is no network.
    #[arg(long, value_name = "JSON")]
    method: Option<String>,
    /// Limit of memory, in addition to the loaded network.
    #[arg(long, value_name = "BYTES")]
    memory_bytes: u64,
}

pub fn run(arguments: &MergeHomeArguments) -> Result<()> {
    let method: Option<MethodArguments> =
        arguments.method.as_deref().map(serde_json::from_str).transpose()?;
    let surface = || match &method {
        Some(method) => method.surface().map_err(|error| format!("{error:#}")),
        None => Ok(None),
    };
    serve_merge(arguments.memory_bytes, surface, io::stdin().lock(), io::stdout().lock())
        .context("nobody listens")
}

/// Returns the command that starts this program as a child that merges with the network of `method`, or without one.
pub fn merge_child_params(method: Option<&MethodArguments>) -> Result<ChildParams> {
    let Some(method) = method else { return child(&["merge-home"]) };
    let method = serde_json::to_string(method).context("a path is not UTF-8")?;
    child(&["merge-home", "--method", &method])
}
