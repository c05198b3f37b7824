//! The sources of a bag's poses, and their order.

use super::*;
use crate::exports;
use crate::writers::as_folder;
use nalgebra::{Rotation3, Vector3};
use viola_formats::clip::Clip;

/// Checks the poses and pixels of a bag, and that its notes have these words.
fn check(messages: &[Message], recording: &Recording, words: &[&str]) {
    let folder = as_folder(&[("bag.mcap".to_owned(), mcap_file(messages, "", <[u8]>::to_vec))]);
    exports::check(folder.path(), "ros2_bag", true, recording);
    let clip = Clip::open(folder.path()).unwrap();
    let notes = &clip.info().notes;
    for words in words {
        assert!(notes.iter().any(|note| note.contains(*words)), "{words}: {notes:?}");
    }
}

/// Returns the correction of the odometry at a frame: it drifts by 32 cm and 3 degrees a frame.
fn map_from_odom(index: usize) -> Matrix4<f64> {
    let step = index as f64;
    Matrix4::new_translation(&Vector3::new(0.3 * step, -0.1 * step, 0.0))
        * Rotation3::from_euler_angles(0.0, 0.0, 0.05 * step).to_homogeneous()
}

/// Returns the recording in the world of the odometry.
fn in_odom(mut recording: Recording) -> Recording {
    for (index, frame) in recording.frames.iter_mut().enumerate() {
        frame.world_from_camera = map_from_odom(index).try_inverse().unwrap() * frame.world_from_camera;
    }
    recording
}

/// Returns a recording with odometry that drifts, as a topic and in the tree of frames. The tree also has the corrections
/// of the first frames, and a world above the map whose z axis is not up.
fn drifting(recording: &Recording, corrected: usize) -> Vec<Message> {
    let mut messages = messages(recording, PosesBy::Tree);
    let start_s = recording.frames[0].time_s;
    let earth_from_map = Rotation3::from_euler_angles(1.0, 0.5, 0.2).to_homogeneous();
    messages.push((start_s, "/tf_static", TRANSFORMS, transform(start_s, "earth", "map", &earth_from_map)));
    let camera_from_base = (base_from_link() * link_from_optical()).try_inverse().unwrap();
    for (index, frame) in recording.frames.iter().enumerate() {
        let odom_from_base = frame.world_from_camera * camera_from_base;
        for time_s in [frame.time_s - 0.02, frame.time_s + 0.03] {
            messages.push((time_s, "/odom", ODOMETRY, odometry(time_s, &odom_from_base)));
            if index < corrected {
                let correction = transform(time_s, "map", "odom", &map_from_odom(index));
                messages.push((time_s, "/tf", TRANSFORMS, correction));
            }
        }
    }
    messages
}

#[test]
fn poses_in_the_map_are_preferred_to_odometry_if_most_pictures_have_them() {
    let odometry = in_odom(Recording::small(5));
    let tree = "poses are from /tf (from map to camera_depth_optical_frame)";
    check(&drifting(&odometry, 5), &Recording::small(5), &[tree]);
    let few = "/tf (from map to camera_depth_optical_frame) was not used: it has poses for 1 of 5";
    check(&drifting(&odometry, 1), &odometry, &["poses are from /odom,", few]);
}

/// Joints of a robot's head move the camera in the tree, whose root is the robot.
#[test]
fn a_tree_that_ends_at_the_robot_does_not_replace_odometry() {
    let recording = Recording::small(5);
    let start_s = recording.frames[0].time_s;
    for root in ["base_link", "chassis"] {
        let mut messages = messages(&recording, PosesBy::Odometry);
        messages.retain(|(_, topic, ..)| *topic != "/tf_static");
        let fixed = transform(start_s, "camera_link", "camera_depth_optical_frame", &link_from_optical());
        messages.push((start_s, "/tf_static", TRANSFORMS, fixed));
        if root == "chassis" {
            let fixed = transform(start_s, root, "base_link", &Matrix4::identity());
            messages.push((start_s, "/tf_static", TRANSFORMS, fixed));
        }
        for frame in &recording.frames {
            for time_s in [frame.time_s - 0.02, frame.time_s + 0.03] {
                let head = transform(time_s, "base_link", "camera_link", &base_from_link());
                messages.push((time_s, "/tf", TRANSFORMS, head));
            }
        }
        check(&messages, &recording, &["poses are from /odom,"]);
    }
}
