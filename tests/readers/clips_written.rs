//! Written clips are read again: the same poses and depth, from every layout to every layout.

use crate::exports::{EXPORTS, check_poses};
use crate::recording::Recording;
use crate::writers::as_folder;
use std::io::{Cursor, Write};
use viola_formats::clip::Clip;
use viola_formats::clip::write::{FolderSink, WrittenClip, WrittenLayout, ZipSink, write};
use viola_geometry::progress::Silent;

const LAYOUTS: [(WrittenLayout, &str); 3] = [
    (WrittenLayout::StrayScanner, "stray_scanner"),
    (WrittenLayout::TumRgbd, "tum_rgbd"),
    (WrittenLayout::Scannet, "scannet"),
];

/// Checks a clip that was written and read again.
fn check(read: &Clip, written: &WrittenClip, name: &str, original: &Clip, recording: &Recording) {
    assert_eq!(read.info().layout, name);
    assert_eq!((read.info().frames, written.frames), (recording.frames.len(), recording.frames.len()));
    check_poses(read, recording, name);
    for index in 0..read.frames().len() {
        let (a, b) = (original.load(index).unwrap(), read.load(index).unwrap());
        for (a, b) in [
            (a.depth_camera.fx, b.depth_camera.fx),
            (a.depth_camera.fy, b.depth_camera.fy),
            (a.depth_camera.cx, b.depth_camera.cx),
            (a.depth_camera.cy, b.depth_camera.cy),
        ] {
            assert!((a - b).abs() < 1e-4, "{name}: {a} became {b}");
        }
        // Half of the coarsest unit, a millimetre.
        for (a, b) in a.depth.depth_m.iter().zip(&b.depth.depth_m) {
            assert!((a - b).abs() <= 0.000_51, "{name}: {a} m became {b} m");
        }
        let (color, again) = (a.color.unwrap().into_raw(), b.color.unwrap().into_raw());
        let difference: u64 = color.iter().zip(&again).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        assert!(difference < 4 * color.len() as u64, "{name}: the colours changed");
    }
}

#[test]
fn clips_are_written_as_they_are_read() {
    let recording = Recording::small(9);
    for (from, export, knows_up) in EXPORTS {
        let folder = as_folder(&export("", &recording));
        let original = Clip::open(folder.path()).unwrap();
        for (layout, name) in LAYOUTS {
            let out = tempfile::tempdir().unwrap();
            let written = write(&original, layout, &mut FolderSink::new(out.path()), &Silent).unwrap();
            let read = Clip::open(out.path()).unwrap();
            // A world with unknown up direction stays as it is, with a note.
            let told = written.notes.iter().any(|note| note.contains("the up direction is not known"));
            assert_eq!(
                told,
                !knows_up && layout != WrittenLayout::TumRgbd,
                "{from} to {name}: {:?}",
                written.notes
            );
            let info = original.info();
            let differs = (info.color_width, info.color_height) != (info.depth_width, info.depth_height);
            let told = written.notes.iter().any(|note| note.starts_with("camera-intrinsics.txt is for"));
            assert_eq!(told, differs && layout == WrittenLayout::TumRgbd, "{from}: {:?}", written.notes);
            if knows_up || read.up_in_world().is_none() {
                check(&read, &written, name, &original, &recording);
            }
        }
    }
}

#[test]
fn a_zip_holds_the_same() {
    let recording = Recording::small(3);
    let folder = as_folder(&EXPORTS[0].1("", &recording));
    let original = Clip::open(folder.path()).unwrap();
    for (layout, name) in LAYOUTS {
        let mut sink = ZipSink::new(Cursor::new(Vec::new()));
        let written = write(&original, layout, &mut sink, &Silent).unwrap();
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(sink.finish().unwrap().get_ref()).unwrap();
        check(&Clip::open(file.path()).unwrap(), &written, name, &original, &recording);
    }
}

/// Pictures are named by their times, so equal times would give equal names.
#[test]
fn times_that_do_not_increase_are_replaced() {
    let recording = Recording::small(4);
    let mut files = EXPORTS[0].1("", &recording);
    for (_, bytes) in files.iter_mut().filter(|(name, _)| name == "odometry.csv") {
        let text = String::from_utf8(bytes.clone()).unwrap();
        let same_time = |line: &str| match line.split_once(',') {
            Some((time, rest)) if time != "timestamp" => format!("5.0,{rest}\n"),
            _ => format!("{line}\n"),
        };
        *bytes = text.lines().map(same_time).collect::<String>().into_bytes();
    }
    let folder = as_folder(&files);
    let clip = Clip::open(folder.path()).unwrap();
    for (layout, name) in LAYOUTS {
        let out = tempfile::tempdir().unwrap();
        let written = write(&clip, layout, &mut FolderSink::new(out.path()), &Silent).unwrap();
        check(&Clip::open(out.path()).unwrap(), &written, name, &clip, &recording);
        let told = written.notes.iter().any(|note| note.contains("times that do not increase"));
        assert_eq!(told, layout != WrittenLayout::Scannet, "{name}: {:?}", written.notes);
    }
}

#[test]
fn frames_that_cannot_be_written_are_told() {
    let recording = Recording::small(4);
    let mut files = EXPORTS[0].1("", &recording);
    for (name, bytes) in &mut files {
        if name == "depth/000002.png" {
            bytes.truncate(40);
        }
        if name == "odometry.csv" {
            let text = String::from_utf8(bytes.clone()).unwrap();
            *bytes = text.lines().take(4).collect::<Vec<_>>().join("\n").into_bytes();
        }
    }
    let folder = as_folder(&files);
    let out = tempfile::tempdir().unwrap();
    let clip = Clip::open(folder.path()).unwrap();
    let written = write(&clip, WrittenLayout::Scannet, &mut FolderSink::new(out.path()), &Silent).unwrap();
    assert_eq!(written.frames, 2);
    for told in ["1 frames without a pose", "1 frames could not be decoded"] {
        assert!(written.notes.iter().any(|note| note.contains(told)), "{told}: {:?}", written.notes);
    }
}

#[test]
fn a_clip_of_depth_alone_keeps_its_camera() {
    let mut files = crate::writers::scannet("", &[0, 1, 2]);
    files.retain(|(name, _)| !name.starts_with("color/"));
    // The depth is 32 pixels wide.
    let matrix = "28 0 15.3 0\n0 28 11.3 0\n0 0 1 0\n0 0 0 1\n";
    crate::edits::set(&mut files, "intrinsic/intrinsic_depth.txt", matrix);
    let (folder, out) = (as_folder(&files), tempfile::tempdir().unwrap());
    let clip = Clip::open(folder.path()).unwrap();
    write(&clip, WrittenLayout::StrayScanner, &mut FolderSink::new(out.path()), &Silent).unwrap();
    let read = Clip::open(out.path()).unwrap();
    let notes = &read.info().notes;
    assert!(notes.iter().any(|note| note.contains("its size was assumed as 32x24")), "{notes:?}");
    let [wanted, found] = [clip, read].map(|clip| clip.load(0).unwrap().depth_camera);
    for (wanted, found) in
        [(wanted.fx, found.fx), (wanted.fy, found.fy), (wanted.cx, found.cx), (wanted.cy, found.cy)]
    {
        assert!((wanted - found).abs() < 1e-4, "{wanted} became {found}");
    }
}

/// SLAM programs take recordings without poses.
#[test]
fn a_clip_without_poses_is_written_for_tum() {
    let mut files = crate::writers::scannet("", &[0, 1, 2]);
    files.retain(|(name, _)| !name.starts_with("pose/"));
    let folder = as_folder(&files);
    let clip = Clip::open(folder.path()).unwrap();
    for (layout, name) in LAYOUTS {
        let out = tempfile::tempdir().unwrap();
        let written = write(&clip, layout, &mut FolderSink::new(out.path()), &Silent);
        if layout == WrittenLayout::TumRgbd {
            assert_eq!(written.unwrap().frames, 3);
            let read = Clip::open(out.path()).unwrap();
            assert_eq!((read.info().frames, read.info().frames_with_pose), (3, 0));
        } else {
            let refused = written.unwrap_err().to_string();
            assert!(refused.contains("no frame has a pose"), "{name}: {refused}");
        }
    }
}

#[test]
fn intrinsics_of_single_frames_that_are_lost_are_told() {
    let recording = Recording::small(3);
    let mut files = crate::export_writers::polycam("", &recording);
    let told = |files: &crate::writers::Files, layout: WrittenLayout| {
        let (folder, out) = (as_folder(files), tempfile::tempdir().unwrap());
        let clip = Clip::open(folder.path()).unwrap();
        let written = write(&clip, layout, &mut FolderSink::new(out.path()), &Silent).unwrap();
        written.notes.iter().any(|note| note.starts_with("1 frames have other intrinsics"))
    };
    for (layout, name) in LAYOUTS {
        assert!(!told(&files, layout), "{name}");
    }
    // The lens of the last frame has moved.
    let of_last = files.iter_mut().rfind(|(name, _)| name.contains("/corrected_cameras/")).unwrap();
    let mut camera: serde_json::Value = serde_json::from_slice(&of_last.1).unwrap();
    for focal in ["fx", "fy"] {
        camera[focal] = (1.05 * camera[focal].as_f64().unwrap()).into();
    }
    of_last.1 = serde_json::to_vec(&camera).unwrap();
    for (layout, name) in LAYOUTS {
        assert!(told(&files, layout), "{name}");
    }
}
