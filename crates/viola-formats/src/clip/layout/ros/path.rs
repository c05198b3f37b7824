//! The camera's poses, from the tree of frames, from odometry, or from poses with a header.

use super::bag::{Bag, Poses};
use super::frames::{MAX_GAP_S, is_base};
use crate::clip::layout::body_from_optical;
use crate::clip::layout::trajectory::pose_at;
use std::cmp::Reverse;
use viola_geometry::Pose3;

/// Worlds whose z axis is up (REP 105).
const WORLDS: [&str; 3] = ["map", "odom", "world"];
/// Maximum number of poses that are looked for; sources beyond it are not examined, but for the root of the tree, which comes
/// last. A recording of an hour may have ten, and a hostile bag has a thousand, each of them as long.
const MAX_LOOKS: usize = 1_000_000;
/// Maximum number of notes about sources that were not used.
const MAX_NOTED: usize = 10;

/// The poses of a camera at the times of its pictures.
pub(super) struct Path {
    /// Their source, for messages.
    pub from: String,
    pub poses: Vec<Option<Pose3>>,
    pub z_is_up: bool,
    pub notes: Vec<String>,
}

impl Path {
    pub fn count(&self) -> usize {
        self.poses.iter().flatten().count()
    }
}

/// Returns the poses of the first source that has one for half of the times, or else of the one with most poses.
///
/// The sources in their order: the tree of frames in `map`, as a robot that knows its map corrects the odometry there; the
/// tree in the worlds below; odometry; poses with a header; and the tree in a root of another name, which may be the world
/// or the robot.
pub(super) fn find(bag: &Bag, camera: &str, times_s: &[f64]) -> Path {
    let worlds = bag.frames.worlds(camera);
    let topics = || bag.odometry.iter().chain(&bag.poses);
    let named = worlds.iter().copied().filter(|world| is_world(world));
    // In a robot's own tree only its joints move.
    let root = worlds.first().copied().filter(|root| !is_world(root));
    let root = root.filter(|root| !is_robot(bag, root) || topics().next().is_none());
    let of_tree = |world: &str| of_frames(bag, world, camera, times_s);
    let of_topics = topics().map(|(topic, poses)| of_topic(bag, topic, poses, camera, times_s));
    let examined = named.map(of_tree).chain(of_topics).take(MAX_LOOKS / times_s.len().max(1) + 1);
    let mut paths: Vec<Path> = Vec::new();
    for path in examined.chain(root.into_iter().map(of_tree)) {
        let is_enough = 2 * path.count() >= times_s.len();
        paths.push(path);
        if is_enough {
            break;
        }
    }
    let Some(most) = (0..paths.len()).max_by_key(|&at| (paths[at].count(), Reverse(at))) else {
        let poses = vec![None; times_s.len()];
        return Path { from: "/tf".to_string(), poses, z_is_up: false, notes: Vec::new() };
    };
    let mut path = paths.remove(most);
    path.notes.extend(paths.iter().take(MAX_NOTED).map(|other| {
        let (count, all) = (other.count(), times_s.len());
        format!("{} was not used: it has poses for {count} of {all} depth pictures", other.from)
    }));
    path
}

/// Returns whether the root of the tree is a part of the robot: the joints of its head move the camera there, and only
/// odometry moves the robot.
fn is_robot(bag: &Bag, root: &str) -> bool {
    is_base(root) || bag.odometry.values().any(|of| bag.frames.body(&of.child) == root)
}

/// Returns the poses of a topic, and of the camera on the moving frame.
fn of_topic(bag: &Bag, topic: &str, of: &Poses, camera: &str, times_s: &[f64]) -> Path {
    let is_in_tree =
        |child: &str| times_s.iter().any(|time_s| bag.frames.pose(child, camera, *time_s).is_some());
    let carrier = bag.frames.carrier(camera, |frame| is_world(frame) || frame == of.world);
    let has_joints = bag.frames.body(camera) != bag.frames.body(carrier);
    // A moving frame without a name is the robot; so is one in no tree if it is called so, or if joints move the camera.
    let is_of_robot = of.child.is_empty() || ((is_base(&of.child) || has_joints) && !is_in_tree(&of.child));
    let child = if is_of_robot { carrier } else { of.child.as_str() };
    let is_known = is_in_tree(child);
    let is_optical = camera.contains("optical") && (is_of_robot || !child.contains("optical"));
    let is_assumed = !is_known || (child == camera && is_of_robot);
    let assumed = if is_optical { body_from_optical() } else { Pose3::identity() };
    let pose = |&time_s: &f64| {
        let world_from_child = pose_at(&of.poses, time_s, MAX_GAP_S)?;
        let child_from_camera = if is_assumed { assumed } else { bag.frames.pose(child, camera, time_s)? };
        Some(world_from_child * child_from_camera)
    };
    let told = if of.child.is_empty() { carrier } else { of.child.as_str() };
    let note = if is_assumed {
        let axes = if is_optical { "x ahead and z up" } else { "those of the camera" };
        Some(format!(
            "/tf does not connect {camera} with the poses of {topic}; their axes were taken as {axes}"
        ))
    } else {
        let is_other = is_of_robot && !of.child.is_empty();
        is_other.then(|| {
            format!(
                "/tf does not connect {camera} with {told}; the poses of {topic} were taken as those of {carrier}"
            )
        })
    };
    Path {
        from: topic.to_string(),
        poses: times_s.iter().map(pose).collect(),
        // A camera whose place is assumed may look up or down.
        z_is_up: !is_assumed && is_world(&of.world) && bag.frames.is_on_base(told),
        notes: note.into_iter().collect(),
    }
}

/// Returns the poses of the camera in a frame of the tree.
fn of_frames(bag: &Bag, world: &str, camera: &str, times_s: &[f64]) -> Path {
    let mut notes = Vec::new();
    if !is_world(world) {
        notes.push(format!(
            "{world} was taken as the world; if it is a part of the robot, the poses are right only while the robot stands \
             still"
        ));
    }
    Path {
        from: format!("/tf (from {world} to {camera})"),
        poses: times_s.iter().map(|time_s| bag.frames.pose(world, camera, *time_s)).collect(),
        z_is_up: is_world(world) && bag.frames.is_on_base(camera),
        notes,
    }
}

/// Describes a tree that moves a frame in a world, but not the camera; `None` if it moves nothing there, or the camera.
pub(super) fn unconnected(bag: &Bag, camera: &str) -> Option<String> {
    let (parent, child) = bag.frames.moving_in(is_world)?;
    let is_connected = !bag.frames.worlds(camera).is_empty();
    (!is_connected).then(|| {
        let advice = "record /tf_static, too (`ros2 bag record /tf /tf_static ...`)";
        format!(
            "/tf moves {child} in {parent}, but neither /tf nor /tf_static tells where the camera ({camera}) is on it; {advice}"
        )
    })
}

fn is_world(frame: &str) -> bool {
    WORLDS.contains(&frame.rsplit('/').next().unwrap_or(frame))
}

#[cfg(test)]
mod tests {
    use super::super::message::Transform;
    use super::*;
    use crate::clip::layout::trajectory::Timed;
    use crate::container::{Scratch, Spool};
    use std::time::{Duration, Instant};

    /// Returns a bag of a thousand topics; the last one has a pose, at the time 0.
    fn with_topics() -> Bag {
        let mut bag = Bag::new(Spool::new(&Scratch::default(), 0).unwrap());
        for topic in 0..1000 {
            let pose = Timed { time_s: 0.0, value: Pose3::identity() };
            let poses = Some(pose).filter(|_| topic == 999).into_iter().collect();
            let poses = Poses { world: "odom".into(), child: "robot".into(), poses };
            bag.odometry.insert(format!("/odom/{topic}"), poses);
        }
        bag
    }

    #[test]
    fn a_bag_of_many_pictures_and_topics_ends() {
        let bag = with_topics();
        assert_eq!(find(&bag, "camera", &[0.0; 2]).from, "/odom/999");
        let times_s = vec![0.0; 100_000];
        let start = Instant::now();
        let path = find(&bag, "camera", &times_s);
        assert_eq!((path.count(), path.poses.len()), (0, times_s.len()));
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
    }

    /// SLAM nodes without odometry name their world as they like: it is the last source of all.
    #[test]
    fn a_world_of_another_name_is_found_behind_many_topics() {
        let mut bag = with_topics();
        let pose = Some(Timed { time_s: 0.0, value: Pose3::identity() });
        bag.frames.add(Transform { parent: "camera_init".into(), child: "camera".into(), pose }, false);
        let times_s = vec![0.0; 100_000];
        let path = find(&bag, "camera", &times_s);
        assert_eq!((path.from.as_str(), path.count()), ("/tf (from camera_init to camera)", times_s.len()));
    }
}
