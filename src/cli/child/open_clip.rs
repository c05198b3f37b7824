//! `viola open-clip`: the child process that opens one uploaded file.

use crate::api::opened_clip_json;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub struct OpenClipArguments {
    /// The clip's file.
    clip: PathBuf,
}

pub fn run(arguments: &OpenClipArguments) -> Result<()> {
    println!("{}", opened_clip_json(&arguments.clip));
    Ok(())
}
