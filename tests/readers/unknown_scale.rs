//! Clips whose unit is unknown: COLMAP's workspace, points with a path, and Nerfstudio's files with scaled poses.

use crate::edits::*;
use crate::export_writers as writers;
use crate::exports::check_poses;
use crate::recording::Recording;
use crate::writers::{Files, as_folder, color_jpeg, open};
use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, UnitQuaternion};
use serde_json::json;
use viola_formats::clip::Clip;

/// Number of COLMAP's camera model PINHOLE.
const PINHOLE: u32 = 1;

fn camera_from_world(world_from_camera: &Matrix4<f64>) -> Isometry3<f64> {
    let rotation: Matrix3<f64> = world_from_camera.fixed_view::<3, 3>(0, 0).into_owned();
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    let at = world_from_camera.column(3);
    Isometry3::from_parts(nalgebra::Translation3::new(at.x, at.y, at.z), rotation).inverse()
}

/// Returns the pictures of a dense workspace.
fn pictures(root: &str, recording: &Recording) -> Files {
    let mut files = Files::new();
    let (width, height) = recording.depth_size;
    for frame in &recording.frames {
        let name = format!("frame_{:05}.jpg", frame.number);
        let mut depth = format!("{width}&{height}&1&").into_bytes();
        depth.extend(frame.depth_mm.iter().flat_map(|mm| (f32::from(*mm) / 1000.0).to_le_bytes()));
        files.push((format!("{root}images/{name}"), frame.jpeg.clone()));
        files.push((format!("{root}stereo/depth_maps/{name}.geometric.bin"), depth));
    }
    files
}

/// Returns a dense workspace with a binary model.
pub fn colmap(root: &str, recording: &Recording) -> Files {
    let mut files = pictures(root, recording);
    let (width, height) = recording.color_size;
    let mut cameras = 1u64.to_le_bytes().to_vec();
    cameras.extend([7, PINHOLE].iter().flat_map(|number| number.to_le_bytes()));
    cameras.extend([width, height].iter().flat_map(|side| u64::from(*side).to_le_bytes()));
    cameras.extend(recording.color_k().iter().flat_map(|number| number.to_le_bytes()));
    let mut images = (recording.frames.len() as u64).to_le_bytes().to_vec();
    // Images are in any order.
    for frame in recording.frames.iter().rev() {
        let pose = camera_from_world(&frame.world_from_camera);
        let (q, t) = (pose.rotation, pose.translation);
        images.extend((frame.number + 1).to_le_bytes());
        images.extend([q.w, q.i, q.j, q.k, t.x, t.y, t.z].iter().flat_map(|number| number.to_le_bytes()));
        images.extend(7u32.to_le_bytes());
        images.extend(format!("frame_{:05}.jpg\0", frame.number).into_bytes());
        images.extend(2u64.to_le_bytes());
        images.extend([0; 48]);
    }
    files.push((format!("{root}sparse/cameras.bin"), cameras));
    files.push((format!("{root}sparse/images.bin"), images));
    files
}

/// Returns a dense workspace with a model as text.
fn colmap_text(recording: &Recording) -> Files {
    let mut files = pictures("", recording);
    let (width, height) = recording.color_size;
    let [fx, fy, cx, cy] = recording.color_k();
    let cameras = format!("# Camera list\n7 PINHOLE {width} {height} {fx} {fy} {cx} {cy}\n");
    let mut images = "# Image list with two lines of data per image:\n".to_string();
    for frame in &recording.frames {
        let pose = camera_from_world(&frame.world_from_camera);
        let (q, t) = (pose.rotation, pose.translation);
        let numbers = [q.w, q.i, q.j, q.k, t.x, t.y, t.z].map(|number| number.to_string()).join(" ");
        images.push_str(&format!("{} {numbers} 7 frame_{:05}.jpg\n", frame.number + 1, frame.number));
        images.push_str("12.5 7.25 -1 3.5 9.25 17 1.5 2.5 -1 8.5 1.25 4\n");
    }
    files.push(("sparse/0/cameras.txt".into(), cameras.into_bytes()));
    files.push(("sparse/0/images.txt".into(), images.into_bytes()));
    files
}

#[test]
fn a_model_of_colmap_is_read_as_text_and_binary_and_has_no_metres() {
    let recording = Recording::small(3);
    for files in [colmap("", &recording), colmap_text(&recording)] {
        let clip = open(&files).unwrap();
        assert_eq!((clip.info().layout.as_str(), clip.info().metric), ("colmap", false));
        assert!(clip.up_in_world().is_none());
        check_poses(&clip, &recording, "colmap");
        let depth = clip.load(1).unwrap().depth;
        assert_eq!(depth.at(3, 2), f32::from(recording.frames[1].depth_mm[2 * 32 + 3]) / 1000.0);
    }
}

#[test]
fn frames_with_numbers_without_zeros_are_in_the_order_of_the_numbers() {
    let recording = Recording::small(12);
    for mut files in [writers::nerfstudio("", &recording), colmap_text(&recording)] {
        for number in 0..12 {
            let (from, to) = (format!("frame_{number:05}."), format!("{number}."));
            for (name, bytes) in &mut files {
                *name = name.replace(&from, &to);
                if name.ends_with(".json") || name.ends_with(".txt") {
                    let text = String::from_utf8(std::mem::take(bytes)).unwrap();
                    *bytes = text.replace(&from, &to).into_bytes();
                }
            }
        }
        let clip = open(&files).unwrap();
        check_poses(&clip, &recording, &clip.info().layout);
    }
}

#[test]
fn pictures_of_other_sizes_are_read_by_their_own_cameras() {
    let recording = Recording::small(3);
    let [fx, fy, cx, cy] = recording.color_k();
    let mut files = colmap_text(&recording);
    // The second picture is upright, and has twice the size.
    let [fx, fy, cx, cy] = [fy * 2.0, fx * 2.0, cy * 2.0 + 0.5, cx * 2.0 + 0.5];
    let camera = format!("8 PINHOLE 96 128 {fx} {fy} {cx} {cy}\n");
    content(&mut files, "sparse/0/cameras.txt").extend(camera.bytes());
    edit_lines(&mut files, "sparse/0/images.txt", |_, line| {
        Some(line.replace(" 7 frame_00001.jpg", " 8 frame_00001.jpg"))
    });
    set(&mut files, "images/frame_00001.jpg", color_jpeg(96, 128));
    let depth = [b"48&64&1&".to_vec(), 1.5f32.to_le_bytes().repeat(48 * 64)].concat();
    set(&mut files, "stereo/depth_maps/frame_00001.jpg.geometric.bin", depth);
    let clip = open(&files).unwrap();
    check_poses(&clip, &recording, "colmap");
    let sizes = [0, 1, 2].map(|index| {
        let frame = clip.load(index).unwrap();
        (frame.color.unwrap().dimensions(), (frame.depth.width, frame.depth.height))
    });
    assert_eq!(sizes, [((64, 48), (32, 24)), ((96, 128), (48, 64)), ((64, 48), (32, 24))]);
    assert_eq!(clip.load(1).unwrap().color_camera.fx, fx);
    assert_eq!(clip.pixels_a_frame(), 96 * 128 + 48 * 64, "the largest frame");
    // Its picture is not the camera's.
    set(&mut files, "images/frame_00001.jpg", color_jpeg(64, 48));
    let clip = open(&files).unwrap();
    assert_eq!((clip.info().frames, clip.info().frames_with_pose), (2, 2));
    let notes = &clip.info().notes;
    assert!(notes.iter().any(|note| note.contains("1 frames of another size")), "{notes:?}");
}

#[test]
fn damaged_models_of_colmap_are_refused() {
    let recording = Recording::small(3);
    let code = |change: &dyn Fn(&mut Files)| {
        let mut files = colmap("", &recording);
        change(&mut files);
        open(&files).err().map(|error| error.code())
    };
    let images = "sparse/images.bin";
    assert_eq!(code(&|files| cut(files, images, 0.9)), Some("bad_metadata"));
    // Ten thousand million images, and a point list of any length.
    assert_eq!(code(&|files| content(files, images)[0..8].fill(9)), Some("bad_metadata"));
    assert_eq!(code(&|files| content(files, "sparse/cameras.bin")[12] = 99), Some("bad_metadata"));
    assert_eq!(
        code(&|files| remove(files, |name| name.ends_with("cameras.bin"))),
        Some("missing_intrinsics")
    );
    assert_eq!(code(&|files| remove(files, |name| name.starts_with("stereo"))), Some("no_frames"));
    let depth = "stereo/depth_maps/frame_00000.jpg.geometric.bin";
    for bytes in ["", "32&24&1", "32&24&3&", "4294967295&4294967295&1&", "32&24&1&abcd"] {
        assert_eq!(code(&|files| set(files, depth, bytes)), Some("bad_depth"), "{bytes}");
    }
}

/// Returns a wall 2 units in front of two poses, with this many points 0.02 units apart to each side, and the path.
pub fn points(cloud: &str, path: &str, half: i32) -> Files {
    let places: Vec<(i32, i32)> = (-half..=half).flat_map(|i| (-half..=half).map(move |j| (i, j))).collect();
    let count = places.len();
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nend_header\n"
    );
    let at = |steps: i32| f64::from(steps) * 0.02;
    let rows: String = places.iter().map(|(i, j)| format!("{} {} 2 17\n", at(*i), at(*j))).collect();
    let poses = "# time tx ty tz qx qy qz qw\n0.5 0 0 0 0 0 0 1\n1.0 0 0 0.5 0 0 0 1\n";
    vec![(cloud.to_string(), format!("{head}{rows}").into_bytes()), (path.to_string(), poses.into())]
}

#[test]
fn points_with_a_path_are_seen_from_it_and_have_no_metres() {
    for (cloud, path) in [("lounge.ply", "lounge.txt"), ("out/cloud.ply", "out/trajectory.txt")] {
        let clip = open(&points(cloud, path, 100)).unwrap();
        let info = clip.info();
        assert_eq!((info.layout.as_str(), info.metric, info.frames_with_pose), ("points", false, 2));
        let seen = [0, 1].map(|index| clip.load(index).unwrap());
        assert!(seen.iter().all(|frame| frame.color.is_none()));
        assert_eq!(seen.map(|frame| frame.depth.at(96, 72)), [2.0, 1.5]);
    }
}

#[test]
fn damaged_points_are_refused() {
    let code = |change: &dyn Fn(&mut Files)| {
        let mut files = points("a.ply", "a.txt", 5);
        change(&mut files);
        open(&files).err().map(|error| error.code())
    };
    assert_eq!(code(&|_| {}), None);
    assert_eq!(code(&|files| cut(files, "a.ply", 0.9)), Some("bad_metadata"));
    assert_eq!(
        code(&|files| set(files, "a.ply", "ply\nformat ascii 1.0\nend_header\n")),
        Some("bad_metadata")
    );
    assert_eq!(code(&|files| set(files, "a.txt", "0 1 2\n")), Some("bad_index"));
    assert_eq!(code(&|files| set(files, "a.txt", "")), Some("no_frames"));
    assert_eq!(code(&|files| remove(files, |name| name == "a.txt")), Some("unknown_layout"));
    assert_eq!(code(&|files| files.extend(points("b.ply", "b.txt", 5))), Some("several_clips"));
}

#[test]
fn poses_of_nerfstudio_that_were_scaled_have_no_metres() {
    let recording = Recording::small(3);
    let with = |edit: &dyn Fn(&mut serde_json::Value)| {
        let mut files = writers::nerfstudio("", &recording);
        edit_json(&mut files, "transforms.json", |file| edit(file));
        Clip::open(as_folder(&files).path()).unwrap()
    };
    assert!(with(&|_| {}).info().metric);
    assert!(with(&|file| file["applied_scale"] = json!(1.0)).info().metric);
    // The poses come back in the unit of the depth.
    let scaled = with(&|file| {
        file["applied_scale"] = json!(0.25);
        for frame in file["frames"].as_array_mut().unwrap() {
            for row in frame["transform_matrix"].as_array_mut().unwrap().iter_mut().take(3) {
                row[3] = json!(row[3].as_f64().unwrap() * 0.25);
            }
        }
    });
    assert!(!scaled.info().metric);
    let notes = &scaled.info().notes;
    assert!(notes.iter().any(|note| note.contains("divided by applied_scale (0.25)")), "{notes:?}");
    check_poses(&scaled, &recording, "nerfstudio");
    let by_colmap = with(&|file| file["frames"][0]["colmap_im_id"] = json!(3));
    assert!(!by_colmap.info().metric && by_colmap.up_in_world().is_none());
}

#[test]
fn a_scaled_clip_has_scaled_positions_and_depth() {
    let recording = Recording::small(2);
    let clip = open(&writers::stray("", &recording)).unwrap();
    let scaled = clip.scaled(2.5);
    assert!(clip.info().metric && !scaled.clone().with_unknown_scale().info().metric);
    let (one, other) = (clip.load(1).unwrap(), scaled.load(1).unwrap());
    let pose = |frame: &viola_formats::clip::Frame| frame.header.world_from_camera.unwrap();
    assert_eq!(pose(&other).translation.vector, pose(&one).translation.vector * 2.5);
    assert_eq!(pose(&other).rotation, pose(&one).rotation);
    for (depth, scaled) in one.depth.depth_m.iter().zip(&other.depth.depth_m) {
        assert!((scaled - depth * 2.5).abs() < 1e-5);
    }
}
