//! Conversion of clips.

use super::is_zip;
use crate::cli::output;
use crate::cli::progress::TerminalProgress;
use crate::cli::video_tools::video_tools;
use crate::cli::wrong_file::{self, Advice};
use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::Path;
use viola_formats::clip::Clip;
use viola_formats::clip::write::{FolderSink, WrittenLayout, ZipSink, write};
use viola_geometry::progress::{Progress, Stage};

/// The name of a temporary folder has random letters between these.
const PART: (&str, &str) = ("viola-", ".part");
/// Number of these letters.
const LETTERS: usize = 6;
/// The only entry of a temporary folder.
const WHOLE: &str = "clip";

/// Removes temporary folders of conversions that were interrupted; those of running ones are locked. Otherwise they would
/// fill the disk, and a folder that was empty could not be given again.
fn remove_interrupted(place: &Path) {
    let Ok(entries) = fs::read_dir(place) else { return };
    for entry in entries.flatten() {
        let (path, is_folder) = (entry.path(), entry.file_type().is_ok_and(|kind| kind.is_dir()));
        if !is_folder || !is_part(&entry.file_name()) || !has_only_a_clip(&path) {
            continue;
        }
        if let Ok(lock) = File::open(&path)
            && lock.try_lock().is_ok()
        {
            // The conversion does not depend on it.
            let _ = fs::remove_dir_all(&path);
        }
    }
}

fn is_part(name: &OsStr) -> bool {
    let (prefix, suffix) = PART;
    let random = name.to_str().and_then(|name| name.strip_prefix(prefix)?.strip_suffix(suffix));
    random.is_some_and(|random| random.len() == LETTERS && random.bytes().all(|b| b.is_ascii_alphanumeric()))
}

fn has_only_a_clip(folder: &Path) -> bool {
    let Ok(entries) = fs::read_dir(folder) else { return false };
    let names: Vec<_> = entries.flatten().map(|entry| entry.file_name()).collect();
    names == [WHOLE]
}

/// Writes files into a temporary folder, which gets the name `out` when it is whole: after a command that fails or is
/// interrupted there is no `out`. An empty folder that is there is filled.
fn in_whole_folder<T>(out: &Path, write: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
    let cannot = || format!("cannot write {}", out.display());
    let is_there = out.is_dir();
    // A folder that is there may be a link or a mount point, so that no other folder can get its name.
    let place = if is_there { out } else { out.parent().with_context(cannot)? };
    output::folder(place)?;
    // An empty path is the working folder.
    remove_interrupted(&Path::new(".").join(place));
    // It is removed when `part` is dropped.
    let (prefix, suffix) = PART;
    let part = tempfile::Builder::new().prefix(prefix).suffix(suffix).rand_bytes(LETTERS).tempdir_in(place);
    let part = part.with_context(cannot)?;
    // Before it has its entry, because another conversion may look for interrupted ones.
    let lock = File::open(part.path()).with_context(cannot)?;
    // A file system without locks keeps the folders of interrupted conversions.
    let _ = lock.lock();
    // Only its owner may read a temporary folder, and a folder in it has the usual permissions.
    let whole = part.path().join(WHOLE);
    output::folder(&whole)?;
    let written = write(&whole)?;
    if is_there {
        let entries: std::io::Result<Vec<fs::DirEntry>> =
            fs::read_dir(&whole).with_context(cannot)?.collect();
        for entry in entries.with_context(cannot)? {
            fs::rename(entry.path(), out.join(entry.file_name())).with_context(cannot)?;
        }
    } else {
        fs::rename(&whole, out).with_context(cannot)?;
    }
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
    // Not every layout keeps all of a clip, so that even the clip itself is not replaced.
    output::refuse_to_overwrite(&[file.to_owned()], &[out.to_owned()], "--out")?;
    let progress = TerminalProgress::new();
    progress.enter(Stage::Decode);
    let written = if is_zip(out) {
        output::write_whole(out, |to| {
            let mut sink = ZipSink::new(to);
            let written = write(&clip, layout, &mut sink, &progress)?;
            sink.finish()?;
            Ok(written)
        })?
    } else {
        // A device, a pipe or a broken link is there, too.
        if fs::symlink_metadata(out).is_ok() && !out.is_dir() {
            bail!("--out {} is not a folder; name a new or empty folder, or a .zip file", out.display());
        }
        if out.is_dir() {
            remove_interrupted(out);
        }
        // Readers would mix this clip with files of another one.
        if fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some()) {
            bail!("--out {} is not empty; name a folder that is, or a .zip file", out.display());
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
    fn only_folders_of_interrupted_conversions_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for path in [
            "viola-AbC121.part/clip/depth",
            "viola-AbC122.part/clip",
            "viola-AbC123.part/clip",
            "viola-AbC123.part/mine",
            "viola-AbC124.part",
            "viola-mine.part/clip",
        ] {
            fs::create_dir_all(at(path)).unwrap();
        }
        let running = File::open(at("viola-AbC122.part")).unwrap();
        running.lock().unwrap();
        remove_interrupted(folder.path());
        let mut left: Vec<_> =
            fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        let others = ["viola-AbC122.part", "viola-AbC123.part", "viola-AbC124.part", "viola-mine.part"];
        assert_eq!(left, others);
    }

    #[test]
    fn a_conversion_that_fails_leaves_nothing_and_removes_nothing_of_others() {
        let folder = tempfile::tempdir().unwrap();
        let (out, other) = (folder.path().join("clip"), folder.path().join("clip.part"));
        let write = |folder: &Path| Ok(fs::write(folder.join("new"), "")?);
        let half = |folder: &Path| -> Result<()> { write(folder).and_then(|()| bail!("no more")) };
        fs::create_dir(&other).unwrap();
        fs::write(other.join("old"), "").unwrap();
        let failed = in_whole_folder(&out, half);
        assert_eq!(failed.unwrap_err().to_string(), "no more");
        assert!(!out.exists());
        in_whole_folder(&out, write).unwrap();
        assert!(out.join("new").is_file() && !out.join("old").exists() && other.join("old").is_file());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
        // An empty folder is taken, and stays.
        let empty = folder.path().join("empty");
        fs::create_dir(&empty).unwrap();
        in_whole_folder(&empty, half).unwrap_err();
        assert_eq!(fs::read_dir(&empty).unwrap().count(), 0);
        in_whole_folder(&empty, write).unwrap();
        assert!(empty.join("new").is_file());
        assert_eq!(fs::read_dir(&empty).unwrap().count(), 1);
    }
}
