//! A clip without metres at a scale: its plausible scales, their grid, and its virtual scan at each of them.

use crate::AlignParams;
use crate::scan::{self, Hit, RaycastParams, VirtualScan};
use crate::score::{self, MODEL};
use crate::search::SearchLimits;
use std::ops::RangeInclusive;
use viola_geometry::Pose3;
use viola_reconstruct::{KeyFrame, PointCloud};

/// The effort of a search over scales.
pub(super) struct Effort {
    /// Heights at which the first camera may be above the floor.
    heights_m: RangeInclusive<f64>,
    /// Part of the usual step of the grid, and of the usual rotations.
    step: f64,
    pub rotations: f64,
    /// Limits of the search at each scale, within that of the loss.
    pub limits: SearchLimits,
    /// Budget of the search at each scale. Modes come in the order of their scores, so it ends after the best ones.
    pub max_nodes: usize,
}

/// The search over all plausible heights.
pub(super) const FIRST: Effort = Effort {
    heights_m: 0.5..=2.2,
    step: 1.0,
    rotations: 0.5,
    limits: SearchLimits { modes: 20, min_score_ratio: 0.75 },
    max_nodes: 200_000,
};

/// The search if the answer is in doubt: over the usual heights, where most of the right answers are.
pub(super) const IN_DOUBT: Effort = Effort {
    heights_m: 1.0..=1.8,
    step: 0.5,
    rotations: 1.0,
    limits: SearchLimits { modes: 100, min_score_ratio: 0.7 },
    max_nodes: 200_000,
};

/// Half a step of the grid of scales moves a hit at the reach of the scan by half of this.
const STEP_M: f64 = 0.1;
/// Bounds of the step, in the logarithm of the scale.
const STEP_LOG: (f64, f64) = (0.02, 0.05);

/// Usual height of a first camera above the floor, and the deviation of its logarithm.
const USUAL_HEIGHT_M: f64 = 1.35;
const HEIGHT_LOG: f64 = 0.3;
/// Mean distance of the hits of right poses from the map, which is also the scale of its (exponential) distribution.
const HIT_SPREAD_M: f64 = 0.04;

/// Maximum number of key frames whose rays are cast at each scale of the grid.
const MAX_CAMERAS: usize = 16;

/// A clip fused in nominal metres.
pub(super) struct Shape {
    /// The upright surface: nothing else stops a ray.
    pub cloud_in_clip: PointCloud,
    pub keys: Vec<KeyFrame>,
    pub clip_from_world: Pose3,
    /// Height of the first camera above the floor, in nominal metres.
    pub camera_height: f64,
}

impl Shape {
    /// Returns the smallest and the largest scale, in metres per nominal metre.
    pub(super) fn bounds(&self, effort: &Effort) -> (f64, f64) {
        (effort.heights_m.start() / self.camera_height, effort.heights_m.end() / self.camera_height)
    }

    /// Returns the loss of a scale by itself, for a clip with `hits` hits.
    ///
    /// Hits are measured in the clip's unit, where their density is that in metres times the scale. Without this
    /// factor a clip fits any wall if it is small enough.
    pub(super) fn loss_of_scale_m(&self, scale: f64, hits: usize) -> f64 {
        let unusual = (scale * self.camera_height / USUAL_HEIGHT_M).ln() / HEIGHT_LOG;
        MODEL.temperature_m(hits) * 0.5 * unusual * unusual - HIT_SPREAD_M * scale.ln()
    }

    /// Returns the hits at a scale.
    pub(super) fn hits(&self, scale: f64, params: &AlignParams) -> Vec<Hit> {
        score::hit_weights(&self.scan(scale, &self.keys, &params.raycast).hits, &params.hit_weights)
    }

    /// Returns the virtual scan at a scale from some of the key frames.
    pub(super) fn scan_of_some(&self, scale: f64, params: &RaycastParams) -> VirtualScan {
        let kept = self.keys.len().min(MAX_CAMERAS);
        let some: Vec<KeyFrame> = (0..kept).map(|i| self.keys[i * self.keys.len() / kept].clone()).collect();
        self.scan(scale, &some, params)
    }

    /// Returns the virtual scan at a scale. It is cast for each scale, because the vacuum's height has metres.
    fn scan(&self, scale: f64, keys: &[KeyFrame], params: &RaycastParams) -> VirtualScan {
        let keys: Vec<KeyFrame> = keys.iter().map(|key| key.clone().scaled(scale)).collect();
        let mut clip_from_world = self.clip_from_world;
        clip_from_world.translation.vector *= scale;
        scan::raycast(&self.cloud_in_clip.clone().scaled(scale), &keys, &clip_from_world, params)
    }

    /// Returns the grid of scales and its step.
    pub(super) fn grid(&self, effort: &Effort, params: &AlignParams) -> (Vec<f64>, f64) {
        let (least, most) = self.bounds(effort);
        let middle = (least * most).sqrt();
        let hits = self.scan_of_some(middle, &params.raycast).hits;
        let squared: f64 = hits.iter().map(|hit| hit.point_m.coords.norm_squared()).sum();
        let reach_m = (squared / hits.len().max(1) as f64).sqrt() * most / middle;
        let step = (STEP_M / reach_m).clamp(STEP_LOG.0, STEP_LOG.1) * effort.step;
        let count = ((most / least).ln() / step).ceil() as usize;
        let step = (most / least).ln() / count as f64;
        ((0..=count).map(|i| least * (i as f64 * step).exp()).collect(), step)
    }
}
