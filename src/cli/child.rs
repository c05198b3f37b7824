//! The commands of child processes, which only viola itself starts.

mod align_job;
mod decode_video;
mod merge_home;
mod open_clip;

pub use align_job::{child, child_params};
pub use merge_home::merge_child_params;

use anyhow::Result;
use clap::{Parser, Subcommand};

/// The commands of child processes, which only viola itself starts.
#[derive(Parser)]
struct ChildArguments {
    #[command(subcommand)]
    command: ChildCommand,
}

#[derive(Subcommand)]
enum ChildCommand {
    /// Decode frames of the video on standard input.
    DecodeVideo(decode_video::DecodeVideoArguments),
    /// Align the clip of a job.
    AlignJob(align_job::AlignJobArguments),
    /// Do the work of a merge.
    MergeHome(merge_home::MergeHomeArguments),
    /// Open an uploaded file.
    OpenClip(open_clip::OpenClipArguments),
}

/// Returns whether a child process has a command of this name.
pub fn has_command(name: &str) -> bool {
    ChildCommand::has_subcommand(name)
}

/// Runs the command that the process's arguments name.
pub fn run() -> Result<()> {
    match ChildArguments::parse().command {
        ChildCommand::DecodeVideo(arguments) => decode_video::run(&arguments),
        ChildCommand::AlignJob(arguments) => align_job::run(arguments),
        ChildCommand::MergeHome(arguments) => merge_home::run(&arguments),
        ChildCommand::OpenClip(arguments) => open_clip::run(&arguments),
    }
}
