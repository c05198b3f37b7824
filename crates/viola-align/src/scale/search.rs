//! The search over poses at all scales, best first by the usual loss of a score.
//!
//! The searches of all scales end at one loss, so a scale that cannot hold a good explanation costs little.

use super::shape::{Effort, Shape};
use crate::register::MIN_HITS;
use crate::scan::{Hit, MAX_HITS, VirtualScan};
use crate::score;
use crate::search::{Likelihood, Modes, Search, SearchParams, reach_m};
use crate::{AlignError, AlignParams, Target};
use rayon::prelude::*;
use std::sync::Arc;
use viola_geometry::Pose2;
use viola_geometry::progress::{self, Progress};

/// Usual loss by the hits of a pose with score 0; with score 1 it is 0.
const LOSS_OF_SCORE_M: f64 = 0.14;
/// Modes whose usual loss exceeds the least one by more are not refined.
const MARGIN_M: f64 = 0.015;
/// All scales are searched down to one loss, which rises by this.
const ROUND_M: f64 = 0.004;
/// Scales that put the camera below this height are searched last, and only if their own loss is small enough: their
/// scans are costly, and their explanations rarely good.
const LOW_CAMERA_M: f64 = 0.9;

/// A scale of the grid, its scan, and the modes in each map.
pub(super) struct Searched {
    /// In metres per nominal metre.
    pub scale: f64,
    pub scan: VirtualScan,
    /// The scan's hits with their weights.
    pub hits: Vec<Hit>,
    /// The modes worth refining, by map.
    pub modes: Vec<Vec<Pose2>>,
    /// True if no search ended at its budget before the best mode.
    pub complete: bool,
}

/// Searches the maps at all scales; returns the scales with at least [`MIN_HITS`] hits.
pub(super) fn search(
    shape: &Shape,
    scales: &[f64],
    targets: &[&Target],
    effort: &Effort,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Vec<Searched>, AlignError> {
    let search = SearchParams {
        rotations: (params.search.rotations as f64 * effort.rotations) as usize,
        first: effort.limits,
        resumed: effort.limits,
        max_nodes: effort.max_nodes,
        ..params.search.clone()
    };
    let (low, usual): (Vec<f64>, Vec<f64>) =
        scales.iter().partition(|scale| *scale * shape.camera_height < LOW_CAMERA_M);
    let mut searches = start(shape, &usual, targets, &search, params, progress)?;
    let mut least_m = deepen(&mut searches, f64::INFINITY, progress)?;
    let may_be_good = |scale: &f64| shape.loss_of_scale_m(*scale, MAX_HITS) <= least_m + MARGIN_M;
    let low: Vec<f64> = low.into_iter().filter(may_be_good).collect();
    let mut of_low = start(shape, &low, targets, &search, params, progress)?;
    least_m = deepen(&mut of_low, least_m, progress)?;
    searches.extend(of_low);
    let finish = |search: ScaleSearch| search.finish(least_m + MARGIN_M, effort.limits.modes, progress);
    searches.into_par_iter().map(finish).collect()
}

/// A scale of the grid and its searches, one for each map.
struct ScaleSearch<'a> {
    scale: f64,
    scan: VirtualScan,
    hits: Vec<Hit>,
    loss_of_scale_m: f64,
    searches: Vec<Search<'a>>,
}

/// Casts the rays at each scale and starts the searches.
fn start<'a>(
    shape: &Shape,
    scales: &[f64],
    targets: &[&Target],
    search: &'a SearchParams,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Vec<ScaleSearch<'a>>, AlignError> {
    let cast = |&scale: &f64| {
        progress::check(progress)?;
        let scan = shape.scan_of_some(scale, &params.raycast);
        let hits = score::hit_weights(&scan.hits, &params.hit_weights);
        let loss_of_scale_m = shape.loss_of_scale_m(scale, hits.len());
        Ok(ScaleSearch { scale, scan, hits, loss_of_scale_m, searches: Vec::new() })
    };
    let mut started: Vec<ScaleSearch> = scales.par_iter().map(cast).collect::<Result<_, AlignError>>()?;
    started.retain(|at| at.hits.len() >= MIN_HITS);
    let reach_m = started.iter().map(|at| reach_m(&at.hits)).fold(0.0, f64::max);
    let likelihood = |target: &&Target| Arc::new(Likelihood::new(target, reach_m, search));
    let likelihoods: Vec<Arc<Likelihood>> = targets.iter().map(likelihood).collect();
    started.par_iter_mut().for_each(|at| {
        let start = |likelihood: &Arc<Likelihood>| Search::sharing(likelihood, &at.hits, search);
        at.searches = likelihoods.iter().map(start).collect();
    });
    Ok(started)
}

/// Resumes all searches, round by round, until the least usual loss is proven. Returns it, or `known_m` if that is less.
/// Infinite without any search.
fn deepen(searches: &mut [ScaleSearch], known_m: f64, progress: &dyn Progress) -> Result<f64, AlignError> {
    let mut until_m = 0f64;
    loop {
        let least_m = searches.iter().map(ScaleSearch::known_m).fold(known_m, f64::min);
        if !least_m.is_finite() {
            return Ok(least_m);
        }
        let round = |at: &mut ScaleSearch| at.resume(until_m.min(least_m), least_m + MARGIN_M, 1, progress);
        searches.par_iter_mut().try_for_each(|at| round(at).map(drop))?;
        if until_m >= least_m {
            return Ok(searches.iter().map(ScaleSearch::known_m).fold(least_m, f64::min));
        }
        until_m += ROUND_M;
    }
}

impl ScaleSearch<'_> {
    fn usual_loss_m(&self, score: f64) -> f64 {
        LOSS_OF_SCORE_M * (1.0 - score) + self.loss_of_scale_m
    }

    /// Returns the score with this usual loss.
    fn score(&self, usual_loss_m: f64) -> f64 {
        1.0 - (usual_loss_m - self.loss_of_scale_m) / LOSS_OF_SCORE_M
    }

    /// Returns the usual loss of the best known pose.
    fn known_m(&self) -> f64 {
        let score = self.searches.iter().map(Search::known_score).fold(0.0, f64::max);
        self.usual_loss_m(score)
    }

    /// Resumes the searches down to `until_m`, or until they have `modes`; drops the poses beyond `most_m`.
    fn resume(
        &mut self,
        until_m: f64,
        most_m: f64,
        modes: usize,
        progress: &dyn Progress,
    ) -> Result<Vec<Modes>, AlignError> {
        let (until, least) = (self.score(until_m), self.score(most_m));
        let resume = |search: &mut Search| {
            search.drop_below(least);
            search.run_down_to(until, modes, progress)
        };
        self.searches.iter_mut().map(resume).collect()
    }

    fn finish(mut self, most_m: f64, modes: usize, progress: &dyn Progress) -> Result<Searched, AlignError> {
        let found = self.resume(most_m, most_m, modes, progress)?;
        let is_optimum_known =
            |found: &Modes| found.modes.first().is_none_or(|best| best.score >= found.open_bound);
        let complete = found.iter().all(|found| found.complete || is_optimum_known(found));
        let good = |found: &Modes| -> Vec<Pose2> {
            let is_good = |score: f64| self.usual_loss_m(score) <= most_m;
            found.modes.iter().filter(|mode| is_good(mode.score)).map(|mode| mode.map_from_clip).collect()
        };
        let modes = found.iter().map(good).collect();
        Ok(Searched { scale: self.scale, scan: self.scan, hits: self.hits, modes, complete })
    }
}

#[cfg(test)]
mod tests {
    use super::super::shape::FIRST;
    use super::*;
    use crate::complete::View;
    use crate::scan;
    use viola_formats::clip::DepthImage;
    use viola_geometry::progress::Silent;
    use viola_geometry::{Pinhole, Point2, Pose3};
    use viola_reconstruct::{CloudPoint, KeyFrame, PointCloud, Readings};

    #[test]
    fn a_clip_of_the_floor_alone_is_searched_at_no_scale() {
        let floor =
            |i: i32| CloudPoint::new([0.1 * (i % 20) as f32, 0.1 * (i / 20) as f32, 0.0], [0.0, 0.0, 1.0]);
        let cloud = PointCloud { points: (0..400).map(floor).collect(), voxel_m: 0.03 };
        let camera = Pinhole { width: 96, height: 72, fx: 80.0, fy: 80.0, cx: 47.5, cy: 35.5 };
        let depth = DepthImage { width: 96, height: 72, depth_m: vec![1.5; 96 * 72] };
        let view = View { eye_m: [0.0, 0.0, 1.4], yaw_rad: 0.0, pitch_rad: 1.2 };
        let shape = Shape {
            cloud_in_clip: scan::upright(cloud),
            keys: vec![KeyFrame::first(view.clip_from_camera(), Readings::thin(&depth, camera))],
            clip_from_world: Pose3::identity(),
            camera_height: 1.4,
        };
        let wall = (0..40).map(|i| Point2::new(0.1 * f64::from(i), 2.0)).collect();
        let (target, params) = (Target::from_points(wall, None, None).unwrap(), AlignParams::default());
        let (scales, _) = shape.grid(&FIRST, &params);
        let searched = search(&shape, &scales, &[&target], &FIRST, &params, &Silent).unwrap();
        assert!(scales.len() > 10 && searched.is_empty());
    }
}
