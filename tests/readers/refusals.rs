//! Checks of refusals.

use crate::exports::Writer;
use crate::recording::Recording;
use crate::writers::{Files, as_folder, as_zip, encode};
use image::ImageFormat;
use viola_formats::clip::{Clip, ClipError};

pub fn changed(write: Writer, change: impl FnOnce(&mut Files)) -> Files {
    let mut files = write("", &Recording::small(3));
    change(&mut files);
    files
}

pub fn check_error(error: ClipError, code: &str, naming: &str) {
    assert_eq!(error.code(), code, "{error}");
    assert!(error.to_string().contains(naming), "{code}: {error} does not name {naming}");
}

/// Checks that a changed export is refused when it is opened, as a folder and as a zip.
pub fn check(write: Writer, change: impl FnOnce(&mut Files), code: &str, naming: &str) {
    let files = changed(write, change);
    for opened in [Clip::open(as_folder(&files).path()), Clip::open(as_zip(&files).path())] {
        check_error(opened.err().unwrap_or_else(|| panic!("{code}, {naming}: not refused")), code, naming);
    }
}

/// Checks that only the last frame of a changed export is refused.
pub fn check_frame(write: Writer, change: impl FnOnce(&mut Files), code: &str, naming: &str) {
    let folder = as_folder(&changed(write, change));
    let clip = Clip::open(folder.path()).unwrap_or_else(|error| panic!("{code}, {naming}: {error}"));
    assert!(clip.load(0).is_ok() && clip.load(1).is_ok(), "{code}");
    check_error(clip.load(2).err().unwrap_or_else(|| panic!("{code}, {naming}: not refused")), code, naming);
}

pub fn grey8(width: u32, height: u32) -> Vec<u8> {
    encode(&image::DynamicImage::new_luma8(width, height), ImageFormat::Png)
}

/// Checks that a changed export is a clip without poses, with a note.
pub fn check_without_poses(write: Writer, change: impl FnOnce(&mut Files)) {
    let mut files = write("", &Recording::small(3));
    change(&mut files);
    let clip = Clip::open(as_folder(&files).path()).unwrap();
    assert_eq!((clip.info().frames_with_pose, clip.info().skipped_without_pose), (0, clip.info().frames));
    assert!(clip.info().notes.iter().any(|note| note.contains("tracked")), "{:?}", clip.info().notes);
}
