//! The sources of a bag's poses, and their order.

use super::*;
use crate::exports;
use crate::refusals::check_error;
use nalgebra::{Rotation3, Vector3};

/// Checks the poses and pixels of a bag that gives the up direction, and that its notes have these words.
fn check(messages: &[Message], recording: &Recording, words: &[&str]) {
    check_with_up(messages, recording, true, words);
}

fn check_with_up(messages: &[Message], recording: &Recording, knows_up: bool, words: &[&str]) {
    let folder = folder_of(messages);
    exports::check(folder.path(), "ros2_bag", knows_up, recording);
    check_notes(&Clip::open(folder.path()).unwrap(), words);
}

fn check_notes(clip: &Clip, words: &[&str]) {
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
    // With few corrections the odometry alone has poses for all: in the tree, or else as a topic.
    let few = "/tf (from map to camera_depth_optical_frame) was not used: it has poses for 1 of 5";
    let below = "poses are from /tf (from odom to camera_depth_optical_frame)";
    let mut messages = drifting(&odometry, 1);
    check(&messages, &odometry, &[below, few]);
    let start_s = odometry.frames[0].time_s;
    messages.retain(|(time_s, topic, ..)| *topic != "/tf" || *time_s < start_s + 0.05);
    let few_below = "/tf (from odom to camera_depth_optical_frame) was not used: it has poses for 1 of 5";
    check(&messages, &odometry, &["poses are from /odom,", few, few_below]);
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

fn odometry_of(child: &str, time_s: f64, pose: &Matrix4<f64>) -> Message {
    let cdr = Cdr::new().header(time_s, "odom").text(child).pose(pose).f64s(&[0.0; 36 + 6 + 36]);
    (time_s, "/odom", ODOMETRY, cdr.0)
}

fn pose_of(time_s: f64, pose: &Matrix4<f64>) -> Message {
    (time_s, "/robot/pose", POSE, pose_stamped(time_s, pose))
}

/// Returns the recording of a robot with a head that turns in its own tree. `told` gives the poses of the tree's root.
fn with_head(
    recording: &Recording,
    root: &str,
    told: impl Fn(f64, &Matrix4<f64>) -> Message,
) -> Vec<Message> {
    let mut messages = messages(recording, PosesBy::Odometry);
    messages.retain(|(_, topic, ..)| !matches!(*topic, "/tf_static" | "/odom"));
    let start_s = recording.frames[0].time_s;
    let fixed = transform(start_s, "head", "camera_depth_optical_frame", &link_from_optical());
    messages.push((start_s, "/tf_static", TRANSFORMS, fixed));
    for (index, frame) in recording.frames.iter().enumerate() {
        let turn = Rotation3::from_euler_angles(0.0, 0.0, 0.3 * (index as f64).sin());
        let root_from_head = base_from_link() * turn.to_homogeneous();
        let camera_from_root = (root_from_head * link_from_optical()).try_inverse().unwrap();
        let world_from_root = frame.world_from_camera * camera_from_root;
        for time_s in [frame.time_s - 0.02, frame.time_s + 0.03] {
            messages.push((time_s, "/tf", TRANSFORMS, transform(time_s, root, "head", &root_from_head)));
            messages.push(told(time_s, &world_from_root));
        }
    }
    messages
}

/// A root that was not called base_link was once taken as the world.
#[test]
fn a_robots_own_tree_moves_the_camera_on_the_robot_that_a_topic_moves() {
    let recording = Recording::small(5);
    for (root, knows_up) in [("base", false), ("body", false), ("torso", false), ("base_link", true)] {
        let messages = with_head(&recording, root, pose_of);
        check_with_up(&messages, &recording, knows_up, &["poses are from /robot/pose,"]);
    }
    for (child, knows_up, note) in [
        ("", false, "depth is from"),
        ("base", false, "depth is from"),
        ("base_footprint", true, "does not connect camera_depth_optical_frame with base_footprint"),
        ("imu", false, "does not connect camera_depth_optical_frame with imu"),
    ] {
        let messages = with_head(&recording, "base", |time_s, pose| odometry_of(child, time_s, pose));
        check_with_up(&messages, &recording, knows_up, &["poses are from /odom,", note]);
    }
}

#[test]
fn a_robots_own_tree_does_not_replace_the_few_poses_of_odometry() {
    let recording = Recording::small(5);
    let mut messages =
        with_head(&recording, "base_link", |time_s, pose| odometry_of("base_link", time_s, pose));
    let end_s = recording.frames[2].time_s - 0.05;
    messages.retain(|(time_s, topic, ..)| *topic != "/odom" || *time_s < end_s);
    let clip = open(&messages).unwrap();
    assert_eq!(clip.info().frames_with_pose, 2);
    check_notes(&clip, &["poses are from /odom,"]);
    // Another topic has all poses.
    let stamped = with_head(&recording, "base_link", pose_of);
    let mut both = messages.clone();
    both.extend(stamped.into_iter().filter(|(_, topic, ..)| *topic == "/robot/pose"));
    let few = "/odom was not used: it has poses for 2 of 5 depth pictures";
    check(&both, &recording, &["poses are from /robot/pose,", few]);
    // A robot that only turns its head needs no topic.
    messages.retain(|(_, topic, ..)| *topic != "/odom");
    let clip = open(&messages).unwrap();
    assert_eq!(clip.info().frames_with_pose, 5);
    check_notes(&clip, &["base_link was taken as the world", "stands still"]);
}

/// Returns a robot's recording by the tree of frames, without `/tf_static`.
fn without_static(recording: &Recording) -> Vec<Message> {
    let mut messages = messages(recording, PosesBy::Tree);
    messages.retain(|(_, topic, ..)| *topic != "/tf_static");
    messages
}

#[test]
fn a_camera_that_the_tree_does_not_place_has_no_poses_and_a_note() {
    let mut messages = without_static(&Recording::small(5));
    let unconnected = "/tf moves base_link in odom, but neither /tf nor /tf_static tells where the camera \
                       (camera_depth_optical_frame) is on it; record /tf_static, too";
    let clip = open(&messages).unwrap();
    assert_eq!(clip.info().frames_with_pose, 0);
    check_notes(&clip, &[unconnected]);
    assert!(
        !clip.info().notes.iter().any(|note| note.starts_with("poses are from")),
        "{:?}",
        clip.info().notes
    );
    // Without colour, nothing could track the camera.
    messages.retain(|(_, topic, ..)| *topic != COLOR);
    check_error(open(&messages).err().unwrap(), "bad_metadata", unconnected);
}

/// A message of 64 MiB may have ten thousand names, and a bag thousands of such messages.
#[test]
fn a_frame_with_a_long_name_is_refused() {
    let with_name_of = |length: usize| {
        let mut messages = messages(&Recording::small(3), PosesBy::Tree);
        let named = transform(5000.0, "odom", &"n".repeat(length), &Matrix4::identity());
        messages.push((5000.0, "/tf", TRANSFORMS, named));
        open(&messages)
    };
    assert!(with_name_of(255).is_ok());
    check_error(with_name_of(256).err().unwrap(), "bad_metadata", "a message of /tf is damaged");
}

/// The height and the tilt of the camera on the robot are unknown, and so is the up direction.
#[test]
fn odometry_without_the_tree_gives_assumed_poses_without_the_up_direction() {
    let mut messages = messages(&Recording::small(5), PosesBy::Odometry);
    messages.retain(|(_, topic, ..)| *topic != "/tf_static");
    let clip = open(&messages).unwrap();
    assert_eq!((clip.info().frames_with_pose, clip.up_in_world()), (5, None));
    check_notes(&clip, &["/tf does not connect camera_depth_optical_frame with the poses of /odom"]);
}

/// Pictures may lack a frame, or name one that is in no tree.
#[test]
fn the_frame_of_camera_info_places_pictures_without_a_frame() {
    let recording = Recording::small(5);
    let (width, height) = recording.depth_size;
    for own in ["", "depth"] {
        let mut messages = messages(&recording, PosesBy::Tree);
        for (index, (.., cdr)) in messages.iter_mut().filter(|(_, topic, ..)| *topic == DEPTH).enumerate() {
            let frame = &recording.frames[index];
            let bytes: Vec<u8> = frame.depth_mm.iter().flat_map(|mm| mm.to_le_bytes()).collect();
            let picture = Cdr::new().header(frame.time_s, own).u32(height).u32(width).text("16UC1");
            *cdr = picture.put([0]).u32(2 * width).bytes(&bytes).0;
        }
        check(&messages, &recording, &["poses are from /tf (from odom to camera_depth_optical_frame)"]);
    }
}
