//! Conversion of clips.

use super::is_zip;
use crate::cli::output;
use crate::cli::progress::TerminalProgress;
use crate::cli::video_tools::video_tools;
use crate::cli::wrong_file::{self, Advice};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::Path;
use viola_formats::clip::Clip;
use viola_formats::clip::write::{FolderSink, WrittenLayout, ZipSink, write};
use viola_geometry::progress::{Progress, Stage};

/// Writes files into a folder beside `out`, which gets that name when it is whole: after a command that fails or is interrupted
/// there is no `out`. An empty folder that is there is filled.
fn in_whole_folder<T>(out: &Path, write: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
    let cannot = || format!("cannot write {}", out.display());
    if out.exists() {
        // The error is that of the conversion.
        return write(out).inspect_err(|_| drop(fs::remove_dir_all(out)));
    }
    let mut part = out.file_name().with_context(cannot)?.to_os_string();
    part.push(".part");
    let part = out.with_file_name(part);
    if part.exists() {
        // Of a command that was interrupted.
        fs::remove_dir_all(&part).with_context(cannot)?;
    }
    output::folder(&part)?;
    let written = write(&part).and_then(|written| {
        fs::rename(&part, out).with_context(cannot)?;
        Ok(written)
    });
    if written.is_err() {
        // The error is that of the conversion.
        let _ = fs::remove_dir_all(&part);
    }
    written
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
    let written = if is_zip(out) {
        // The clip may be this very file.
        output::write_whole(out, |to| {
            let mut sink = ZipSink::new(to);
            let written = write(&clip, layout, &mut sink, &progress)?;
            sink.finish()?;
            Ok(written)
        })?
    } else {
        output::refuse_to_overwrite(&[file.to_owned()], &[out.to_owned()], "--out")?;
        if out.is_file() {
            bail!("{} is a file; name a folder, or a .zip file", out.display());
        }
        // Readers would mix this clip with files of another one.
        if fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some()) {
            bail!("{} is not empty; name a folder that is, or a .zip file", out.display());
        }
        in_whole_folder(out, |folder| Ok(write(&clip, layout, &mut FolderSink::new(folder), &progress)?))?
    };
    progress.finish();
    println!("wrote:  {}, {} frames", out.display(), written.frames);
    Ok(clip.info().notes.iter().cloned().chain(written.notes).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_conversion_that_ends_early_can_be_started_again() {
        let folder = tempfile::tempdir().unwrap();
        let (out, part) = (folder.path().join("clip"), folder.path().join("clip.part"));
        let write = |folder: &Path| Ok(fs::write(folder.join("new"), "")?);
        // As an interrupt leaves it.
        fs::create_dir(&part).unwrap();
        fs::write(part.join("old"), "").unwrap();
        in_whole_folder(&out, write).unwrap();
        assert!(out.join("new").is_file() && !out.join("old").exists() && !part.exists());
        let failed = in_whole_folder(&folder.path().join("other"), |_| -> Result<()> { bail!("no more") });
        assert_eq!(failed.unwrap_err().to_string(), "no more");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        // An empty folder is taken.
        let empty = folder.path().join("empty");
        fs::create_dir(&empty).unwrap();
        in_whole_folder(&empty, write).unwrap();
        assert!(empty.join("new").is_file());
        fs::remove_file(empty.join("new")).unwrap();
        let half = |folder: &Path| -> Result<()> { write(folder).and_then(|()| bail!("no more")) };
        in_whole_folder(&empty, half).unwrap_err();
        assert!(!empty.join("new").exists());
    }
}
