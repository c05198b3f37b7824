//! The camera's poses, from odometry, from poses with a header, or from the tree of frames.

use super::bag::{Bag, Poses};
use super::frames::{MAX_GAP_S, body_from_optical};
use crate::clip::layout::trajectory::pose_at;
use viola_geometry::Pose3;

/// Worlds whose z axis is up (REP 105).
const WORLDS: [&str; 3] = ["map", "odom", "world"];

/// The poses of a camera at the times of its pictures.
pub(super) struct Path {
    /// Their source, for messages.
    pub from: String,
    pub poses: Vec<Option<Pose3>>,
    pub z_is_up: bool,
    pub note: Option<String>,
}

/// Returns the first source with a pose for half of the times, or else the one with most poses.
pub(super) fn find(bag: &mut Bag, camera: &str, times_s: &[f64]) -> Path {
    for topic in bag.odometry.values_mut().chain(bag.poses.values_mut()) {
        topic.poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
    let bag = &*bag;
    let mut best: Option<(usize, Path)> = None;
    let of_topics = bag
        .odometry
        .iter()
        .chain(&bag.poses)
        .map(|(topic, poses)| of_topic(bag, topic, poses, camera, times_s));
    for path in of_topics.chain(std::iter::once_with(|| of_frames(bag, camera, times_s))) {
        let count = path.poses.iter().flatten().count();
        if 2 * count >= times_s.len() {
            return path;
        }
        if best.as_ref().is_none_or(|(most, _)| count > *most) {
            best = Some((count, path));
        }
    }
    best.map_or_else(|| of_frames(bag, camera, times_s), |(_, path)| path)
}

/// Returns the poses of a topic, and of the camera on the moving frame.
fn of_topic(bag: &Bag, topic: &str, of: &Poses, camera: &str, times_s: &[f64]) -> Path {
    // Messages without a child frame have the pose of the body that carries the camera.
    let child = if of.child.is_empty() { bag.frames.body(camera) } else { of.child.as_str() };
    let is_known = times_s.iter().any(|time_s| bag.frames.pose(child, camera, *time_s).is_some());
    let is_optical = camera.contains("optical") && (of.child.is_empty() || !child.contains("optical"));
    let is_assumed = !is_known || (child == camera && of.child.is_empty());
    let assumed = if is_optical { body_from_optical() } else { Pose3::identity() };
    let pose = |&time_s: &f64| {
        let world_from_child = pose_at(&of.poses, time_s, MAX_GAP_S)?;
        let child_from_camera = if is_assumed { assumed } else { bag.frames.pose(child, camera, time_s)? };
        Some(world_from_child * child_from_camera)
    };
    let axes = if is_optical { "x ahead and z up" } else { "those of the camera" };
    Path {
        from: topic.to_string(),
        poses: times_s.iter().map(pose).collect(),
        z_is_up: is_world(&of.world) && bag.frames.is_on_base(child),
        note: is_assumed.then(|| {
            format!(
                "/tf does not connect {camera} with the poses of {topic}; their axes were taken as {axes}"
            )
        }),
    }
}

/// Returns the poses of the camera in the root of the tree of frames.
fn of_frames(bag: &Bag, camera: &str, times_s: &[f64]) -> Path {
    let world = bag.frames.world(camera);
    let pose = |time_s: &f64| world.and_then(|world| bag.frames.pose(world, camera, *time_s));
    Path {
        from: "/tf".to_string(),
        poses: times_s.iter().map(pose).collect(),
        z_is_up: world.is_some_and(is_world) && bag.frames.is_on_base(camera),
        note: None,
    }
}

fn is_world(frame: &str) -> bool {
    WORLDS.contains(&frame.rsplit('/').next().unwrap_or(frame))
}
