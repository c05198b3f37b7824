//! The explanations of a clip at all plausible scales.

use super::search::{Searched, search};
use super::shape::{Effort, Shape};
use crate::refine::{self, Rescaled};
use crate::scan::Hit;
use crate::score::PoseScorer;
use crate::{AlignError, AlignParams, Target};
use rayon::prelude::*;
use viola_geometry::Pose2;
use viola_geometry::progress::Progress;

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

/// Returns the explanations at all scales in all maps, and whether the search proved the optimum of
/// each scale; `None` if the clip has too few hits at every scale.
pub(super) fn explanations(
    shape: &Shape,
    targets: &[&Target],
    effort: &Effort,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Option<(Vec<Explanation>, bool)>, AlignError> {
    let (scales, step) = shape.grid(effort, params);
    let searched = search(shape, &scales, targets, effort, params, progress)?;
    if searched.is_empty() {
        return Ok(None);
    }
    let (low, high) = shape.bounds(effort);
    let explained = |searched: &Searched| explained(shape, searched, step, targets, params);
    let found: Vec<Vec<Explanation>> = searched.par_iter().map(explained).collect();
    let is_plausible = |explanation: &Explanation| (low..=high).contains(&explanation.scale);
    let explanations = found.into_iter().flatten().filter(is_plausible).collect();
    Ok(Some((explanations, searched.iter().all(|searched| searched.complete))))
}

/// Refines and ranks the modes at a scale of the grid with this step, in the logarithm.
fn explained(
    shape: &Shape,
    searched: &Searched,
    step: f64,
    targets: &[&Target],
    params: &AlignParams,
) -> Vec<Explanation> {
    let Searched { scale, scan, hits, modes, .. } = searched;
    let mut explanations = Vec::new();
    for (index, (target, starts)) in targets.iter().zip(modes).enumerate() {
        if starts.is_empty() {
            continue;
        }
        let refined = distinct(refine::refine_with_scale(starts, hits, target, step));
        let scaled = |at: &Rescaled| hits.iter().map(|hit| hit.scaled(at.factor)).collect();
        let resized: Vec<Vec<Hit>> = refined.iter().map(scaled).collect();
        let mut scorer =
            PoseScorer::new(hits, scan, params.score.unknown_fraction).comparing(targets.iter().copied());
        for (Rescaled { map_from_clip, factor }, hits) in refined.into_iter().zip(&resized) {
            let scale = scale * factor;
            scorer = scorer.with_hits(hits);
            let by_hits_m = params.score.weights.loss_m(&scorer.evidence(&map_from_clip, target));
            let loss_m = by_hits_m + shape.loss_of_scale_m(scale, hits.len());
            explanations.push(Explanation { scale, target: index, map_from_clip, loss_m });
        }
    }
    explanations
}

/// Returns the refined poses that differ, in their order.
fn distinct(refined: Vec<Rescaled>) -> Vec<Rescaled> {
    const SAME_M: f64 = 0.05;
    const SAME_RAD: f64 = 0.02;
    let mut kept: Vec<Rescaled> = Vec::new();
    for at in refined {
        let is_same = |known: &Rescaled| known.map_from_clip.is_within(&at.map_from_clip, SAME_M, SAME_RAD);
        if !kept.iter().any(is_same) {
            kept.push(at);
        }
    }
    kept
}
