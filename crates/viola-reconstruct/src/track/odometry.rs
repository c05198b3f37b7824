//! Aligns frame after frame to the latest key frame.

use super::lost::Lost;
use super::picture::Pyramid;
use super::reference::Reference;
use super::shutter::Rolling;
use super::step::{Step, align};
use viola_geometry::Pose3;

/// A frame becomes a key frame if its overlap with the latest one is less than this, ...
const KEY_OVERLAP: f64 = 0.75;
/// ... or its score is, which is before steps are in doubt, ...
const KEY_SCORE: f64 = 0.6;
/// ... or the camera moved by this fraction of the median depth ...
pub(crate) const KEY_MOTION: f64 = 0.12;
/// ... or turned by this.
pub(crate) const KEY_TURN_RAD: f64 = 10f64.to_radians();
/// A step with a lower score than this is compared with steps from other starts ...
const DOUBT_SCORE: f64 = 0.55;
/// ... and a step with a lower score or overlap than these is rejected.
const LOST_SCORE: f64 = 0.4;
const LOST_OVERLAP: f64 = 0.3;
/// Maximum standard deviation of a known position in the worst direction ...
const UNSURE_M: f64 = 0.02;
/// ... and maximum number of frames in a row with an unknown position.
const MAX_UNSURE_FRAMES: usize = 12;
/// Maximum deviation of a step by pictures from the device's step. A larger one is wrong: something moved
/// with the camera, or everything looks alike. The shares are fractions of the device's step and turn.
const MAX_OFF_M: f64 = 0.04;
const MAX_OFF_FRACTION: f64 = 0.2;
const MAX_OFF_RAD: f64 = 2f64.to_radians();
const MAX_OFF_TURN_FRACTION: f64 = 0.1;

/// The latest key frame and the motion of the camera.
pub(super) struct Odometry {
    key: Option<Key>,
}

struct Key {
    reference: Reference,
    /// The first key frame before rectification, until its motion is known.
    raw: Option<Pyramid>,
    /// The last frame and its pose.
    last: Pyramid,
    camera_from_key: Pose3,
    /// Motion from the second last frame to the last one.
    motion: Pose3,
    exposure: (f64, f64),
    /// Frames in a row with an unknown position.
    unsure: usize,
}

/// Result for a tracked frame.
#[derive(Debug, Clone)]
pub(super) struct Moved {
    /// The rectified frame.
    pub pyramid: Pyramid,
    /// The rectified first key frame, once its motion is known.
    pub first: Option<Pyramid>,
    /// From the last key frame.
    pub step: Step,
    /// True if the frame is the next key frame.
    pub is_key: bool,
}

impl Odometry {
    pub fn new() -> Odometry {
        Odometry { key: None }
    }

    /// Restarts with a key frame.
    pub fn begin(&mut self, pyramid: Pyramid) {
        self.key = Some(Key {
            reference: Reference::new(&pyramid),
            raw: Some(pyramid.clone()),
            last: pyramid,
            camera_from_key: Pose3::identity(),
            motion: Pose3::identity(),
            exposure: (1.0, 0.0),
            unsure: 0,
        });
    }

    /// Returns the next frame's step from the key frame. `expected` is the step by the device's poses: it replaces the start
    /// by constant motion, and a step that contradicts it is rejected, so the frame is no key frame.
    pub fn follow(
        &mut self,
        raw: Pyramid,
        rolling: Option<Rolling>,
        expected: Option<&Pose3>,
    ) -> Result<Moved, Lost> {
        let Some(key) = self.key.as_mut() else { return Err(Lost::Jump) };
        let rectified = |motion: &Pose3| rolling.and_then(|rolling| rolling.rectified(&raw, motion));
        let guess = rectified(&key.motion);
        let mut step = key.step(guess.as_ref().unwrap_or(&raw), expected).ok_or(Lost::Jump)?;
        let first = key.raw.take().and_then(|first| rolling?.rectified(&first, &step.camera_from_key));
        if let Some(first) = &first {
            key.reference = Reference::new(first);
            key.last = first.clone();
            key.motion = step.camera_from_key;
            let guess = rectified(&key.motion);
            step = key.step(guess.as_ref().unwrap_or(&raw), expected).ok_or(Lost::Jump)?;
        }
        if step.overlap < LOST_OVERLAP || step.score() < LOST_SCORE {
            return Err(Lost::Jump);
        }
        if expected.is_some_and(|expected| contradicts(expected, &step.camera_from_key)) {
            return Err(Lost::Jump);
        }
        let worst_m = step.worst_m();
        key.unsure = if worst_m > UNSURE_M { key.unsure + 1 } else { 0 };
        if key.unsure > MAX_UNSURE_FRAMES {
            return Err(Lost::Unconstrained);
        }
        key.motion = step.camera_from_key * key.camera_from_key.inverse();
        key.motion.rotation.renormalize();
        let pyramid = rectified(&key.motion).unwrap_or(raw);
        let moved = step.camera_from_key.translation.vector.norm();
        let is_key = step.overlap < KEY_OVERLAP
            || step.score() < KEY_SCORE
            || moved > KEY_MOTION * f64::from(key.reference.median_depth_m)
            || step.camera_from_key.rotation.angle() > KEY_TURN_RAD;
        if is_key {
            key.reference = Reference::new(&pyramid);
            key.camera_from_key = Pose3::identity();
            key.exposure = (1.0, 0.0);
        } else {
            key.camera_from_key = step.camera_from_key;
            key.exposure = (step.gain, step.offset);
        }
        key.last = pyramid.clone();
        Ok(Moved { pyramid, first, step, is_key })
    }
}

impl Key {
    /// Returns the best step. It starts from constant motion; in doubt also from the last pose, from the last
    /// frame, and from directions all around.
    fn step(&self, pyramid: &Pyramid, expected: Option<&Pose3>) -> Option<Step> {
        let still = self.camera_from_key;
        let going_on = expected.copied().unwrap_or(self.motion * still);
        let try_from = |start: &Pose3| align(&self.reference, pyramid, start, self.exposure, 0);
        let mut best = try_from(&going_on);
        if best.as_ref().is_some_and(|step| step.score() >= DOUBT_SCORE) {
            return best;
        }
        let better = |step: Step, best: &mut Option<Step>| {
            if best.as_ref().is_none_or(|best| step.score() > best.score()) {
                *best = Some(step);
            }
        };
        if let Some(step) = try_from(&still) {
            better(step, &mut best);
        }
        if best.as_ref().is_some_and(|step| step.score() >= DOUBT_SCORE) {
            return best;
        }
        let last = Reference::new(&self.last);
        let starts = [Pose3::identity(), self.motion];
        let mut wide: Vec<Step> = starts
            .iter()
            .chain(&around())
            .filter_map(|start| align(&last, pyramid, start, (1.0, 0.0), COARSE))
            .collect();
        wide.sort_by(|a, b| b.score().total_cmp(&a.score()));
        for coarse in wide.iter().take(2) {
            let exposure = (coarse.gain, coarse.offset);
            if let Some(mut step) = align(&last, pyramid, &coarse.camera_from_key, exposure, 0) {
                step.camera_from_key *= still;
                better(step, &mut best);
            }
        }
        best
    }
}

/// Returns whether a step contradicts the device's poses.
fn contradicts(expected: &Pose3, found: &Pose3) -> bool {
    let off = expected.inverse() * found;
    off.translation.vector.norm() > MAX_OFF_M + MAX_OFF_FRACTION * expected.translation.vector.norm()
        || off.rotation.angle() > MAX_OFF_RAD + MAX_OFF_TURN_FRACTION * expected.rotation.angle()
}

/// Finest layer of a wide search.
const COARSE: usize = 2;

/// Returns turns all around the last direction, by up to half a picture.
fn around() -> Vec<Pose3> {
    let turn = |yaw_deg: f64, pitch_deg: f64| {
        let axis = viola_geometry::Vector3::new(pitch_deg.to_radians(), yaw_deg.to_radians(), 0.0);
        Pose3::new(viola_geometry::Vector3::zeros(), axis)
    };
    let mut turns = Vec::new();
    for pitch_deg in [0.0, -10.0, 10.0] {
        for yaw_deg in [-24.0, -16.0, -8.0, 8.0, 16.0, 24.0] {
            turns.push(turn(yaw_deg, pitch_deg));
        }
    }
    turns.extend([turn(0.0, -10.0), turn(0.0, 10.0)]);
    turns
}
