//! Stage 10: what the clip did not see at the vacuum's height is filled in, marked as such, and the clip is
//! registered again (paper III-D).
//!
//! Structure comes first: walls go down to the floor and on to each other. Imagination comes behind it, for
//! those who installed the networks: pictures from virtual cameras are completed and fused.

pub mod inpaint;
pub mod monocular;
mod structure;

pub use structure::StructureCompletion;

use super::observe::Observation;
use super::raycast::{self, RaycastParams, VirtualScan};
use super::register::register;
use super::{AlignError, AlignParams, Alignment, AlignmentState, PointCloud, Target};
use crate::geometry::{Pose2, angle_between};
use crate::progress::{self, Progress, Stage};
use serde::{Deserialize, Serialize};

/// How clips are completed.
#[derive(Debug, Clone, PartialEq)]
pub struct CompleteParams {
    pub when: Activation,
    /// None: walls end where they were last seen.
    pub structure: Option<StructureCompletion>,
}

/// Which clips are completed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Activation {
    Never,
    /// Two poses that are not close have losses within `margin_m` of each other (paper IV-A).
    SeveralMinima {
        margin_m: f64,
    },
    /// The clip is not called aligned.
    Unsure,
    Always,
}

impl Default for CompleteParams {
    fn default() -> Self {
        CompleteParams { when: Activation::Unsure, structure: Some(StructureCompletion::default()) }
    }
}

/// What was filled in, apart from what was seen: it never becomes part of a home's map.
#[derive(Debug, Clone)]
pub struct Completion {
    pub cloud_in_clip: PointCloud,
    /// What the vacuum would see with it.
    pub scan: VirtualScan,
}

/// What an answer tells of its completion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct CompletionReport {
    /// Points that continue walls.
    pub structure_points: usize,
    /// Hits at the vacuum's height that were filled in.
    pub hits: usize,
    /// Whether the answer is the one with what was filled in.
    pub taken: bool,
    pub before: Judged,
    pub after: Judged,
}

/// An answer in short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Judged {
    pub state: AlignmentState,
    pub probability: Option<f64>,
    pub map_from_clip: Option<Pose2>,
}

impl Judged {
    fn of(alignment: &Alignment) -> Judged {
        Judged {
            state: alignment.state,
            probability: alignment.probability,
            map_from_clip: alignment.map_from_clip,
        }
    }
}

/// Registers an observation, and once more with what can be filled in where the first answer leaves doubt.
pub fn register_completing(
    observation: &Observation,
    target: Option<&Target>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<(Alignment, Option<Completion>), AlignError> {
    let before = register(observation, target, params, progress)?;
    if !params.complete.when.applies(&before) {
        return Ok((before, None));
    }
    progress::begin(progress, Stage::Complete)?;
    let Some((settled, completion)) = fill(observation, &before, params) else { return Ok((before, None)) };
    let completed = Observation { scan: completion.scan.clone(), rivals: Vec::new(), ..settled };
    let after = register(&completed, target, params, &Within(progress))?;
    let taken = better(&before, &after);
    let report = CompletionReport {
        structure_points: completion.cloud_in_clip.points.len(),
        hits: completion.scan.hits.iter().filter(|hit| hit.completed).count(),
        taken,
        before: Judged::of(&before),
        after: Judged::of(&after),
    };
    let chosen = if taken { after } else { before };
    Ok((Alignment { completion: Some(report), ..chosen }, Some(completion)))
}

/// The work goes on within the stage that it is in.
struct Within<'a>(&'a dyn Progress);

impl Progress for Within<'_> {
    fn enter(&self, _stage: Stage) {}

    fn advance(&self, _fraction: f64) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// What is filled in, and the observation above the floor that `before` chose; none where there is nothing to
/// fill in.
fn fill(
    observation: &Observation,
    before: &Alignment,
    params: &AlignParams,
) -> Option<(Observation, Completion)> {
    let settled = observation.settled(before)?;
    let clip_from_world = settled.clip_from_world?;
    let voxel_m = settled.cloud_in_clip.voxel_m;
    let cloud_in_clip = match &params.complete.structure {
        Some(structure) => {
            structure::extend(&settled.walls, &settled.keys, &clip_from_world, voxel_m, structure)
        }
        None => PointCloud { points: Vec::new(), voxel_m },
    };
    if cloud_in_clip.points.is_empty() {
        return None;
    }
    let raycast = RaycastParams { floor_m: 0.0, ..params.raycast.clone() };
    let scan = raycast::recast(&settled.scan, &settled.cloud_in_clip, &cloud_in_clip, &raycast);
    Some((settled, Completion { cloud_in_clip, scan }))
}

/// Whether the answer with what was filled in is to be preferred.
fn better(before: &Alignment, after: &Alignment) -> bool {
    after.map_from_clip.is_some() && after.probability.unwrap_or(0.0) >= before.probability.unwrap_or(0.0)
}

impl Activation {
    fn applies(self, answer: &Alignment) -> bool {
        match self {
            Activation::Never => false,
            Activation::Always => true,
            Activation::Unsure => answer.state != AlignmentState::Aligned,
            Activation::SeveralMinima { margin_m } => several_minima(answer, margin_m),
        }
    }
}

/// Whether a pose that is not close to the best one explains the clip nearly as well.
fn several_minima(answer: &Alignment, margin_m: f64) -> bool {
    const CLOSE_M: f64 = 0.3;
    const CLOSE_RAD: f64 = 20.0 / 180.0 * std::f64::consts::PI;
    let Some(best) = answer.alternatives.first() else { return true };
    answer.alternatives[1..].iter().any(|other| {
        let (a, b) = (&best.map_from_clip, &other.map_from_clip);
        let close = a.distance_m(b) < CLOSE_M && angle_between(a.yaw_rad, b.yaw_rad) < CLOSE_RAD;
        !close && other.loss_m - best.loss_m < margin_m
    })
}
