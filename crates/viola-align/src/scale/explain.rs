//! The explanations of a clip at all plausible scales.

use crate::refine::{self, Rescaled};
use crate::register::MIN_HITS;
use crate::scan::{self, Hit, RaycastParams, VirtualScan};
use crate::score::{self, MODEL, PoseScorer};
use crate::search::{Search, SearchLimits, SearchParams};
use crate::{AlignError, AlignParams, Target};
use rayon::prelude::*;
use std::ops::RangeInclusive;
use viola_geometry::progress::{self, Progress};
use viola_geometry::{Pose2, Pose3};
use viola_reconstruct::{KeyFrame, PointCloud};

/// The effort of a search over scales.
pub(super) struct Effort {
    /// Heights at which the first camera may be above the floor.
    heights_m: RangeInclusive<f64>,
    /// Part of the usual step of the grid, and of the usual rotations.
    step: f64,
    rotations: f64,
    /// Limits of the search at each scale. The right pose may score below the best one at a wrong scale, so modes are
    /// taken from each.
    limits: SearchLimits,
    /// Budget of the search at each scale. Modes come in the order of their scores, so it ends after the best ones.
    max_nodes: usize,
}

/// The search over all plausible heights.
pub(super) const FIRST: Effort = Effort {
    heights_m: 0.5..=2.2,
    step: 1.0,
    rotations: 0.5,
    limits: SearchLimits { modes: 20, bar: 0.75 },
    max_nodes: 100_000,
};

/// The search if the answer is in doubt: over the usual heights, where most of the right answers are.
pub(super) const IN_DOUBT: Effort = Effort {
    heights_m: 1.0..=1.8,
    step: 0.5,
    rotations: 1.0,
    limits: SearchLimits { modes: 100, bar: 0.7 },
    max_nodes: 500_000,
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

/// A clip fused in nominal metres.
pub(super) struct Shape {
    pub cloud_in_clip: PointCloud,
    pub keys: Vec<KeyFrame>,
    pub clip_from_world: Pose3,
    /// Height of the first camera above the floor, in nominal metres.
    pub camera_height: f64,
}

/// A pose and a scale that may explain the clip.
pub(super) struct Explanation {
    /// In metres per nominal metre.
    pub scale: f64,
    /// Index of the map.
    pub target: usize,
    pub map_from_clip: Pose2,
    /// By the hits and by the scale.
    pub loss_m: f64,
}

impl Shape {
    /// Returns the smallest and the largest scale, in metres per nominal metre.
    fn bounds(&self, effort: &Effort) -> (f64, f64) {
        (effort.heights_m.start() / self.camera_height, effort.heights_m.end() / self.camera_height)
    }

    /// Returns the loss of a scale by itself, for a clip with so many hits.
    ///
    /// Hits are measured in the clip's unit, where their density is that in metres times the scale. Without this
    /// factor a clip fits any wall if it is small enough.
    fn loss_of_scale_m(&self, scale: f64, hits: usize) -> f64 {
        let unusual = (scale * self.camera_height / USUAL_HEIGHT_M).ln() / HEIGHT_LOG;
        MODEL.temperature_m(hits) * 0.5 * unusual * unusual - HIT_SPREAD_M * scale.ln()
    }

    /// Returns the hits at a scale.
    pub(super) fn hits(&self, scale: f64, params: &AlignParams) -> Vec<Hit> {
        score::hit_weights(&self.scan(scale, &params.raycast).hits, &params.hit_weights)
    }

    /// Returns the virtual scan at a scale. It is cast anew, because the vacuum's height has metres.
    fn scan(&self, scale: f64, params: &RaycastParams) -> VirtualScan {
        let keys: Vec<KeyFrame> = self.keys.iter().map(|key| key.clone().scaled(scale)).collect();
        let mut clip_from_world = self.clip_from_world;
        clip_from_world.translation.vector *= scale;
        scan::raycast(&self.cloud_in_clip.clone().scaled(scale), &keys, &clip_from_world, params)
    }

    /// Returns the grid of scales and its step.
    fn grid(&self, effort: &Effort, params: &AlignParams) -> (Vec<f64>, f64) {
        let (least, most) = self.bounds(effort);
        let middle = (least * most).sqrt();
        let hits = self.scan(middle, &params.raycast).hits;
        let squared: f64 = hits.iter().map(|hit| hit.point_m.coords.norm_squared()).sum();
        let reach_m = (squared / hits.len().max(1) as f64).sqrt() * most / middle;
        let step = (STEP_M / reach_m).clamp(STEP_LOG.0, STEP_LOG.1) * effort.step;
        let count = ((most / least).ln() / step).ceil() as usize;
        let step = (most / least).ln() / count as f64;
        ((0..=count).map(|i| least * (i as f64 * step).exp()).collect(), step)
    }
}

/// Returns the explanations at all scales in all maps, and whether the search proved the optimum of
/// each scale.
pub(super) fn explanations(
    shape: &Shape,
    targets: &[&Target],
    effort: &Effort,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<(Vec<Explanation>, bool), AlignError> {
    let (scales, step) = shape.grid(effort, params);
    let at_scale = |&scale: &f64| at_scale(shape, (scale, step), targets, effort, params, progress);
    let found: Vec<(Vec<Explanation>, bool)> =
        scales.par_iter().map(at_scale).collect::<Result<_, AlignError>>()?;
    let complete = found.iter().all(|(_, complete)| *complete);
    let explanations: Vec<Explanation> = found.into_iter().flat_map(|(found, _)| found).collect();
    Ok((explanations, complete))
}

/// Returns the explanations at a scale of the grid with this step, in the logarithm.
fn at_scale(
    shape: &Shape,
    (scale, step): (f64, f64),
    targets: &[&Target],
    effort: &Effort,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<(Vec<Explanation>, bool), AlignError> {
    progress::check(progress)?;
    let scan = shape.scan(scale, &params.raycast);
    let hits = score::hit_weights(&scan.hits, &params.hit_weights);
    let (mut explanations, mut complete) = (Vec::new(), true);
    if hits.len() < MIN_HITS {
        return Ok((explanations, complete));
    }
    let (low, high) = shape.bounds(effort);
    let search = SearchParams {
        rotations: (params.search.rotations as f64 * effort.rotations) as usize,
        first: effort.limits,
        in_doubt: effort.limits,
        max_nodes: effort.max_nodes,
        ..params.search.clone()
    };
    for (index, target) in targets.iter().enumerate() {
        let found = Search::new(&hits, target, &search).run(&effort.limits, progress)?;
        let is_optimum_known = found.modes.first().is_none_or(|best| best.score >= found.open_bound);
        complete &= found.complete || is_optimum_known;
        let starts: Vec<Pose2> = found.modes.iter().map(|mode| mode.map_from_clip).collect();
        let refined = distinct(refine::refine_with_scale(&starts, &hits, target, step));
        let resized: Vec<Vec<Hit>> = refined.iter().map(|at| resized(&hits, at.factor)).collect();
        let mut scorer = PoseScorer::new(&hits, &scan, params.score.unknown_share);
        for (Rescaled { map_from_clip, factor }, hits) in refined.into_iter().zip(&resized) {
            let scale = scale * factor;
            scorer = scorer.with_hits(hits);
            if (low..=high).contains(&scale) {
                let by_hits_m = params.score.weights.loss_m(&scorer.evidence(&map_from_clip, target));
                let loss_m = by_hits_m + shape.loss_of_scale_m(scale, hits.len());
                explanations.push(Explanation { scale, target: index, map_from_clip, loss_m });
            }
        }
    }
    Ok((explanations, complete))
}

/// Returns the refined poses that differ, in their order.
fn distinct(refined: Vec<Rescaled>) -> Vec<Rescaled> {
    const SAME_M: f64 = 0.05;
    const SAME_RAD: f64 = 0.02;
    let mut kept: Vec<Rescaled> = Vec::new();
    for at in refined {
        let is_same = |known: &Rescaled| {
            let turned = viola_geometry::angle_between(known.map_from_clip.yaw_rad, at.map_from_clip.yaw_rad);
            known.map_from_clip.distance_m(&at.map_from_clip) < SAME_M && turned < SAME_RAD
        };
        if !kept.iter().any(is_same) {
            kept.push(at);
        }
    }
    kept
}

fn resized(hits: &[Hit], factor: f64) -> Vec<Hit> {
    let resized = |hit: &Hit| Hit { point_m: hit.point_m * factor, from_m: hit.from_m * factor, ..*hit };
    hits.iter().map(resized).collect()
}
