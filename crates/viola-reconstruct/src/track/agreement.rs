//! Measures the agreement of the key frames' readings by their poses.
//!
//! Two key frames that see the same surface read it in the same place, to the accuracy of the sensor. If the
//! disagreement grows with the camera's way between the two, the poses drift: drift accumulates, the errors
//! of single poses do not. A fused clip has its readings in memory, so the measurement takes
//! milliseconds and decodes no picture.

use crate::key_frame::KeyFrame;
use viola_geometry::Pose3;

/// Number of key frames that are compared with each other, evenly over the clip.
const COMPARED: usize = 60;
/// Maximum angle and distance between the cameras of a pair; beyond, they see surfaces too differently.
const MAX_TURN_RAD: f64 = 0.6;
const MAX_APART_M: f64 = 1.0;
/// Maximum distance between readings of one surface, and maximum depth at which the sensor is accurate.
const SAME_SURFACE_M: f64 = 0.15;
const MAX_DEPTH_M: f64 = 4.0;
/// Stride of a key frame's compared readings; minimum fraction and number of them on the same surface.
const EVERY: usize = 3;
const MIN_READINGS_FRACTION: f64 = 1.0 / 3.0;
const MIN_READINGS: usize = 100;
/// Maximum way between the frames of a pair that measures the sensor's accuracy, and minimum way of a pair
/// that measures drift.
const NEAR_M: f64 = 0.3;
const FAR_M: f64 = 0.6;
/// Minimum number of pairs of either kind.
const MIN_PAIRS: usize = 6;

/// Two key frames that see the same surface.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pair {
    a: usize,
    b: usize,
    way_m: f64,
    /// Median distance between their readings.
    off_m: f64,
}

/// The pairs among key frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Agreement {
    pairs: Vec<Pair>,
}

impl Agreement {
    /// Compares the key frames by their own poses.
    pub fn of(keys: &[KeyFrame]) -> Agreement {
        let mut way_m = vec![0.0];
        for pair in keys.windows(2) {
            let step = pair[0].world_from_camera.inverse() * pair[1].world_from_camera;
            way_m.push(way_m[way_m.len() - 1] + step.translation.vector.norm());
        }
        let stride = keys.len().div_ceil(COMPARED).max(1);
        let mut pairs = Vec::new();
        for a in (0..keys.len()).step_by(stride) {
            for b in (a + 1..keys.len()).filter(|b| *b == a + 1 || (b - a).is_multiple_of(stride)) {
                let b_from_a = keys[b].world_from_camera.inverse() * keys[a].world_from_camera;
                let is_near = b_from_a.rotation.angle() < MAX_TURN_RAD
                    && b_from_a.translation.vector.norm() < MAX_APART_M;
                let off_m = if is_near { off_m(&keys[a], &keys[b], &b_from_a) } else { None };
                pairs.extend(off_m.map(|off_m| Pair { a, b, way_m: way_m[b] - way_m[a], off_m }));
            }
        }
        Agreement { pairs }
    }

    /// Returns the random-walk drift after one metre, in metres; `None` if too little is seen twice.
    pub fn growth_m(&self) -> Option<f64> {
        let near: Vec<f64> =
            self.pairs.iter().filter(|p| p.way_m < NEAR_M).map(|p| p.off_m.powi(2)).collect();
        let far: Vec<&Pair> = self.pairs.iter().filter(|p| p.way_m > FAR_M).collect();
        if near.len() < MIN_PAIRS || far.len() < MIN_PAIRS {
            return None;
        }
        let at_once = median(near);
        let growth = median(far.iter().map(|p| (p.off_m.powi(2) - at_once) / p.way_m).collect());
        Some(growth.max(0.0).sqrt())
    }

    /// Returns the disagreement with other poses as a fraction of that with the own poses, median over the
    /// pairs; `None` if too few pairs overlap with other poses.
    pub fn fraction_left(&self, keys: &[KeyFrame], world_from_camera: &[Option<Pose3>]) -> Option<f64> {
        let pose = |place: usize| world_from_camera.get(keys[place].index).copied().flatten();
        let fractions: Vec<f64> = self
            .pairs
            .iter()
            .filter_map(|pair| {
                let b_from_a = pose(pair.b)?.inverse() * pose(pair.a)?;
                Some(off_m(&keys[pair.a], &keys[pair.b], &b_from_a)? / pair.off_m.max(f64::MIN_POSITIVE))
            })
            .collect();
        (2 * fractions.len() > self.pairs.len()).then(|| median(fractions))
    }
}

/// Returns the median distance between readings, along the axis of `b`; `None` with too few in common.
fn off_m(a: &KeyFrame, b: &KeyFrame, b_from_a: &Pose3) -> Option<f64> {
    let camera = b.readings.camera();
    let (mut looked_up, mut off_m) = (0, Vec::new());
    for point in a.readings.points_in_camera().step_by(EVERY) {
        looked_up += 1;
        let point = b_from_a * point;
        let Some(pixel) = camera.project(&point) else { continue };
        let Some(depth_m) = b.readings.depth_at(pixel.x, pixel.y) else { continue };
        let off = (point.z - depth_m).abs();
        if depth_m < MAX_DEPTH_M && off < SAME_SURFACE_M {
            off_m.push(off);
        }
    }
    let is_enough =
        off_m.len() >= MIN_READINGS && off_m.len() as f64 >= MIN_READINGS_FRACTION * f64::from(looked_up);
    is_enough.then(|| median(off_m))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
