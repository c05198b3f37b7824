//! Clips as other programs write, change or pack them: all but archives in archives and unknown cameras are read.

use crate::bags::db3;
use crate::edits::*;
use crate::export_writers as writers;
use crate::exports::check_poses;
use crate::recording::{Recording, gl};
use crate::refusals::check_error;
use crate::writers::{Files, depth_png, open, seven_scenes, tum, zip_bytes};
use nalgebra::Matrix4;
use serde_json::json;
use viola_formats::clip::Clip;

fn check_note(clip: &Clip, words: &str) {
    let notes = &clip.info().notes;
    assert!(notes.iter().any(|note| note.contains(words)), "{words}: {notes:?}");
}

#[test]
fn paths_of_windows_are_read() {
    let recording = Recording::small(3);
    let mut files = writers::nerfstudio("", &recording);
    edit_json(&mut files, "transforms.json", |file| {
        for frame in file["frames"].as_array_mut().unwrap() {
            for member in ["file_path", "depth_file_path"] {
                frame[member] = json!(frame[member].as_str().unwrap().replace('/', "\\"));
            }
        }
    });
    check_poses(&open(&files).unwrap(), &recording, "nerfstudio");

    let mut files = tum("", &[0, 1, 2]);
    for list in ["rgb.txt", "depth.txt"] {
        edit_lines(&mut files, list, |_, line| Some(line.replace('/', "\\")));
    }
    assert_eq!(open(&files).unwrap().info().frames, 3);
}

#[test]
fn a_byte_order_mark_in_front_of_a_text_is_read() {
    let recording = Recording::small(3);
    let lists = ["rgb.txt", "depth.txt", "groundtruth.txt", "camera-intrinsics.txt"];
    let cases: [(Files, &[&str]); 5] = [
        (writers::stray("", &recording), &["odometry.csv", "camera_matrix.csv"]),
        (writers::nerfstudio("", &recording), &["transforms.json"]),
        (writers::redwood("", &recording), &["scene/trajectory.log", "camera_intrinsic.json"]),
        (writers::spectacular("", &recording), &["data.jsonl"]),
        (tum("", &[0, 1, 2]), &lists),
    ];
    for (files, texts) in cases {
        let plain = open(&files).unwrap();
        for name in texts {
            let mut marked = files.clone();
            let bytes = [&b"\xef\xbb\xbf"[..], content(&mut marked, name).as_slice()].concat();
            set(&mut marked, name, bytes);
            let clip = open(&marked).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(clip.frames(), plain.frames(), "{name}");
        }
    }
}

#[test]
fn frames_in_any_order_are_sorted_by_their_times() {
    let recording = Recording::small(3);
    let mut files = writers::nerf_capture("", &recording);
    edit_json(&mut files, "transforms.json", |file| file["frames"].as_array_mut().unwrap().reverse());
    check_poses(&open(&files).unwrap(), &recording, "nerf_capture");
}

#[test]
fn depth_path_alone_does_not_tell_the_upward_axis() {
    let recording = Recording::small(3);
    let with_marks = |marks: &[&str]| {
        let has = |mark: &str| marks.contains(&mark);
        let mut files = writers::nerf_capture("", &recording);
        edit_json(&mut files, "transforms.json", |file| {
            let scale = file.as_object_mut().unwrap().remove("depth_integer_scale").unwrap();
            file[if has("scale") { "depth_integer_scale" } else { "integer_depth_scale" }] = scale;
            for frame in file["frames"].as_array_mut().unwrap() {
                if !has("time") {
                    frame.as_object_mut().unwrap().remove("timestamp");
                }
                for member in ["file_path", "depth_path"].into_iter().filter(|_| !has("names")) {
                    frame[member] = json!(frame[member].as_str().unwrap().replace("images/", "data/"));
                }
            }
        });
        for (name, _) in files.iter_mut().filter(|_| !has("names")) {
            *name = name.replace("images/", "data/");
        }
        let clip = open(&files).unwrap_or_else(|error| panic!("{marks:?}: {error}"));
        check_poses(&clip, &recording, &clip.info().layout);
        clip
    };
    for mark in ["scale", "time", "names"] {
        let clip = with_marks(&[mark]);
        assert_eq!(clip.info().layout, "nerf_capture", "{mark}");
        assert!(clip.up_in_world().is_some(), "{mark}");
    }
    let clip = with_marks(&[]);
    assert_eq!((clip.info().layout.as_str(), clip.up_in_world()), ("nerfstudio", None));
}

#[test]
fn poses_that_are_all_the_identity_are_not_used() {
    let all_at = |count: u32, pose: Matrix4<f64>| {
        let mut recording = Recording::small(count);
        recording.frames.iter_mut().for_each(|frame| frame.world_from_camera = pose);
        recording
    };
    let identity = Matrix4::identity();
    let read = |files: Files| open(&files).unwrap();
    // Nerfstudio's matrices, too, are the identity.
    let redwood = read(writers::redwood("", &all_at(3, identity)));
    let nerfstudio = read(writers::nerfstudio("", &all_at(3, gl(&identity))));
    for clip in [redwood, nerfstudio] {
        assert_eq!((clip.info().frames, clip.info().frames_with_pose), (3, 0));
        check_note(&clip, "all poses are the identity");
        check_note(&clip, "tracked");
    }
    // Too few to tell a placeholder from a device at rest.
    let tripod = Recording::small(1).frames[0].world_from_camera;
    for (count, pose) in [(2, identity), (3, tripod)] {
        let clip = read(writers::redwood("", &all_at(count, pose)));
        assert_eq!(clip.info().frames_with_pose, clip.info().frames);
    }
}

/// Stray Scanner's frames are 0.1 s apart, and Redwood has no times.
#[test]
fn poses_that_are_all_equal_for_two_seconds_are_not_used() {
    let at_rest = |count: u32| {
        let mut recording = Recording::small(count);
        let pose = recording.frames[0].world_from_camera;
        recording.frames.iter_mut().for_each(|frame| frame.world_from_camera = pose);
        recording
    };
    let with_pose = |files: &Files| open(files).unwrap().info().frames_with_pose;
    assert_eq!(with_pose(&writers::stray("", &at_rest(20))), 20);
    assert_eq!(with_pose(&writers::redwood("", &at_rest(59))), 59);
    for (files, count) in [(writers::stray("", &at_rest(25)), 25), (writers::redwood("", &at_rest(60)), 60)] {
        let clip = open(&files).unwrap();
        assert_eq!((clip.info().frames, clip.info().frames_with_pose), (count, 0));
        check_note(&clip, &format!("all {count} poses are equal"));
        check_note(&clip, "or of a camera that stood still");
        check_note(&clip, "tracked by its pictures");
    }
    // Without colour nothing can be tracked, and a robot stands still without noise.
    let mut files = writers::stray("", &at_rest(25));
    remove(&mut files, |name| name.starts_with("rgb/"));
    assert_eq!(with_pose(&files), 25);
    assert_eq!(with_pose(&db3("", &at_rest(25))), 25);
    let mut moved = at_rest(60);
    moved.frames[30].world_from_camera[(0, 3)] += 1e-4;
    assert_eq!(with_pose(&writers::redwood("", &moved)), 60);
}

#[test]
fn an_archive_in_an_archive_is_refused_by_name() {
    let inner = zip_bytes(&writers::record3d("", &Recording::small(2)));
    let files = vec![("Room 1.r3d".to_string(), inner)];
    check_error(open(&files).err().unwrap(), "not_an_archive", "Room 1.r3d is an archive");
}

#[test]
fn pictures_that_no_kinect_took_need_their_intrinsics() {
    let file = "camera-intrinsics.txt";
    // The assumed intrinsics of 640x480 pixels, for pictures of 32x24.
    for (mut files, told, expected) in [
        (tum("", &[0, 1, 2]), "Kinect", [26.25, 26.25, 15.5, 11.5]),
        (seven_scenes("", &[0, 1, 2]), "depth camera of 7-Scenes", [29.25, 29.25, 15.525, 11.525]),
    ] {
        remove(&mut files, |name| name == file);
        let clip = open(&files).unwrap_or_else(|error| panic!("{told}: {error}"));
        check_note(&clip, told);
        assert!(clip.info().intrinsics.contains("assumed"), "{told}: {}", clip.info().intrinsics);
        let camera = clip.load(0).unwrap().depth_camera;
        for (found, expected) in [camera.fx, camera.fy, camera.cx, camera.cy].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{told}: {camera:?}");
        }
        for (_, bytes) in files.iter_mut().filter(|(name, _)| name.ends_with(".png")) {
            *bytes = depth_png(48, 27, |_, _| 1000);
        }
        check_error(open(&files).err().unwrap(), "missing_intrinsics", file);
    }
}

#[test]
fn a_last_row_that_was_cut_off_is_left_out() {
    let recording = Recording::small(3);
    let mut felt = tum("", &[0, 1, 2]);
    set(&mut felt, "accelerometer.txt", "1305031229.49 1 2 -9\n1305031229.51 3 4 -7\n");
    // The frames that are left, and those with a pose.
    let cases: [(Files, &str, [usize; 2]); 7] = [
        (writers::stray("", &recording), "odometry.csv", [3, 2]),
        (writers::arkit_scenes("", &recording), "lowres_wide.traj", [3, 2]),
        (writers::redwood("", &recording), "scene/trajectory.log", [3, 2]),
        (felt.clone(), "groundtruth.txt", [3, 2]),
        (felt.clone(), "accelerometer.txt", [3, 3]),
        (felt.clone(), "rgb.txt", [2, 2]),
        (felt, "depth.txt", [2, 2]),
    ];
    for (mut files, name, left) in cases {
        let whole = content(&mut files, name).clone();
        let blank = whole.iter().rposition(|byte| *byte == b' ').unwrap();
        // The last column is missing, or its number ends too early. A part of a picture's name is a name as well.
        let is_list = matches!(name, "rgb.txt" | "depth.txt");
        for end in [blank, whole.len() - 2].into_iter().take(if is_list { 1 } else { 2 }) {
            set(&mut files, name, &whole[..end]);
            let clip = open(&files).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!([clip.info().frames, clip.info().frames_with_pose], left, "{name}");
            check_note(&clip, "was cut off");
            set(&mut files, name, [&whole[..end], b"\n"].concat());
            check_error(open(&files).err().unwrap(), "bad_index", name);
        }
    }
    // The rest of the row has as many columns as a row of an old recording.
    let mut files = writers::stray("", &recording);
    let text = String::from_utf8(content(&mut files, "odometry.csv").clone()).unwrap();
    let (end, _) = text.rmatch_indices(", ").nth(1).unwrap();
    set(&mut files, "odometry.csv", &text[..end]);
    check_note(&open(&files).unwrap(), "was cut off");
    // A pose of several rows may end with a whole one.
    let mut files = writers::redwood("", &recording);
    edit_lines(&mut files, "scene/trajectory.log", |number, line| (number < 13).then(|| line.to_string()));
    let clip = open(&files).unwrap();
    assert_eq!(clip.info().frames_with_pose, 2);
    check_note(&clip, "was cut off");
}

#[test]
fn a_row_that_was_cut_off_does_not_cost_the_intrinsics_of_the_others() {
    let mut files = writers::stray("", &Recording::small(3));
    edit_lines(&mut files, "odometry.csv", |number, line| {
        let behind = if number == 0 { "fx, fy, cx, cy" } else { "57.25, 57.5, 31.25, 23.5" };
        Some(format!("{line}, {behind}"))
    });
    let whole = content(&mut files, "odometry.csv").clone();
    // The line end is missing, then digits of cy, and then all but the pose.
    let cut_to_pose = whole.len() - ", 57.25, 57.5, 31.25, 23.5\n".len();
    for (end, with_pose) in [
        (whole.len() - 1, 3),
        (whole.len() - 2, 2),
        (whole.len() - 3, 2),
        (whole.len() - 4, 2),
        (cut_to_pose, 2),
    ] {
        set(&mut files, "odometry.csv", &whole[..end]);
        let clip = open(&files).unwrap();
        let told = String::from_utf8_lossy(&whole[end - 8..end]);
        assert!(clip.info().intrinsics.contains("for each frame"), "{told}: {}", clip.info().intrinsics);
        assert_eq!(clip.info().frames_with_pose, with_pose, "{told}");
        if with_pose == 2 {
            check_note(&clip, "was cut off");
        }
    }
}

/// Returns a recording of six frames whose pictures have other numbers, and whose poses are counted from 1.
fn counted_redwood(number_of: impl Fn(u32) -> u32) -> Files {
    let mut files = writers::redwood("", &Recording::small(6));
    for (name, _) in &mut files {
        let renamed = ["color/", "depth/"].into_iter().find_map(|folder| {
            let (number, ending) = name.strip_prefix(folder)?.split_once('.')?;
            Some(format!("{folder}{:06}.{ending}", number_of(number.parse().ok()?)))
        });
        if let Some(renamed) = renamed {
            *name = renamed;
        }
    }
    files
}

#[test]
fn poses_of_redwood_without_the_last_ones_are_not_given_to_other_pictures() {
    let log = "scene/trajectory.log";
    let from = |first: u32| move |number: u32| first + number;
    // The last pose was cut off: it counts.
    for files in [counted_redwood(from(3)), counted_redwood(|number| 5 * number)] {
        let mut frames = open(&files).unwrap().frames().to_vec();
        frames.last_mut().unwrap().world_from_camera = None;
        let mut files = files;
        let bytes = content(&mut files, log);
        bytes.truncate(bytes.len() - 30);
        let clip = open(&files).unwrap();
        assert_eq!(clip.frames(), frames);
        check_note(&clip, "was cut off");
    }
    // The last two are missing, with five lines each, or one and a half.
    for kept in [20, 22] {
        let cut = |mut files: Files| {
            edit_lines(&mut files, log, |number, line| (number < kept).then(|| line.to_string()));
            open(&files)
        };
        // These numbers cannot be those of frames 1 to 4.
        let clip = cut(counted_redwood(from(100))).unwrap();
        let has_pose: Vec<bool> = clip.frames().iter().map(|f| f.world_from_camera.is_some()).collect();
        assert_eq!(has_pose, [true, true, true, true, false, false]);
        check_note(&clip, "has 4 poses for 6 pictures");
        for files in [counted_redwood(from(3)), counted_redwood(|number| 5 * number)] {
            check_error(cut(files.clone()).err().unwrap(), "bad_metadata", "unknown which pose is whose");
            if kept == 22 {
                check_error(cut(files).err().unwrap(), "bad_metadata", "was cut off");
            }
        }
    }
}

#[test]
fn pictures_of_redwood_keep_their_poses_without_the_others() {
    let files = writers::redwood("", &Recording::small(6));
    let whole = open(&files).unwrap();
    let number = |name: &str| -> Option<u32> {
        let stem = name.strip_suffix(".jpg").or(name.strip_suffix(".png"))?;
        stem.rsplit_once('/')?.1.parse().ok()
    };
    let open_some = |kept: &[u32]| {
        let mut some = files.clone();
        remove(&mut some, |name| number(name).is_some_and(|number| !kept.contains(&number)));
        open(&some)
    };
    for kept in [&[2, 3, 4, 5][..], &[0, 1, 2], &[0, 2, 4]] {
        let clip = open_some(kept).unwrap_or_else(|error| panic!("{kept:?}: {error}"));
        let frames = whole.frames().iter().filter(|frame| kept.contains(&frame.number));
        assert_eq!(clip.frames(), frames.cloned().collect::<Vec<_>>(), "{kept:?}");
    }
    // The pictures may count from 0 or from 1.
    for naming in [
        "scene/trajectory.log",
        "6 poses, of the frames 1 to 6, for 2 pictures, with the numbers 2 to 3",
        "keep one pose for each picture",
    ] {
        check_error(open_some(&[2, 3]).err().unwrap(), "bad_metadata", naming);
    }
}

#[test]
fn poses_of_stray_scanner_before_it_tracks_are_not_used() {
    // The first rows that are at the origin, and those without a pose.
    for (at_origin, untracked) in [(1, 0), (2, 2), (3, 3), (4, 0)] {
        let mut files = writers::stray("", &Recording::small(4));
        edit_lines(&mut files, "odometry.csv", |number, line| {
            let mut words: Vec<&str> = line.split(", ").collect();
            if (1..=at_origin).contains(&number) {
                words[2..5].fill("0.0");
            }
            Some(words.join(", "))
        });
        let clip = open(&files).unwrap();
        let has_pose: Vec<bool> = clip.frames().iter().map(|f| f.world_from_camera.is_some()).collect();
        let expected: Vec<bool> = (0..4).map(|row| row >= untracked).collect();
        assert_eq!(has_pose, expected, "{at_origin} rows at the origin");
        if untracked > 0 {
            check_note(&clip, &format!("the first {untracked} rows"));
        }
    }
}

/// The poses are 40 ms before and 60 ms after each picture.
#[test]
fn tum_poses_of_ten_hertz_are_interpolated() {
    let mut files = tum("", &[0, 1, 2]);
    // A walk of 1 m/s along x, and a turn of 1 rad/s about z.
    let row = |t: f64| {
        let (time_s, half) = (1_305_031_229.0 + t, t / 2.0);
        format!("{time_s:.4} {t} 0 0 0 0 {} {}\n", half.sin(), half.cos())
    };
    set(&mut files, "groundtruth.txt", [0.46, 0.56, 0.66, 0.76].map(row).concat());
    let clip = open(&files).unwrap();
    for (frame, t) in clip.frames().iter().zip([0.5, 0.6, 0.7]) {
        let pose = frame.world_from_camera.unwrap_or_else(|| panic!("no pose at {t}"));
        let (x_m, turn_rad) = (pose.translation.x, pose.rotation.angle());
        assert!((x_m - t).abs() < 1e-5 && (turn_rad - t).abs() < 1e-5, "{x_m} m and {turn_rad} rad at {t}");
    }
}

#[test]
fn the_log_beside_a_bag_is_noted() {
    let mut files = db3("", &Recording::small(3));
    files.push(("bag_0.db3-wal".to_string(), vec![1]));
    check_note(&open(&files).unwrap(), "bag_0.db3-wal was not read");
}

/// The video has 30 frames.
#[test]
fn a_stray_scanner_recording_without_its_start_has_the_colour_of_its_rows() {
    let video = format!("{}/tests/video/h264_no_b.mp4", env!("CARGO_MANIFEST_DIR"));
    let video = std::fs::read(video).unwrap();
    let read = |first: u32, frames: u32| {
        let mut recording = Recording::small(frames);
        recording.color_size = (160, 120);
        recording.frames.iter_mut().for_each(|frame| frame.number += first);
        let clip = open(&writers::stray_with_video("", &recording, video.clone())).unwrap();
        assert_eq!(clip.info().frames, frames as usize, "from {first}");
        clip
    };
    let color = |clip: &Clip, index: usize| clip.load(index).unwrap().color.unwrap();
    let whole = read(0, 30);
    // The video was cut with the odometry, or the odometry alone.
    for (cut, at) in [(read(5, 30), 0), (read(5, 25), 5)] {
        for index in [0, 3, 24] {
            assert!(color(&cut, index) == color(&whole, index + at), "frame {index}, {at} later");
        }
    }
}
