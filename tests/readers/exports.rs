//! Apps' exports, written by test code and read back.

use crate::export_writers as writers;
use crate::recording::Recording;
use crate::writers::{Files, as_folder, as_zip};
use nalgebra::{Isometry3, Matrix4, Vector3};
use std::path::Path;
use viola_formats::clip::Clip;

pub type Writer = fn(&str, &Recording) -> Files;

/// The layouts of phones' apps and of data sets; the flag is true if they give the up direction.
pub const EXPORTS: [(&str, Writer, bool); 15] = [
    ("stray_scanner", writers::stray, true),
    ("record3d", writers::record3d, false),
    ("polycam", writers::polycam, true),
    ("scanner_3d_app", writers::scanner_3d, true),
    ("arkit_scenes", writers::arkit_scenes, true),
    ("redwood", writers::redwood, false),
    ("nerfstudio", writers::nerfstudio, true),
    ("nerf_capture", writers::nerf_capture, true),
    ("sens", writers::sens, false),
    ("spectacular_ai", writers::spectacular, true),
    ("rtabmap", crate::databases::rtabmap, true),
    ("ros2_bag", crate::bags::mcap, true),
    ("ros2_bag", crate::bags::mcap_split, true),
    ("ros2_bag", crate::bags::db3, true),
    ("colmap", crate::unknown_scale::colmap, false),
];

fn rigid(matrix: &Matrix4<f64>) -> Isometry3<f64> {
    nalgebra::try_convert(*matrix).unwrap_or_else(|| {
        // Printed matrices are rotations up to rounding.
        let rotation = matrix.fixed_view::<3, 3>(0, 0).into_owned();
        let rotation = nalgebra::UnitQuaternion::from_matrix(&rotation);
        Isometry3::from_parts(
            nalgebra::Translation3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]),
            rotation,
        )
    })
}

/// Checks relative poses against the recording's, independent of the world: this detects a wrong direction, a
/// wrong camera axis or a wrong up axis.
pub fn check_poses(clip: &Clip, recording: &Recording, what: &str) {
    let truth: Vec<_> = recording.frames.iter().map(|frame| rigid(&frame.world_from_camera)).collect();
    let read: Vec<_> = clip.frames().iter().map(|header| header.world_from_camera.expect(what)).collect();
    assert_eq!(read.len(), truth.len(), "{what}");
    for i in 0..read.len() {
        let off = (truth[0].inverse() * truth[i]).inverse() * (read[0].inverse() * read[i]);
        assert!(
            off.translation.vector.norm() < 1e-3,
            "{what}: frame {i} is {} m off",
            off.translation.vector.norm()
        );
        assert!(off.rotation.angle().to_degrees() < 0.01, "{what}: frame {i} is turned");
        if let Some(up) = clip.up_in_world() {
            let off = (read[i].rotation.inverse() * up.direction)
                .angle(&(truth[i].rotation.inverse() * Vector3::z()));
            assert!(
                off.to_degrees() < 0.01,
                "{what}: frame {i} has another up, by {} degrees",
                off.to_degrees()
            );
        }
    }
}

/// Opens an export and checks all of it against the recording.
pub fn check(path: &Path, layout: &str, knows_up: bool, recording: &Recording) {
    let clip = Clip::open(path).unwrap_or_else(|error| panic!("{layout}: {error}"));
    let info = clip.info();
    assert_eq!(info.layout, layout, "{info:#?}");
    assert_eq!((info.frames, info.skipped_incomplete), (recording.frames.len(), 0), "{layout}");
    assert_eq!((info.depth_width, info.depth_height), recording.depth_size, "{layout}");
    assert_eq!(clip.up_in_world().is_some(), knows_up, "{layout}");
    check_poses(&clip, recording, layout);
    let felt = (layout == "spectacular_ai").then(writers::spectacular_force_in_camera);
    for frame in clip.frames() {
        let same = frame.force_in_camera.zip(felt).is_none_or(|(read, felt)| (read - felt).norm() < 1e-6);
        assert!(same && frame.force_in_camera.is_some() == felt.is_some(), "{layout}: {frame:?}");
    }
    let has_confidence = !matches!(
        layout,
        "redwood" | "nerfstudio" | "nerf_capture" | "sens" | "spectacular_ai" | "ros2_bag" | "colmap"
    );
    for (index, frame) in recording.frames.iter().enumerate() {
        let read = clip.load(index).unwrap_or_else(|error| panic!("{layout}: {error}"));
        for (camera, want) in
            [(read.color_camera, recording.color_k()), (read.depth_camera, recording.depth_k)]
        {
            for (got, want) in [camera.fx, camera.fy, camera.cx, camera.cy].iter().zip(want) {
                assert!((got - want).abs() < 1e-4, "{layout}: {camera:?} instead of {want:?}");
            }
        }
        let (width, _) = recording.depth_size;
        for (i, &mm) in frame.depth_mm.iter().enumerate() {
            let at = (i as u32 % width, i as u32 / width);
            let doubtful = has_confidence && recording.doubtful.contains(&at);
            let want_m = if doubtful { 0.0 } else { f32::from(mm) / 1000.0 };
            let got_m = read.depth.at(at.0, at.1);
            assert!((got_m - want_m).abs() < 1e-6, "{layout}: {got_m} m instead of {want_m} m at {at:?}");
        }
    }
}

#[test]
fn every_export_is_read_from_a_folder_and_a_zip_wherever_it_lies() {
    let recording = Recording::small(4);
    for (layout, write, knows_up) in EXPORTS {
        for root in ["", "a/recording 7/"] {
            let mut files = write(root, &recording);
            files.push((format!("{root}README.txt"), b"made by an app".to_vec()));
            files.push(("__MACOSX/._odometry.csv".to_string(), b"mac".to_vec()));
            check(as_folder(&files).path(), layout, knows_up, &recording);
            check(as_zip(&files).path(), layout, knows_up, &recording);
        }
    }
}
