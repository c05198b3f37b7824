//! `viola decode-video`: the child process that decodes video; see `video`.

use anyhow::{Context, Result};
use clap::Args;
use std::fs::File;
use std::io;
use std::os::fd::AsFd;
use viola_formats::container::Region;
use viola_formats::video::{self, NumberList};

#[derive(Args)]
pub struct DecodeVideoArguments {
    /// Offset of the video in the file on standard input, in bytes.
    #[arg(long)]
    offset: u64,
    /// Length of the video in bytes.
    #[arg(long)]
    bytes: u64,
    /// Numbers of frames, ascending: 0-5,9,12-20.
    #[arg(long)]
    frames: Vec<NumberList>,
}

pub fn run(arguments: &DecodeVideoArguments) -> Result<()> {
    let file = io::stdin().as_fd().try_clone_to_owned().context("the video is the standard input")?;
    let region = Region::whole(File::from(file))?.part(arguments.offset, arguments.bytes)?;
    video::open_no_more_files();
    let wanted: Vec<usize> = arguments.frames.iter().flat_map(|list| &list.0).copied().collect();
    video::serve(region, &wanted, &mut io::stdout().lock()).context("nobody reads the frames")
}
