//! Poses that a device gave, as something known beside what the pictures say.

use super::graph::Tie;
use super::keys::KeyFrame;
use super::lost::Lost;
use super::picture::Pyramid;
use super::{Followed, Tracker};
use nalgebra::Matrix6;
use viola_geometry::Pose3;

/// How far the poses of a device are trusted. Their errors grow as a random walk.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceParams {
    /// The standard deviation of a step of one metre ...
    pub drift_m: f64,
    pub drift_rad: f64,
    /// ... and of one of no length.
    pub least_m: f64,
    pub least_rad: f64,
    /// A step by pictures that is further than this from the device's is wrong: something moved with the camera, or
    /// everything looks alike. The shares are of the step's own length and turn.
    pub most_m: f64,
    pub most_share: f64,
    pub most_rad: f64,
    pub most_turn_share: f64,
    /// Poses by which readings disagree after one metre by no more than this do not drift ...
    pub tolerated_m: f64,
    /// ... and refined ones that leave more than this share of the disagreement are no better.
    pub most_left: f64,
}

impl Default for DeviceParams {
    fn default() -> Self {
        DeviceParams {
            drift_m: 0.01,
            drift_rad: 0.003,
            least_m: 0.002,
            least_rad: 0.001,
            most_m: 0.04,
            most_share: 0.2,
            most_rad: 2f64.to_radians(),
            most_turn_share: 0.1,
            tolerated_m: 0.013,
            most_left: 0.95,
        }
    }
}

impl DeviceParams {
    /// What the device says of two key frames.
    pub(super) fn tie(&self, a: usize, b: usize, b_from_a: Pose3) -> Tie {
        let way_m = b_from_a.translation.vector.norm();
        let precision = |least: f64, drift: f64| 1.0 / (least * least + drift * drift * way_m);
        let (place, turn) =
            (precision(self.least_m, self.drift_m), precision(self.least_rad, self.drift_rad));
        let information = Matrix6::from_fn(|row, column| match (row == column, row < 3) {
            (false, _) => 0.0,
            (true, true) => place,
            (true, false) => turn,
        });
        Tie { a, b, b_from_a, information, is_loop: false }
    }

    /// Whether a step cannot be, by what the device says of it.
    pub(super) fn contradicts(&self, expected: &Pose3, found: &Pose3) -> bool {
        let off = expected.inverse() * found;
        off.translation.vector.norm() > self.most_m + self.most_share * expected.translation.vector.norm()
            || off.rotation.angle() > self.most_rad + self.most_turn_share * expected.rotation.angle()
    }
}

impl Tracker {
    /// Where the frame is against a key frame by what the device says of both.
    pub(super) fn expected(&self, key: usize) -> Option<Pose3> {
        let world_from_camera = (*self.devices.last()?)?;
        let world_from_key = self.devices[self.keys[key].frame]?;
        Some(world_from_camera.inverse() * world_from_key)
    }

    pub(super) fn contradicts(&self, expected: Option<&Pose3>, found: &Pose3) -> bool {
        let device = self.device.as_ref();
        device.zip(expected).is_some_and(|(device, expected)| device.contradicts(expected, found))
    }

    /// To the key frame that comes next.
    pub(super) fn device_tie(&self, key: usize, expected: Pose3) -> Option<Tie> {
        self.device.as_ref().map(|device| device.tie(key, self.keys.len(), expected))
    }

    /// A frame whose pictures do not tell where it is, and whose device does.
    pub(super) fn carry(&mut self, pyramid: Pyramid, expected: Pose3) -> Followed {
        let key = self.keys.len() - 1;
        let params = &self.params.odometry;
        let is_near = expected.translation.vector.norm() < params.key_motion * self.keys[key].median_depth_m
            && expected.rotation.angle() < params.key_turn_rad;
        if is_near || Lost::of(&pyramid).is_some() {
            return Followed { key, camera_from_key: expected, uncertainty_m: 0.0 };
        }
        self.ties.extend(self.device_tie(key, expected));
        let pose = self.keys[key].world_from_key * expected.inverse();
        let (frame, segment) = (self.frames.len(), self.keys[key].segment);
        let next = KeyFrame::new(frame, segment, pose, &pyramid, &self.describer);
        self.start(next, pyramid)
    }
}
