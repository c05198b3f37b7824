//! Conversion of clips.

use crate::cli::output;
use crate::cli::progress::TerminalProgress;
use crate::cli::video_tools::video_tools;
use crate::cli::wrong_file::{self, Advice};
use anyhow::{Result, bail};
use std::fs;
use std::path::Path;
use viola_formats::clip::Clip;
use viola_formats::clip::write::{FolderSink, WrittenLayout, ZipSink, write};
use viola_geometry::progress::{Progress, Stage};

/// Writes a clip into a new or empty folder, or into a zip archive.
pub(super) fn convert(file: &Path, out: &Path, layout: WrittenLayout) -> Result<Vec<String>> {
    let clip = Clip::open_with(file, &video_tools())
        .map_err(|error| wrong_file::of_clip(file, error, Advice::Target))?;
    if !clip.info().metric {
        bail!(
            "{}: the unit of its poses and depth is unknown, and clips are written in metres",
            file.display()
        );
    }
    let progress = TerminalProgress::new();
    progress.enter(Stage::Decode);
    let written = if out.extension().is_some_and(|ending| ending == "zip") {
        // The clip may be this very file.
        output::write_whole(out, |to| {
            let mut sink = ZipSink::new(to);
            let written = write(&clip, layout, &mut sink, &progress)?;
            sink.finish()?;
            Ok(written)
        })?
    } else {
        output::refuse_to_overwrite(&[file.to_owned()], &[out.to_owned()])?;
        // Readers would mix this clip with files of another one.
        if fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some()) {
            bail!("{} is not empty; name a folder that is, or a .zip file", out.display());
        }
        output::folder(out)?;
        write(&clip, layout, &mut FolderSink::new(out), &progress).inspect_err(|_| {
            // The folder was new or empty. The error is that of the conversion.
            let _ = fs::remove_dir_all(out);
        })?
    };
    progress.finish();
    println!("wrote:  {}, {} frames", out.display(), written.frames);
    Ok(clip.info().notes.iter().cloned().chain(written.notes).collect())
}
