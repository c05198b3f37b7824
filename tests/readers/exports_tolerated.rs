//! Exports of older versions of the apps, and exports without optional parts: all are read.

use crate::edits::*;
use crate::export_writers as writers;
use crate::exports::{EXPORTS, Writer, check_poses};
use crate::recording::Recording;
use crate::writers::{Files, as_folder, color_jpeg, open};
use serde_json::json;
use viola_formats::clip::{Clip, DepthImage};

/// Checks that a changed export is read with all its frames, and with the recording's poses and depth.
fn check_recording(write: Writer, recording: &Recording, change: impl FnOnce(&mut Files)) -> Clip {
    let mut files = write("", recording);
    change(&mut files);
    let clip = open(&files).unwrap_or_else(|error| panic!("{error}"));
    check_poses(&clip, recording, &clip.info().layout);
    for (index, frame) in recording.frames.iter().enumerate() {
        let DepthImage { depth_m, .. } = clip.load(index).unwrap_or_else(|error| panic!("{error}")).depth;
        let place = |(x, y): &(u32, u32)| (y * recording.depth_size.0 + x) as usize;
        let doubtful: Vec<usize> = recording.doubtful.iter().map(place).collect();
        let pixels = frame.depth_mm.iter().zip(&depth_m).enumerate();
        for (at, (&mm, &got_m)) in pixels.filter(|(at, _)| !doubtful.contains(at)) {
            assert!((got_m - f32::from(mm) / 1000.0).abs() < 1e-6, "{got_m} m instead of {mm} mm at {at}");
        }
    }
    clip
}

fn check(write: Writer, change: impl FnOnce(&mut Files)) -> Clip {
    check_recording(write, &Recording::small(3), change)
}

fn check_told(clip: &Clip, words: &str) {
    let info = clip.info();
    let told = format!("{:?} {} {}", info.notes, info.intrinsics, info.depth_unit);
    assert!(told.contains(words), "{words}: {told}");
}

/// Returns an array as NumPy and cnpy write it, padded so that the readings begin at a multiple of 16 bytes.
pub fn npy(dtype: &str, fortran: &str, shape: &str, readings: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{dtype}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 16 != 0 {
        header.push(' ');
    }
    header.push('\n');
    [&b"\x93NUMPY\x01\0"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), readings].concat()
}

/// Replaces Stray Scanner's pictures of depth by arrays.
pub fn depth_as_npy(files: &mut Files, dtype: &str, fortran: &str, shape: &str) {
    for (name, bytes) in files.iter_mut().filter(|(name, _)| name.starts_with("depth/")) {
        let image = image::load_from_memory(bytes).unwrap().into_luma16();
        let readings: Vec<u8> = image.iter().flat_map(|mm| mm.to_le_bytes()).collect();
        *name = name.replace(".png", ".npy");
        *bytes = npy(dtype, fortran, shape, &readings);
    }
}

/// Replaces Nerfstudio's pictures of depth by arrays.
fn nerfstudio_as_npy(files: &mut Files, dtype: &str, bytes_of_mm: fn(u16) -> Vec<u8>) {
    edit_json(files, "transforms.json", |file| {
        for frame in file["frames"].as_array_mut().unwrap() {
            let path = frame["depth_file_path"].as_str().unwrap().replace(".png", ".npy");
            frame["depth_file_path"] = json!(path);
        }
    });
    for (name, bytes) in files.iter_mut().filter(|(name, _)| name.starts_with("depths/")) {
        let image = image::load_from_memory(bytes).unwrap().into_luma16();
        let readings: Vec<u8> = image.iter().flat_map(|mm| bytes_of_mm(*mm)).collect();
        *name = name.replace(".png", ".npy");
        *bytes = npy(dtype, "False", "(24, 32)", &readings);
    }
}

/// Returns a whole number up to 2047 as a float of 16 bits.
fn half(whole: u16) -> Vec<u8> {
    let Some(power) = whole.checked_ilog2() else { return vec![0, 0] };
    let fraction = (whole << (10 - power)) & 0x3ff;
    (((power as u16 + 15) << 10) | fraction).to_le_bytes().to_vec()
}

#[test]
fn nerfstudio_with_arrays_of_depth() {
    let metres = |mm: u16| (f32::from(mm) / 1000.0).to_le_bytes().to_vec();
    type Kind = (&'static str, fn(u16) -> Vec<u8>, &'static str);
    let kinds: [Kind; 5] = [
        ("<u2", |mm| mm.to_le_bytes().to_vec(), "millimetres (.npy)"),
        ("<f2", half, "millimetres (.npy)"),
        ("<f4", |mm| f32::from(mm).to_le_bytes().to_vec(), "millimetres (.npy)"),
        ("<f4", metres, "depth was read as metres, not as millimetres"),
        // Of a camera's integers, divided by 1000.
        ("<f8", |mm| (f64::from(mm) / 1000.0).to_le_bytes().to_vec(), "depth was read as metres"),
    ];
    for (dtype, bytes_of_mm, told) in kinds {
        let clip = check(writers::nerfstudio, |f| nerfstudio_as_npy(f, dtype, bytes_of_mm));
        check_told(&clip, told);
    }
    // The scale of the file is believed.
    let clip = check(writers::nerfstudio, |f| {
        nerfstudio_as_npy(f, "<f4", |mm| (f32::from(mm) / 10.0).to_le_bytes().to_vec());
        edit_json(f, "transforms.json", |file| file["integer_depth_scale"] = json!(0.01));
    });
    check_told(&clip, "integer_depth_scale (.npy)");
    let integers = |f: &mut Files| {
        nerfstudio_as_npy(f, "<i4", |mm| i32::from(mm).to_le_bytes().to_vec());
    };
    crate::refusals::check(writers::nerfstudio, integers, "bad_depth", "<i4; save depth as float32");
    let cut_array = |f: &mut Files| {
        nerfstudio_as_npy(f, "<f4", |mm| f32::from(mm).to_le_bytes().to_vec());
        cut(f, "depths/frame_00002.npy", 0.5);
    };
    crate::refusals::check_frame(writers::nerfstudio, cut_array, "bad_depth", "readings");
}

#[test]
fn stray_scanner_of_all_ages() {
    let stray = writers::stray;
    let odometry = "odometry.csv";
    check(stray, |f| remove(f, |name| name == "imu.csv" || name.starts_with("confidence/")));
    let clip = check(stray, |f| depth_as_npy(f, "<u2", "False", "(24, 32)"));
    check_told(&clip, "16-bit .npy");
    let without_times = |keep_head: bool| {
        move |f: &mut Files| {
            edit_lines(f, odometry, |number, line| {
                (number > 0 || keep_head).then(|| line.splitn(3, ", ").nth(2).unwrap().to_string())
            });
        }
    };
    assert_eq!(check(stray, without_times(false)).info().duration_s, None);
    assert_eq!(check(stray, without_times(true)).info().duration_s, None);
    // The first versions write no line end behind the last row, and numbers with as many digits as they need.
    let clip = check(stray, |f| {
        without_times(false)(f);
        edit_lines(f, odometry, |number, line| {
            let (before, last) = line.rsplit_once(", ").unwrap();
            let last = last.parse::<f64>().unwrap();
            Some(if number == 1 { format!("{before}, {last}") } else { format!("{before}, {last:.5}") })
        });
        assert_eq!(content(f, odometry).pop(), Some(b'\n'));
    });
    assert!(clip.info().notes.iter().all(|note| !note.contains("cut off")), "{:?}", clip.info().notes);
    // Since April 2026: the frame's own intrinsics, and the centre of the distortion, which may be empty.
    for centre in ["", ", , ", ", 31.5, 23.5"] {
        let clip = check(stray, |f| {
            edit_lines(f, odometry, |number, line| {
                let fx = 57.0 + number as f64 * 0.1;
                let behind = match (number, centre) {
                    (0, "") => "fx, fy, cx, cy".to_string(),
                    (0, _) => "fx, fy, cx, cy, distortion_center_x, distortion_center_y".to_string(),
                    (_, centre) => format!("{fx}, 57.5, 31.25, 23.5{centre}"),
                };
                Some(format!("{line}, {behind}"))
            });
        });
        check_told(&clip, "odometry.csv, for each frame");
        let camera = clip.load(2).unwrap().color_camera;
        assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy], [57.3, 57.5, 31.25, 23.5]);
    }
    // Intrinsics for another picture size are ignored.
    let clip = check(stray, |f| {
        edit_lines(f, odometry, |number, line| {
            Some(if number == 0 { line.to_string() } else { format!("{line}, 1339, 1339, 960, 720") })
        });
    });
    check_told(&clip, "not near those of camera_matrix.csv");
    check_told(&clip, "of the last frame");
}

/// Checks that two clips have the same poses, cameras and depth, and colours that differ by at most `levels` on average.
fn check_same(clip: &Clip, other: &Clip, levels: f64) {
    assert_eq!(clip.frames(), other.frames());
    for index in 0..clip.frames().len() {
        let (frame, other) = (clip.load(index).unwrap(), other.load(index).unwrap());
        assert_eq!(frame.color_camera, other.color_camera);
        assert_eq!((frame.depth_camera, frame.depth), (other.depth_camera, other.depth));
        let (color, other) = (frame.color.unwrap(), other.color.unwrap());
        assert_eq!(color.dimensions(), other.dimensions());
        let sum: u64 = color.iter().zip(other.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        let off = sum as f64 / color.len() as f64;
        assert!(off <= levels, "frame {index}: {off} levels");
    }
}

#[test]
fn stray_scanner_with_a_turned_video() {
    let mut recording = Recording::small(3);
    recording.color_size = (160, 120);
    let read = |name: &str| {
        let video = std::fs::read(format!("{}/tests/video/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
        let files = writers::stray_with_video("", &recording, video);
        let clip = open(&files).unwrap();
        check_poses(&clip, &recording, name);
        assert_eq!((clip.info().color_width, clip.info().color_height), (160, 120), "{name}");
        clip
    };
    // The app writes the turn into the header alone.
    let turned = read("rotated.mp4");
    check_told(&turned, "90 degrees in its header was not applied");
    check_same(&turned, &read("h264_no_b.mp4"), 0.0);
    let turned = read("hevc_rotated.mp4");
    check_same(&turned, &read("hevc_no_b.mp4"), 0.0);
    // Another program applied it, and coded the pictures again.
    let upright = read("hevc_upright.mp4");
    check_told(&upright, "turned back by a quarter");
    check_same(&upright, &turned, 3.0);
}

#[test]
fn stray_scanner_with_upright_pictures() {
    let turn = |f: &mut Files| {
        for (name, bytes) in f.iter_mut().filter(|(name, _)| name.starts_with("rgb/")) {
            let picture = image::load_from_memory(bytes).unwrap().rotate90();
            *name = name.replace(".jpg", ".png");
            bytes.clear();
            picture.write_to(&mut std::io::Cursor::new(bytes), image::ImageFormat::Png).unwrap();
        }
    };
    let clip = check(writers::stray, turn);
    check_told(&clip, "turned back by a quarter");
    check_same(&clip, &check(writers::stray, |_| ()), 0.0);
    // Intrinsics that are upright as well belong to another depth.
    let matrix = "57, 0, 23.5\n0, 56.5, 31.5\n0, 0, 1\n";
    let mut files = writers::stray("", &Recording::small(3));
    turn(&mut files);
    set(&mut files, "camera_matrix.csv", matrix);
    assert_eq!(open(&files).err().map(|error| error.code()), Some("color_depth_mismatch"));
}

#[test]
fn record3d_of_all_ages() {
    let record3d = writers::record3d;
    check(record3d, |f| remove(f, |name| name.ends_with(".conf")));
    let clip = check(record3d, |f| drop_member(f, "metadata", "perFrameIntrinsicCoeffs"));
    check_told(&clip, "of the first frame");
    let clip = check(record3d, |f| {
        edit_json(f, "metadata", |m| m["perFrameIntrinsicCoeffs"] = json!(vec![[23.5, 31.5, 56.0, 57.0]; 3]));
    });
    check_told(&clip, "K was used");
    let clip = check(record3d, |f| drop_member(f, "metadata", "frameTimestamps"));
    // Ten frames a second.
    assert_eq!(clip.info().duration_s, Some(0.2));
    let clip = check(record3d, |f| {
        drop_member(f, "metadata", "frameTimestamps");
        drop_member(f, "metadata", "fps");
    });
    assert_eq!(clip.info().duration_s, None);
    // Decreasing times are ignored.
    let backwards = json!([3.0, 2.0, 1.0]);
    let clip = check(record3d, |f| edit_json(f, "metadata", |m| m["frameTimestamps"] = backwards));
    assert_eq!(clip.info().duration_s, None);

    // Without dw and dh the size is known by the length, that of a phone's sensor, and depth lies as colour does.
    for (depth_size, color_size) in [((192, 256), (72, 96)), ((256, 192), (96, 72))] {
        let mut recording = Recording::small(2);
        (recording.depth_size, recording.color_size) = (depth_size, color_size);
        recording.depth_k = [170.0, 171.0, f64::from(depth_size.0) / 2.0, f64::from(depth_size.1) / 2.0];
        for frame in &mut recording.frames {
            frame.depth_mm = (0..192 * 256).map(|i| 500 + (i % 3000) as u16).collect();
            frame.jpeg = color_jpeg(color_size.0, color_size.1);
        }
        let clip = check_recording(record3d, &recording, |f| {
            drop_member(f, "metadata", "dw");
            drop_member(f, "metadata", "dh");
        });
        check_told(&clip, "told from its length");
        assert_eq!((clip.info().depth_width, clip.info().depth_height), depth_size);
    }
}

#[test]
fn other_apps_with_parts_missing() {
    // The uncorrected poses are all a metre off.
    let clip = check(writers::polycam, |f| remove(f, |name| name.contains("corrected_")));
    check_told(&clip, "no corrected cameras");
    // Corrected pictures alone, or corrected cameras alone, are not used.
    let clip = check(writers::polycam, |f| remove(f, |name| name.contains("corrected_cameras")));
    check_told(&clip, "no corrected cameras");
    check(writers::polycam, |f| remove(f, |name| name.contains("confidence/")));
    check(writers::scanner_3d, |f| remove(f, |name| name.starts_with("conf_")));
    check(writers::arkit_scenes, |f| remove(f, |name| name.starts_with("confidence/")));
    // A frame's camera may be missing; the one nearest in time replaces it.
    check(writers::arkit_scenes, |f| remove(f, |name| name.ends_with("5000.350.pincam")));
    for wide in ["vga_wide", "wide"] {
        let clip = check(writers::arkit_scenes, |f| {
            for (name, _) in f.iter_mut().filter(|(name, _)| !name.ends_with(".traj")) {
                *name = name.replace("lowres_wide", wide);
            }
        });
        check_told(&clip, wide);
    }
}

/// Newer versions of the app leave the size of the picture out of corrected cameras.
#[test]
fn polycam_without_the_size_of_its_pictures() {
    let clip = check(writers::polycam, |f| {
        let names: Vec<String> = f.iter().map(|(name, _)| name.clone()).collect();
        for name in names.iter().filter(|name| name.contains("corrected_cameras/")) {
            drop_member(f, name, "width");
            drop_member(f, name, "height");
        }
    });
    check_told(&clip, "the app's corrected cameras and pictures were used");
    let camera = clip.load(1).unwrap().depth_camera;
    assert!((camera.fx - Recording::small(3).depth_k[0]).abs() < 1e-4, "{camera:?}");
}

#[test]
fn redwood_and_nerfstudio_as_others_write_them() {
    let redwood = writers::redwood;
    check(redwood, |f| rename(f, "scene/trajectory.log", "scene-traj.txt"));
    // Redwood's scans name pictures by number, from 1, and time.
    check(redwood, |f| {
        for (name, _) in f.iter_mut() {
            if let Some((folder, file)) = name.split_once('/').filter(|(folder, _)| *folder != "scene") {
                let (number, ending) = file.split_once('.').unwrap();
                let number: u64 = number.parse().unwrap();
                *name = format!("{folder}/{:07}-{:012}.{ending}", number + 1, number * 33_333);
            }
        }
    });
    check(redwood, |f| {
        for (name, _) in f.iter_mut() {
            *name = name.replace("color/", "image/");
        }
    });
    // A program's log is not a trajectory.
    check(redwood, |f| set(f, "run.log", "INFO it began\n"));

    let nerfstudio = writers::nerfstudio;
    let [fx, fy, cx, cy] = Recording::small(1).color_k();
    check(nerfstudio, |f| {
        edit_json(f, "transforms.json", |file| {
            for frame in file["frames"].as_array_mut().unwrap() {
                for (member, value) in
                    [("fl_x", fx), ("fl_y", fy), ("cx", cx), ("cy", cy), ("w", 64.), ("h", 48.)]
                {
                    frame[member] = json!(value);
                }
            }
            for member in ["fl_x", "fl_y", "cx", "cy", "w", "h"] {
                file.as_object_mut().unwrap().remove(member);
            }
        });
    });
    check(nerfstudio, |f| {
        drop_member(f, "transforms.json", "w");
        drop_member(f, "transforms.json", "h");
    });
    let clip = check(nerfstudio, |f| edit_json(f, "transforms.json", |file| file["k1"] = json!(0.2)));
    check_told(&clip, "distortion");
    check(nerfstudio, |f| edit_json(f, "transforms.json", |file| file["applied_scale"] = json!(1.0)));
    check(nerfstudio, |f| edit_json(f, "transforms.json", |file| file["integer_depth_scale"] = json!(0.001)));
}

/// Makes the second frame's pose of an export no rigid motion.
fn spoil(layout: &str, f: &mut Files) {
    let stretched = |matrix: &mut serde_json::Value| matrix[0] = json!(3.5);
    match layout {
        "stray_scanner" => edit_lines(f, "odometry.csv", |number, line| {
            Some(if number == 2 {
                line.rsplit_once(',').unwrap().0.to_string() + ", nan"
            } else {
                line.to_string()
            })
        }),
        "record3d" => edit_json(f, "metadata", |m| m["poses"][1] = json!([0, 0, 0, 0, 1, 1, 1])),
        "polycam" => {
            let name = "keyframes/corrected_cameras/5000350000.json";
            edit_json(f, name, |camera| camera["t_00"] = json!(3.5));
        }
        "scanner_3d_app" => edit_json(f, "frame_00001.json", |m| stretched(&mut m["cameraPoseARFrame"])),
        "arkit_scenes" => set_word(f, "lowres_wide.traj", 1, 2, "inf"),
        "redwood" => set_word(f, "scene/trajectory.log", 6, 0, "3.5"),
        "nerfstudio" | "nerf_capture" => edit_json(f, "transforms.json", |m| {
            stretched(&mut m["frames"][1]["transform_matrix"][0]);
        }),
        "spectacular_ai" => edit_lines(f, "data.jsonl", |_, line| {
            Some(if line.contains("5000.35") {
                line.replace("\"w\":", "\"w\":9e9,\"was\":")
            } else {
                line.to_string()
            })
        }),
        "sens" => {
            let bytes = content(f, "scene.sens");
            let at = crate::sens_refused::frame_at(bytes, 1);
            bytes[at..at + 64].copy_from_slice(&f32::NEG_INFINITY.to_le_bytes().repeat(16));
        }
        other => panic!("{other}"),
    }
}

#[test]
fn poses_that_are_no_rigid_motion_are_none_in_every_layout() {
    for (layout, write, _) in EXPORTS {
        let mut recording = Recording::small(3);
        // Files that are not text are written with the bad pose.
        let is_binary = matches!(layout, "colmap" | "rtabmap" | "ros2_bag");
        if is_binary {
            recording.frames[1].world_from_camera[(0, 3)] = f64::NAN;
        }
        let mut files = write("", &recording);
        if !is_binary {
            spoil(layout, &mut files);
        }
        let clip = Clip::open(as_folder(&files).path()).unwrap_or_else(|error| panic!("{layout}: {error}"));
        let has_pose: Vec<bool> = clip.frames().iter().map(|f| f.world_from_camera.is_some()).collect();
        // ARKitScenes' and ROS's poses are interpolated within 0.11 s, so neighbours replace a missing one.
        let is_interpolated = matches!(layout, "arkit_scenes" | "ros2_bag");
        let want = if is_interpolated { [true; 3] } else { [true, false, true] };
        assert_eq!(has_pose, want, "{layout}");
        let info = clip.info();
        let missing = want.iter().filter(|has| !**has).count();
        assert_eq!((info.frames_with_pose, info.skipped_without_pose), (3 - missing, missing), "{layout}");
    }
}
