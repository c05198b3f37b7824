//! Checks of refusals, and files of the apps that must not be refused.

use crate::edits::{content, drop_member, edit_json, remove, rename, set};
use crate::export_writers as writers;
use crate::exports::{EXPORTS, Writer};
use crate::memory::peak_bytes;
use crate::recording::Recording;
use crate::unknown_scale::{colmap, points};
use crate::writers::{Files, as_folder, as_zip, encode, scannet, seven_scenes, tum};
use image::ImageFormat;
use serde_json::{Value, json};
use std::io::Cursor;
use std::process::Command;
use viola_formats::clip::write::{WriteError, WrittenLayout, ZipSink, write};
use viola_formats::clip::{Clip, ClipError, Frame};
use viola_geometry::progress::Silent;

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
    check_files(&changed(write, change), code, naming);
}

pub fn check_files(files: &Files, code: &str, naming: &str) {
    for opened in [Clip::open(as_folder(files).path()), Clip::open(as_zip(files).path())] {
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
    check_files_without_poses(&changed(write, change));
}

pub fn check_files_without_poses(files: &Files) {
    let clip = Clip::open(as_folder(files).path()).unwrap();
    assert_eq!((clip.info().frames_with_pose, clip.info().skipped_without_pose), (0, clip.info().frames));
    assert!(clip.info().notes.iter().any(|note| note.contains("tracked")), "{:?}", clip.info().notes);
}

const TRANSFORMS: &str = "transforms.json";

#[test]
fn cameras_of_nerfstudio_that_are_no_pinholes_are_refused() {
    let nerfstudio = writers::nerfstudio;
    let set = |pointer: &'static str, value: Value| {
        move |f: &mut Files| {
            edit_json(f, TRANSFORMS, |file| {
                let (parent, member) = pointer.rsplit_once('/').unwrap();
                file.pointer_mut(parent).unwrap()[member] = value;
            });
        }
    };
    for model in ["OPENCV_FISHEYE", "EQUIRECTANGULAR", "FISHEYE624", "ORTHOPHOTO", "a new one"] {
        for (pointer, of) in
            [("/camera_model", "all frames"), ("/frames/1/camera_model", "images/frame_00001.jpg")]
        {
            for naming in [format!("camera_model {model} of {of}"), "undistort".to_string()] {
                check(nerfstudio, set(pointer, json!(model)), "bad_intrinsics", &naming);
            }
        }
    }
    for is_fisheye in [json!(true), json!(1)] {
        check(nerfstudio, set("/is_fisheye", is_fisheye), "bad_intrinsics", "is_fisheye of all frames");
    }
    check(nerfstudio, set("/is_fisheye", json!("no")), "bad_metadata", "must be true, false, 0 or 1");
    let opened = |pointer: &'static str, value: Value| {
        Clip::open(as_folder(&changed(nerfstudio, set(pointer, value))).path())
            .unwrap_or_else(|error| panic!("{pointer}: {error}"))
    };
    for model in ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "pinhole", "OpenCV"] {
        opened("/camera_model", json!(model));
    }
    opened("/camera_model", Value::Null);
    for is_fisheye in [json!(false), json!(0), Value::Null] {
        opened("/is_fisheye", is_fisheye);
    }
    // A lens of all frames, of one frame, and one that bends less than a pixel.
    for (pointer, value, is_told) in
        [("/k1", 0.2, true), ("/frames/2/p2", -0.03, true), ("/frames/2/k1", 0.01, false)]
    {
        let clip = opened(pointer, json!(value));
        let notes = &clip.info().notes;
        assert_eq!(
            notes.iter().any(|note| note.contains("lens distortion")),
            is_told,
            "{pointer}: {notes:?}"
        );
    }
}

/// A number has two bytes in the file, and up to 32 in memory.
#[test]
fn long_lists_that_nobody_reads_cost_little_memory() {
    const NUMBERS: usize = 5_000_000;
    const MAX_BYTES: usize = 64 << 20;
    let list = format!("[{}0]", "0,".repeat(NUMBERS));
    let (nerfstudio, record3d): (Writer, Writer) = (writers::nerfstudio, writers::record3d);
    // The member with the list, and the one before which it stands.
    for (write, file, member, before, code) in [
        (nerfstudio, TRANSFORMS, "unread", "\"frames\":", None),
        (nerfstudio, TRANSFORMS, "unread", "\"file_path\":", None),
        (nerfstudio, TRANSFORMS, "is_fisheye", "\"frames\":", Some("bad_metadata")),
        (record3d, "metadata", "unread", "\"fps\":", None),
        (record3d, "metadata", "frameTimestamps", "\"fps\":", None),
    ] {
        let folder = as_folder(&changed(write, |f| {
            edit_json(f, file, |json| drop(json.as_object_mut().unwrap().remove(member)));
            let bytes = content(f, file);
            let text = String::from_utf8(std::mem::take(bytes)).unwrap();
            assert!(text.contains(before), "{member} before {before}: {text}");
            *bytes = text.replacen(before, &format!("\"{member}\":{list},{before}"), 1).into_bytes();
        }));
        let (opened, peak) = peak_bytes(|| Clip::open(folder.path()).map(drop));
        let refused = opened.err();
        assert_eq!(refused.as_ref().map(ClipError::code), code, "{member} before {before}: {refused:?}");
        assert!(peak < MAX_BYTES, "{member} before {before}: {peak} bytes at once");
    }
}

/// Each row would take some hundred bytes as a frame.
#[test]
fn lists_of_more_pictures_than_a_clip_may_have_cost_little_memory() {
    const ROWS: usize = 500_000;
    let mut files = tum("", &[0, 1]);
    for (list, picture, of) in
        [("rgb.txt", "c.jpg", "rgb/0.jpg"), ("depth.txt", "d.png", "depth/1305031229.500000.png")]
    {
        rename(&mut files, of, picture);
        *content(&mut files, list) = format!("1 {picture}\n").repeat(ROWS).into_bytes();
    }
    let folder = as_folder(&files);
    let (opened, peak) = peak_bytes(|| Clip::open(folder.path()).map(drop));
    check_error(opened.unwrap_err(), "too_many_frames", "500000");
    assert!(peak < 32 << 20, "{peak} bytes at once");
}

#[test]
fn poses_of_more_frames_than_a_clip_may_have_cost_little_memory() {
    let recording = Recording::small(2);
    let mut stray = writers::stray("", &recording);
    set(&mut stray, "odometry.csv", b"0 0 0 0 0 0 1\n".repeat(500_000));
    let mut text = colmap("", &recording);
    remove(&mut text, |name| name.starts_with("sparse/"));
    set(&mut text, "sparse/cameras.txt", "7 PINHOLE 64 48 56.5 57 31.5 22.5\n");
    set(&mut text, "sparse/images.txt", b"1 1 0 0 0 0 0 0 7 a.jpg\n".repeat(440_000));
    let mut image = 1u32.to_le_bytes().to_vec();
    image.extend([1.0f64, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0].iter().flat_map(|number| number.to_le_bytes()));
    image.extend(7u32.to_le_bytes());
    image.extend(b"a\0");
    image.extend(0u64.to_le_bytes());
    let images = [440_000u64.to_le_bytes().as_slice(), image.repeat(440_000).as_slice()].concat();
    let mut binary = colmap("", &recording);
    set(&mut binary, "sparse/images.bin", images);
    for (files, frames) in [(stray, "500000"), (text, "440000"), (binary, "440000")] {
        let folder = as_folder(&files);
        let (opened, peak) = peak_bytes(|| Clip::open(folder.path()).map(drop));
        check_error(opened.unwrap_err(), "too_many_frames", frames);
        assert!(peak < 64 << 20, "{frames}: {peak} bytes at once");
    }
}

#[test]
fn trajectories_elsewhere_cost_no_memory_if_one_lies_beside_the_pictures() {
    let pose = |number: u32| format!("{number} {number} {number}\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    let long: String = (1..=20_000).map(pose).collect();
    let mut files = writers::redwood("clip/", &Recording::small(3));
    files.extend((0..40).map(|number| (format!("other/{number}.log"), long.clone().into_bytes())));
    let folder = as_folder(&files);
    let (opened, peak) = peak_bytes(|| Clip::open(folder.path()).map(|clip| clip.info().frames_with_pose));
    assert_eq!(opened.unwrap(), 3);
    assert!(peak < 8 << 20, "{peak} bytes at once");
    // Without it, two of them are enough for the refusal.
    files.retain(|(name, _)| name != "clip/scene/trajectory.log");
    let folder = as_folder(&files);
    let (opened, peak) = peak_bytes(|| Clip::open(folder.path()).map(drop));
    check_error(opened.unwrap_err(), "several_trajectories", "other/1.log");
    assert!(peak < 16 << 20, "{peak} bytes at once");
}

#[test]
fn a_path_with_more_poses_than_a_clip_may_have_frames_is_thinned() {
    let mut files = points("scan.ply", "scan.txt", 5);
    *content(&mut files, "scan.txt") = b"1 0 0 0 0 0 0 1\n".repeat(250_000);
    let folder = as_folder(&files);
    let clip = Clip::open(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(clip.frames().len(), 83_334);
    assert!(
        clip.info().notes.iter().any(|note| note == "one of 3 poses was taken"),
        "{:?}",
        clip.info().notes
    );
}

/// BundleFusion's recordings and 12-Scenes have the header of a .sens file as text. Colour has twice the size of the pictures.
#[test]
fn cameras_of_an_info_file_are_used() {
    let (colour, depth) = ([56.5, 57.0, 31.5, 22.5], [28.25, 28.5, 15.75, 11.25]);
    let matrix = |[fx, fy, cx, cy]: [f64; 4]| format!("{fx} 0 {cx} 0 0 {fy} {cy} 0 0 0 1 0 0 0 0 1");
    let info = format!(
        "m_versionNumber = 4\nm_sensorName = StructureSensor\nm_colorWidth = 64\nm_colorHeight = 48\nm_depthWidth = 32\n\
         m_depthHeight = 24\nm_depthShift = 1000\nm_calibrationColorIntrinsic = {}\nm_calibrationDepthIntrinsic = {} \n",
        matrix(colour),
        matrix(depth)
    );
    let other = "a room with a view = 2\n".to_string();
    for (name, content, is_used) in [
        ("info.txt", info.clone(), true),
        ("seq/_info.txt", info.clone(), true),
        ("info.txt", other, false),
        ("info.txt", info.replace("28.5", "many"), false),
    ] {
        let mut files = seven_scenes("seq/", &[0, 1]);
        files.retain(|(name, _)| !name.ends_with("camera-intrinsics.txt"));
        files.push((name.to_string(), content.into_bytes()));
        let folder = as_folder(&files);
        let clip = Clip::open(folder.path()).unwrap_or_else(|error| panic!("{name}: {error}"));
        let is_assumed = clip.info().notes.iter().any(|note| note.contains("7-Scenes was assumed"));
        assert_eq!(is_assumed, !is_used, "{name}: {:?}", clip.info().notes);
        let frame = clip.load(1).unwrap();
        let fx = if is_used { 28.25 } else { 585.0 / 20.0 };
        for camera in [frame.color_camera, frame.depth_camera] {
            assert!((camera.fx - fx).abs() < 1e-9, "{name}: {camera:?}");
        }
    }
}

#[test]
fn members_of_record3d_that_are_null_are_as_absent() {
    for member in ["perFrameIntrinsicCoeffs", "frameTimestamps", "poses", "fps", "initPose"] {
        let info = |change: &dyn Fn(&mut Files)| {
            let clip = Clip::open(as_folder(&changed(writers::record3d, change)).path());
            clip.unwrap_or_else(|error| panic!("{member}: {error}")).info().clone()
        };
        let null = info(&|f| edit_json(f, "metadata", |metadata| metadata[member] = Value::Null));
        assert_eq!(null, info(&|f| drop_member(f, "metadata", member)), "{member}");
    }
}

/// Endings that [`in_capitals`] changes.
const ENDINGS: [&str; 13] =
    ["jpg", "png", "depth", "conf", "db", "db3", "mcap", "sens", "json", "pincam", "log", "txt", "ply"];

/// Returns the files with their endings in capitals. Files by which a layout is found have fixed names.
fn in_capitals(mut files: Files) -> Files {
    for (name, _) in &mut files {
        let is_fixed =
            matches!(name.as_str(), "transforms.json" | "rgb.txt" | "depth.txt" | "groundtruth.txt");
        if let Some((stem, ending)) = name.rsplit_once('.')
            && !is_fixed
            && ENDINGS.contains(&ending)
        {
            *name = format!("{stem}.{}", ending.to_uppercase());
        }
    }
    files
}

/// Pictures with such names were once dropped.
#[test]
fn endings_may_be_in_capitals() {
    let (recording, numbers) = (Recording::small(3), [0, 1, 2]);
    let mut cases: Vec<(&str, Files)> =
        EXPORTS.iter().map(|(layout, write, _)| (*layout, write("", &recording))).collect();
    cases.extend([
        ("scannet", scannet("", &numbers)),
        ("seven_scenes", seven_scenes("", &numbers)),
        ("tum_rgbd", tum("", &numbers)),
        ("points", points("lounge.ply", "lounge.txt", 5)),
        ("points", points("out/cloud.ply", "out/trajectory.txt", 5)),
    ]);
    for (layout, mut files) in cases {
        // A file that is alone may have any name.
        files.push(("README.md".to_string(), b"made by an app".to_vec()));
        let folders = [as_folder(&files), as_folder(&in_capitals(files))];
        let [plain, clip] = folders
            .each_ref()
            .map(|folder| Clip::open(folder.path()).unwrap_or_else(|error| panic!("{layout}: {error}")));
        assert_eq!(clip.info().layout, layout);
        assert_eq!(clip.frames(), plain.frames(), "{layout}");
        for index in 0..plain.frames().len() {
            let [plain, frame] = [&plain, &clip].map(|clip| clip.load(index).unwrap());
            assert!(frame.color == plain.color, "{layout}: the colour of frame {index}");
            assert_eq!(frame.depth, plain.depth, "{layout}: frame {index}");
            let cameras = |frame: &Frame| (frame.color_camera, frame.depth_camera);
            assert_eq!(cameras(&frame), cameras(&plain), "{layout}: frame {index}");
        }
    }
    let mut recording = Recording::small(3);
    recording.color_size = (160, 120);
    let video = std::fs::read(format!("{}/tests/video/h264_no_b.mp4", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let mut files = writers::stray_with_video("", &recording, video);
    rename(&mut files, "rgb.mp4", "rgb.MP4");
    assert!(Clip::open(as_folder(&files).path()).unwrap().has_video());
}

#[test]
fn a_conversion_of_pictures_that_cannot_be_decoded_names_the_first() {
    let mut files = writers::stray("clip/", &Recording::small(3));
    for (_, bytes) in files.iter_mut().filter(|(name, _)| name.contains("/depth/")) {
        *bytes = grey8(32, 24);
    }
    let folder = as_folder(&files);
    for out in ["out", "out.zip"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viola"));
        command.args(["convert", "clip", "--to", "tum", "--out", out]).current_dir(folder.path());
        let output = command.output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{out}: {stderr}");
        for words in ["none of 3 frames can be decoded", "depth/000000.png is L8"] {
            assert!(stderr.contains(words), "{out}: {words}: {stderr}");
        }
        assert!(!folder.path().join(out).exists(), "{out}");
    }
    let clip = Clip::open(&folder.path().join("clip")).unwrap();
    let mut sink = ZipSink::new(Cursor::new(Vec::new()));
    match write(&clip, WrittenLayout::TumRgbd, &mut sink, &Silent).unwrap_err() {
        WriteError::NotDecoded { frames: 3, source } => {
            check_error(source, "depth_not_grey16", "depth/000000.png");
        }
        error => panic!("{error}"),
    }
}

/// Clips are given one by one, and not as the folder of their archives.
#[test]
fn a_folder_of_archives_is_told_from_a_clip() {
    let clip = crate::writers::zip_bytes(&scannet("", &[0, 1]));
    let files = ["a.zip", "b.zip", "notes.txt"].map(|name| (name.to_string(), clip.clone()));
    let refused = Clip::open(as_folder(&files).path()).err().unwrap();
    check_error(refused, "not_an_archive", "a.zip is an archive inside of the archive or folder");
}
