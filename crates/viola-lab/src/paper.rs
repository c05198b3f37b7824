//! The paper's own stages 6-9, as a baseline of the evaluation (paper III-B, III-C, IV-A): rays from below
//! every key camera, normalised cross-correlation of rasters at all rotations, many starts refined by
//! gradient descent on the one-directional Chamfer distance; the smallest loss wins.
//! The constants are those of the authors' public implementation. Two of its faults are fixed: the best
//! candidates survive instead of the worst, and translations are compared with the translation threshold. The
//! third, no robust kernel and no free space, is part of the method and stays.

mod chamfer;
mod correlate;
mod fft2;
mod icp;
mod nearest;
mod rays;
mod sample;

pub use nearest::Nearest;
use rayon::prelude::*;
use viola_align::Candidate;
use viola_align::{AlignError, Alignment, AlignmentState, Alternative, Observation, Target};
use viola_geometry::progress::{self, Progress, Stage};
use viola_geometry::{LevelName, Point2, Pose2};
use viola_reconstruct::Reason;

const MAP_POINTS: usize = 1800;
/// Maximum ICP iterations.
const ICP_ITERATIONS: usize = 60;
/// Two poses are close if they differ by less than both of these.
const CLOSE_M: f64 = 0.3;
const CLOSE_RAD: f64 = 20f64.to_radians();
/// The clip is ambiguous if a pose that is not close to the best one has a mean distance larger by less than
/// this: the authors' c = 20 is the sum over 500 hits.
pub const MARGIN_LOSS_M: f64 = 0.04;

/// Refinement of the starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refiner {
    /// Adam on the mean distance of the hits to their nearest map points: the paper's choice.
    Chamfer,
    /// Point-to-point ICP: the paper's comparison.
    Icp,
}

/// Parameters of the method.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperParams {
    pub refiner: Refiner,
    /// Hits kept by farthest-point sampling.
    pub hits: usize,
    /// Side of a raster cell.
    pub cell_m: f64,
    pub rotations: usize,
    /// Maximum distance that the clip's bounding box may extend beyond the map's.
    pub margin_m: f64,
}

impl Default for PaperParams {
    fn default() -> Self {
        PaperParams { refiner: Refiner::Chamfer, hits: 500, cell_m: 0.01, rotations: 360, margin_m: 1.0 }
    }
}

/// A refined start.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Descended {
    map_from_clip: Pose2,
    /// Mean distance of the hits to their nearest map points.
    loss_m: f64,
}

/// Registers a clip to a map by the paper's method. No `target` means a map without points.
///
/// The answer has neither covariance nor probability: the method provides none.
pub fn register(
    observation: &Observation,
    target: Option<&Target>,
    params: &PaperParams,
    progress: &dyn Progress,
) -> Result<Alignment, AlignError> {
    let mut alignment = Alignment {
        key_frames: observation.key_frames,
        floor: observation.floor.clone(),
        reasons: observation.reasons.clone(),
        ..Alignment::failed()
    };
    let Some(target) = target else {
        alignment.reasons.push(Reason::new("map_empty", "the LiDAR map has no occupied point"));
        return Ok(alignment);
    };
    if observation.floor.is_none() {
        return Ok(alignment);
    }

    progress::begin(progress, Stage::Raycast)?;
    let hits_m = rays::cast(&observation.cloud_in_clip, &observation.scan.cameras);
    let hits_m = sample::farthest(&hits_m, params.hits);
    alignment.hits = hits_m.len();
    if hits_m.len() < 2 {
        let detail = "the clip shows nothing at the vacuum's height; point the camera lower";
        alignment.reasons.push(Reason::new("too_few_hits", detail));
        return Ok(alignment);
    }

    progress::begin(progress, Stage::Search)?;
    let map_m = sample::farthest(&target.points_m, MAP_POINTS);
    let starts = correlate::correlate(&hits_m, &map_m, params, progress)?;

    progress::begin(progress, Stage::Refine)?;
    let nearest = Nearest::new(&map_m);
    let mut descended: Vec<Descended> = starts
        .par_iter()
        .map(|start: &Candidate| match params.refiner {
            Refiner::Chamfer => chamfer::descend(&start.map_from_clip, &hits_m, &nearest),
            Refiner::Icp => icp::iterate(&start.map_from_clip, &hits_m, &nearest, ICP_ITERATIONS),
        })
        .collect();

    progress::begin(progress, Stage::Decide)?;
    // A stable sort: ties keep the order of the starts.
    descended.sort_by(|a, b| a.loss_m.total_cmp(&b.loss_m));
    decide(&mut alignment, &descended, &hits_m, &nearest);
    if let Some(best) = alignment.map_from_clip {
        let placed: Vec<Point2> = hits_m.iter().map(|hit| best.apply(hit)).collect();
        alignment.coverage = Some(covered(target, &placed));
    }
    Ok(alignment)
}

/// Maximum distance of an inlier, for the report only.
const INLIER_M: f64 = 0.1;

/// Returns the fraction of a map's points with a hit within [`INLIER_M`].
pub(crate) fn covered(target: &Target, hits_m: &[Point2]) -> f64 {
    let hits = Nearest::new(hits_m);
    let count = target.points_m.iter().filter(|point| hits.distance_m(point) < INLIER_M).count();
    count as f64 / target.points_m.len() as f64
}

/// Maximum number of alternatives.
const ALTERNATIVES: usize = 8;

/// Selects the pose with the smallest loss; ambiguous if a distinct pose is within the margin.
fn decide(alignment: &mut Alignment, ranked: &[Descended], hits_m: &[Point2], nearest: &Nearest) {
    let mut distinct: Vec<&Descended> = Vec::new();
    for pose in ranked {
        let is_close =
            |known: &&Descended| known.map_from_clip.is_within(&pose.map_from_clip, CLOSE_M, CLOSE_RAD);
        let is_known = distinct.iter().any(is_close);
        if !is_known {
            distinct.push(pose);
            if distinct.len() == ALTERNATIVES {
                break;
            }
        }
    }
    let Some(best) = distinct.first() else {
        let detail = "the correlation found no place in the map where the clip could lie";
        alignment.reasons.push(Reason::new("no_candidate", detail));
        return;
    };
    alignment.state = AlignmentState::Aligned;
    if let Some(second) = distinct.get(1)
        && second.loss_m - best.loss_m < MARGIN_LOSS_M
    {
        alignment.state = AlignmentState::Ambiguous;
        let detail =
            format!("another pose explains the clip as well to within {:.1} cm", 100.0 * MARGIN_LOSS_M);
        alignment.reasons.push(Reason::new("several_modes", detail));
    }
    alignment.map_from_clip = Some(best.map_from_clip);
    alignment.loss_m = Some(best.loss_m);
    alignment.alternatives = distinct
        .iter()
        .map(|pose| {
            let near = hits_m
                .iter()
                .filter(|hit| nearest.distance_m(&pose.map_from_clip.apply(hit)) < INLIER_M)
                .count();
            Alternative {
                level: LevelName::MAIN,
                map_from_clip: pose.map_from_clip,
                rise_m: 0.0,
                loss_m: pose.loss_m,
                inliers: near as f64 / hits_m.len() as f64,
                free_space: None,
                misplaced: None,
                probability: None,
                evidence: None,
            }
        })
        .collect();
    alignment.inliers = alignment.alternatives.first().map(|best| best.inliers);
}
