//! Device poses as measurements beside the pictures.

use super::graph::Edge;
use super::keys::KeyFrame;
use super::lost::Lost;
use super::odometry::{KEY_MOTION, KEY_TURN_RAD};
use super::picture::Pyramid;
use super::{Followed, Tracker};
use nalgebra::Matrix6;
use viola_geometry::Pose3;

/// Standard deviations of a device's step of zero length, ...
const MIN_DEVIATION_M: f64 = 0.002;
const MIN_DEVIATION_RAD: f64 = 0.001;
/// ... and of its random-walk drift after one metre.
const DRIFT_M: f64 = 0.01;
const DRIFT_RAD: f64 = 0.003;

/// Returns the edge between two key frames by the device's poses.
pub(super) fn edge(a: usize, b: usize, b_from_a: Pose3) -> Edge {
    let way_m = b_from_a.translation.vector.norm();
    let precision = |least: f64, drift: f64| 1.0 / (least * least + drift * drift * way_m);
    let (place, turn) = (precision(MIN_DEVIATION_M, DRIFT_M), precision(MIN_DEVIATION_RAD, DRIFT_RAD));
    let information = Matrix6::from_fn(|row, column| match (row == column, row < 3) {
        (false, _) => 0.0,
        (true, true) => place,
        (true, false) => turn,
    });
    Edge { a, b, b_from_a, information, is_loop: false }
}

impl Tracker {
    /// Returns the frame's pose against a key frame by the device's poses of both.
    pub(super) fn expected(&self, key: usize) -> Option<Pose3> {
        let world_from_camera = (*self.devices.last()?)?;
        let world_from_key = self.devices[self.keys[key].frame]?;
        Some(world_from_camera.inverse() * world_from_key)
    }

    /// Places a frame by its device's pose, because its pictures do not constrain it.
    pub(super) fn carry(&mut self, pyramid: Pyramid, expected: Pose3) -> Followed {
        let key = self.keys.len() - 1;
        let is_near = expected.translation.vector.norm() < KEY_MOTION * self.keys[key].median_depth_m
            && expected.rotation.angle() < KEY_TURN_RAD;
        if is_near || Lost::of(&pyramid).is_some() {
            return Followed { key, camera_from_key: expected };
        }
        self.edges.push(edge(key, key + 1, expected));
        let pose = self.keys[key].world_from_key * expected.inverse();
        let (frame, segment) = (self.frames.len(), self.keys[key].segment);
        let next = KeyFrame::new(frame, segment, pose, &pyramid, &self.describer);
        self.start(next, pyramid)
    }
}
