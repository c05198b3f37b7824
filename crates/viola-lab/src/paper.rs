//! The paper's own stages 6-9, as the rows of the evaluation to compare with (paper III-B, III-C, IV-A):
//! rays from below every key camera, normalised cross-correlation of rasters at all rotations, many starts
//! refined by gradient descent on the one-directional Chamfer distance, the smallest loss wins.
//!
//! The constants are those of the authors' public implementation. Two of its faults are mended: the best
//! candidates survive and not the worst, and translations are compared with the translation threshold. The
//! third, that neither a robust kernel nor free space has a say, is what the method is, and stays.

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
use viola_align::{AlignError, Alignment, AlignmentState, Alternative, Observation, RaycastParams, Target};
use viola_geometry::progress::{self, Progress, Stage};
use viola_geometry::{Point2, Pose2, angle_between};
use viola_reconstruct::Reason;

/// How the starts are refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refiner {
    /// Adam on the mean distance of the hits to their nearest map points: the paper's choice.
    Chamfer,
    /// Point-to-point ICP: the paper's comparison.
    Icp,
}

/// The method's constants.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperParams {
    pub refiner: Refiner,
    /// Height at which the rays run, and the slab of points around it that they can hit.
    pub vacuum_height_m: f64,
    pub slab_m: f64,
    /// Points no higher than this are floor and no hits. The paper knows the floor by its labels.
    pub floor_m: f64,
    /// Rays of one camera, spread evenly over `fan_rad` about its heading; a ray ends at the nearest point
    /// within `cone_rad` of it.
    pub rays: usize,
    pub fan_rad: f64,
    pub cone_rad: f64,
    /// Points kept by farthest-point sampling.
    pub hits: usize,
    pub map_points: usize,
    /// Side of a raster cell, and of the square that a point fills, in cells.
    pub cell_m: f64,
    pub dilation: usize,
    pub rotations: usize,
    /// How far the box around the clip's hits may stick out of the box around the map's points.
    pub margin_m: f64,
    /// The best candidates that are refined. Two that are nearer to each other than this, and turned less
    /// than `apart_rad`, are one.
    pub starts: usize,
    pub apart_m: f64,
    pub apart_rad: f64,
    /// Adam: its steps, its rate in metres and radians, and the steps at which the rate is halved.
    pub steps: usize,
    pub rate: f64,
    pub halved_at: [usize; 3],
    /// ICP: its iterations at most.
    pub icp_iterations: usize,
    /// Two poses nearer to each other than both of these are close.
    pub close_m: f64,
    pub close_rad: f64,
    /// The clip is ambiguous when a pose that is not close to the best one loses by less than this in mean
    /// distance: the authors' c = 20 is the sum over 500 hits.
    pub margin_loss_m: f64,
}

impl Default for PaperParams {
    fn default() -> Self {
        PaperParams {
            refiner: Refiner::Chamfer,
            vacuum_height_m: RaycastParams::default().vacuum_height_m,
            slab_m: 0.10,
            floor_m: 0.05,
            rays: 300,
            fan_rad: std::f64::consts::PI,
            cone_rad: 3f64.to_radians(),
            hits: 500,
            map_points: 1800,
            cell_m: 0.01,
            dilation: 5,
            rotations: 360,
            margin_m: 1.0,
            starts: 200,
            apart_m: 0.2,
            apart_rad: 8f64.to_radians(),
            steps: 180,
            rate: 0.1,
            halved_at: [50, 100, 150],
            icp_iterations: 60,
            close_m: 0.3,
            close_rad: 20f64.to_radians(),
            margin_loss_m: 0.04,
        }
    }
}

/// A refined start.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Descended {
    map_from_clip: Pose2,
    /// Mean distance of the hits to their nearest map points.
    loss_m: f64,
}

/// Finds the pose of what a clip shows in a map, the paper's way. No target is a map without a point.
///
/// The answer has no covariance and no probability, because the method gives none.
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
    let hits_m = rays::cast(&observation.cloud_in_clip, &observation.scan.cameras, params);
    let hits_m = sample::farthest(&hits_m, params.hits);
    alignment.hits = hits_m.len();
    if hits_m.len() < 2 {
        let detail = "the clip shows nothing at the vacuum's height; point the camera lower";
        alignment.reasons.push(Reason::new("too_few_hits", detail));
        return Ok(alignment);
    }

    progress::begin(progress, Stage::Search)?;
    let map_m = sample::farthest(&target.points_m, params.map_points);
    let starts = correlate::correlate(&hits_m, &map_m, params, progress)?;

    progress::begin(progress, Stage::Refine)?;
    let nearest = Nearest::new(&map_m);
    let mut descended: Vec<Descended> = starts
        .par_iter()
        .map(|start: &Candidate| match params.refiner {
            Refiner::Chamfer => chamfer::descend(&start.map_from_clip, &hits_m, &nearest, params),
            Refiner::Icp => icp::iterate(&start.map_from_clip, &hits_m, &nearest, params.icp_iterations),
        })
        .collect();

    progress::begin(progress, Stage::Decide)?;
    // A stable sort keeps the order of the starts among equals.
    descended.sort_by(|a, b| a.loss_m.total_cmp(&b.loss_m));
    decide(&mut alignment, &descended, &hits_m, &nearest, params);
    if let Some(best) = alignment.map_from_clip {
        let placed: Vec<Point2> = hits_m.iter().map(|hit| best.apply(hit)).collect();
        let placed = Nearest::new(&placed);
        let covered = target.points_m.iter().filter(|p| placed.distance_m(p) < INLIER_M).count();
        alignment.coverage = Some(covered as f64 / target.points_m.len() as f64);
    }
    Ok(alignment)
}

/// A hit this near to the map has found its counterpart. For the report; the method does not ask.
const INLIER_M: f64 = 0.1;
/// Explanations that are listed.
const ALTERNATIVES: usize = 8;

/// The smallest loss wins; a pose that is not close to it and hardly worse makes the answer ambiguous.
fn decide(
    alignment: &mut Alignment,
    ranked: &[Descended],
    hits_m: &[Point2],
    nearest: &Nearest,
    params: &PaperParams,
) {
    let mut distinct: Vec<&Descended> = Vec::new();
    for pose in ranked {
        let is_known = distinct.iter().any(|known| {
            known.map_from_clip.distance_m(&pose.map_from_clip) < params.close_m
                && angle_between(known.map_from_clip.yaw_rad, pose.map_from_clip.yaw_rad) < params.close_rad
        });
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
        && second.loss_m - best.loss_m < params.margin_loss_m
    {
        alignment.state = AlignmentState::Ambiguous;
        let detail = format!(
            "another pose explains the clip as well to within {:.1} cm",
            100.0 * params.margin_loss_m
        );
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
                map_from_clip: pose.map_from_clip,
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
