//! The camera's poses, from the tree of frames, from odometry, or from poses with a header.

use super::bag::{Bag, Poses};
use super::frames::{MAX_GAP_S, body_from_optical, is_base};
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
    pub notes: Vec<String>,
}

impl Path {
    fn count(&self) -> usize {
        self.poses.iter().flatten().count()
    }
}

/// Returns the poses of the tree of frames if it has one for half of the times: a robot that knows its map corrects the
/// odometry there. Otherwise returns the first topic with so many, or else the source with most poses.
pub(super) fn find(bag: &mut Bag, camera: &str, times_s: &[f64]) -> Path {
    for topic in bag.odometry.values_mut().chain(bag.poses.values_mut()) {
        topic.poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
    let bag = &*bag;
    let is_enough = |path: &Path| 2 * path.count() >= times_s.len();
    let tree = of_frames(bag, camera, times_s);
    let is_in_world = bag.frames.world(camera).is_some_and(|world| !is_robot(bag, world));
    if is_in_world && is_enough(&tree) {
        return tree;
    }
    let mut best: Option<Path> = None;
    for (topic, poses) in bag.odometry.iter().chain(&bag.poses) {
        let path = of_topic(bag, topic, poses, camera, times_s);
        if is_enough(&path) {
            best = Some(path);
            break;
        }
        if path.count() > best.as_ref().map_or(tree.count(), Path::count) {
            best = Some(path);
        }
    }
    let Some(mut best) = best else { return tree };
    if is_in_world {
        let (count, all) = (tree.count(), times_s.len());
        best.notes
            .push(format!("{} was not used: it has poses for {count} of {all} depth pictures", tree.from));
    }
    best
}

/// Returns whether the root of the tree is a part of the robot: the joints of its head move the camera there, and only
/// odometry moves the robot.
fn is_robot(bag: &Bag, root: &str) -> bool {
    is_base(root) || bag.odometry.values().any(|of| bag.frames.body(&of.child) == root)
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
        notes: is_assumed
            .then(|| {
                format!(
                    "/tf does not connect {camera} with the poses of {topic}; their axes were taken as {axes}"
                )
            })
            .into_iter()
            .collect(),
    }
}

/// Returns the poses of the camera in the map, or else in the root, of the tree of frames.
fn of_frames(bag: &Bag, camera: &str, times_s: &[f64]) -> Path {
    let world = bag.frames.world(camera);
    let pose = |time_s: &f64| world.and_then(|world| bag.frames.pose(world, camera, *time_s));
    Path {
        from: world.map_or("/tf".to_string(), |world| format!("/tf (from {world} to {camera})")),
        poses: times_s.iter().map(pose).collect(),
        z_is_up: world.is_some_and(is_world) && bag.frames.is_on_base(camera),
        notes: Vec::new(),
    }
}

fn is_world(frame: &str) -> bool {
    WORLDS.contains(&frame.rsplit('/').next().unwrap_or(frame))
}
