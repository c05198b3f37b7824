//! The notes of clips in which no frame has a pose: each cause has its own.

use crate::edits::{remove, set};
use crate::writers::{Files, open, scannet, seven_scenes, tum};

const NUMBERS: [u32; 3] = [0, 1, 2];

fn check(mut files: Files, edit: impl Fn(&mut Files), words: &str) {
    edit(&mut files);
    let clip = open(&files).unwrap_or_else(|error| panic!("{words}: {error}"));
    let info = clip.info();
    assert_eq!((info.frames, info.frames_with_pose), (3, 0), "{words}");
    assert!(info.notes.iter().any(|note| note.contains(words)), "{words}: {:?}", info.notes);
}

#[test]
fn a_missing_file_of_poses_is_told() {
    for (files, ending, told) in [
        (tum("", &NUMBERS), "groundtruth.txt", "groundtruth.txt"),
        (scannet("", &NUMBERS), "", "pose/"),
        (seven_scenes("", &NUMBERS), ".pose.txt", "frame-*.pose.txt"),
    ] {
        let is_gone =
            |name: &str| if ending.is_empty() { name.starts_with("pose/") } else { name.ends_with(ending) };
        let words = format!("no frame has a pose, because there is no {told}: the camera will be tracked");
        check(files, |files| remove(files, is_gone), &words);
    }
}

#[test]
fn poses_that_cannot_be_used_are_told() {
    for (text, words) in [
        (
            "5.0 0 0 0 0 0 0 1\n6.0 1 0 0 0 0 0 1\n",
            "at most 0.22 s apart; the poses are from 5.00 s to 6.00 s, and the pictures from 1305031229.50 s to",
        ),
        (
            "1305031229.5 5e5 0 0 0 0 0 1\n1305031229.6 5e5 1 0 0 0 0 1\n",
            "2 poses of groundtruth.txt are 100 km or more from the origin, and were left out; subtract the same offset",
        ),
        (
            "1305031229.5 0 0 0 0 0 0 0\n",
            "no frame has a pose in groundtruth.txt that is a finite rigid motion within 100 km of the origin:",
        ),
    ] {
        check(tum("", &NUMBERS), |files| set(files, "groundtruth.txt", text), words);
    }
}
