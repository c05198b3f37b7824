//! Conversion of clips.

use crate::cli::progress::TerminalProgress;
use crate::cli::video_tools::video_tools;
use crate::cli::wrong_file::{self, Advice};
use anyhow::{Context, Result, bail};
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;
use viola_formats::clip::Clip;
use viola_formats::clip::write::{FolderSink, WrittenClip, WrittenLayout, ZipSink, write};
use viola_geometry::progress::{Progress, Stage};

/// Writes a clip as a zip archive.
fn write_zip(clip: &Clip, layout: WrittenLayout, out: &Path, progress: &dyn Progress) -> Result<WrittenClip> {
    let cannot = || format!("cannot write {}", out.display());
    let mut sink = ZipSink::new(BufWriter::new(File::create(out).with_context(cannot)?));
    let written = write(clip, layout, &mut sink, progress)?;
    sink.finish().and_then(|to| to.into_inner()?.sync_all()).with_context(cannot)?;
    Ok(written)
}

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
    let cannot = || format!("cannot write {}", out.display());
    let written = if out.extension().is_some_and(|ending| ending == "zip") {
        // Beside it first: the clip may be this very file, and a zip that fails replaces nothing.
        let part = out.with_extension("zip.part");
        let written = write_zip(&clip, layout, &part, &progress);
        let written =
            written.and_then(|written| fs::rename(&part, out).map(|()| written).with_context(cannot));
        if written.is_err() {
            // The error is that of the conversion.
            let _ = fs::remove_file(&part);
        }
        written?
    } else {
        // Readers would mix this clip with files of another one.
        if fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some()) {
            bail!("{} is not empty; name a folder that is, or a .zip file", out.display());
        }
        fs::create_dir_all(out).with_context(cannot)?;
        write(&clip, layout, &mut FolderSink::new(out), &progress)?
    };
    progress.finish();
    println!("wrote:  {}, {} frames", out.display(), written.frames);
    Ok(clip.info().notes.iter().cloned().chain(written.notes).collect())
}
