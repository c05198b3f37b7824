//! The program and the commit that made a result.

use super::sum;
use super::video_tools::own_program;
use anyhow::{Context, Result};

/// Returns the commit of the working tree that the command runs in; empty if there is none.
pub(super) fn commit() -> String {
    let git = std::process::Command::new("git").args(["rev-parse", "--short", "HEAD"]).output();
    let told = git.ok().filter(|output| output.status.success());
    told.map_or_else(String::new, |output| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Returns the words of the command line, the program first. Paths need not be UTF-8.
pub(super) fn words() -> impl Iterator<Item = String> {
    std::env::args_os().map(|word| word.to_string_lossy().into_owned())
}

/// Returns the hash of this program's file, which separates the results of different builds.
pub(super) fn program() -> Result<String> {
    sum::of_file(&own_program().context("cannot find this program's own file")?)
}
