//! The tree of coordinate frames, as `/tf` and `/tf_static` tell it.

use super::message::Transform;
use crate::clip::layout::trajectory::{Timed, pose_at};
use std::collections::BTreeMap;
use viola_geometry::Pose3;

/// Maximum time between a picture and the poses around it: odometry of 10 Hz.
pub(super) const MAX_GAP_S: f64 = 0.11;
const MAX_LEVELS: usize = 64;
/// Maximum number of frames with a parent; a robot has hundreds. Later ones are ignored.
const MAX_EDGES: usize = 10_000;

/// Poses of a frame in its parent.
struct Edge {
    parent: String,
    is_static: bool,
    poses: Vec<Timed<Pose3>>,
}

/// Each frame's edge to its parent.
#[derive(Default)]
pub(super) struct Frames {
    edges: BTreeMap<String, Edge>,
}

impl Frames {
    /// Adds a pose; the first parent of a frame counts. A static pose replaces the last one.
    pub fn add(&mut self, transform: Transform, is_static: bool) {
        let Transform { parent, child, pose } = transform;
        let Some(pose) = pose.filter(|_| parent != child) else { return };
        if self.edges.len() >= MAX_EDGES && !self.has(&child) {
            return;
        }
        let edge = self.edges.entry(child).or_insert_with(|| Edge {
            parent: parent.clone(),
            is_static,
            poses: Vec::new(),
        });
        if edge.parent == parent && edge.is_static == is_static {
            if is_static {
                edge.poses.clear();
            }
            edge.poses.push(pose);
        }
    }

    /// Sorts the poses by time; call it after the last [`Frames::add`].
    pub fn sort(&mut self) {
        for edge in self.edges.values_mut() {
            edge.poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        }
    }

    /// Returns the names of a frame and of those above it, and whether the edge above each of them is static.
    fn above<'a>(&'a self, frame: &'a str) -> impl Iterator<Item = (&'a str, Option<&'a Edge>)> {
        let mut next = Some(frame);
        std::iter::from_fn(move || {
            let frame = next?;
            let edge = self.edges.get(frame);
            next = edge.map(|edge| edge.parent.as_str());
            Some((frame, edge))
        })
        .take(MAX_LEVELS)
    }

    /// Returns the last frame above that is held rigidly.
    pub fn body<'a>(&'a self, frame: &'a str) -> &'a str {
        let is_end = |(_, edge): &(&str, Option<&Edge>)| edge.is_none_or(|edge| !edge.is_static);
        self.above(frame).find(is_end).map_or(frame, |(frame, _)| frame)
    }

    /// Returns the frames above a frame in which it moves, from the one called `map`, or else from the root, downwards.
    pub fn worlds<'a>(&'a self, frame: &'a str) -> Vec<&'a str> {
        let mut moves = false;
        let mut worlds = Vec::new();
        for (name, edge) in self.above(frame) {
            if moves {
                worlds.push(name);
            }
            if name.rsplit('/').next() == Some("map") {
                break;
            }
            moves |= edge.is_some_and(|edge| !edge.is_static);
        }
        worlds.reverse();
        worlds
    }

    /// Returns whether the tree has a place for a frame.
    pub fn has(&self, frame: &str) -> bool {
        self.edges.contains_key(frame)
    }

    /// Returns a world and the first frame, by name, that moves in it.
    pub fn moving_in(&self, is_world: impl Fn(&str) -> bool) -> Option<(&str, &str)> {
        let moving = self.edges.iter().filter(|(_, edge)| !edge.is_static && is_world(&edge.parent));
        moving.map(|(child, edge)| (edge.parent.as_str(), child.as_str())).next()
    }

    /// Returns the frame of the robot that carries a camera: its mobile base, or else the last frame below a world.
    pub fn carrier<'a>(&'a self, camera: &'a str, is_world: impl Fn(&str) -> bool) -> &'a str {
        let names = self.above(camera).map(|(name, _)| name);
        let own: Vec<&str> = names.take_while(|name| !is_world(name)).collect();
        own.iter().rfind(|name| is_base(name)).or(own.last()).copied().unwrap_or(camera)
    }

    /// Returns whether a mobile base is among a frame and those above it: its z axis is up.
    pub fn is_on_base(&self, frame: &str) -> bool {
        self.above(frame).any(|(name, _)| is_base(name))
    }

    /// Returns the pose of `from` in `to` at a time, by their lowest common frame.
    pub fn pose(&self, to: &str, from: &str, time_s: f64) -> Option<Pose3> {
        let climb = |frame| {
            let mut top_from_frame = Some(Pose3::identity());
            self.above(frame).map_while(move |(name, edge)| {
                let here = top_from_frame?;
                top_from_frame = edge.and_then(|edge| Some(edge.at(time_s)? * here));
                Some((name, here))
            })
        };
        let of_from: BTreeMap<&str, Pose3> = climb(from).collect();
        let (common, common_from_to) = climb(to).find(|(name, _)| of_from.contains_key(name))?;
        Some(common_from_to.inverse() * of_from.get(common)?)
    }
}

/// Returns whether a frame is that of a mobile base (REP 105).
pub(super) fn is_base(frame: &str) -> bool {
    frame.ends_with("base_link") || frame.ends_with("base_footprint")
}

impl Edge {
    fn at(&self, time_s: f64) -> Option<Pose3> {
        if self.is_static {
            return self.poses.last().map(|pose| pose.value);
        }
        pose_at(&self.poses, time_s, MAX_GAP_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_of_millions_of_frames_is_cut() {
        let mut frames = Frames::default();
        for number in 0..2 * MAX_EDGES {
            let pose = Some(Timed { time_s: 0.0, value: Pose3::identity() });
            frames.add(Transform { parent: "map".into(), child: number.to_string(), pose }, false);
        }
        assert_eq!(frames.edges.len(), MAX_EDGES);
        assert!(frames.has("0") && !frames.has(&MAX_EDGES.to_string()));
    }
}
