//! The method: from a clip and a LiDAR map to the clip's pose in the map.
//!
//! [`align`] reads like the paper's overview, one line a stage. Everything here is a pure function of its
//! arguments: the same clip, map, parameters and seed give the same answer on any number of threads.

mod cloud;
mod decide;
mod evidence;
mod extract;
mod floor;
mod free;
mod fuse;
pub mod paper;
mod pyramid;
mod raycast;
mod refine;
mod search;
mod standing;
mod target;
mod tsdf;
mod weigh;

pub use cloud::{CloudPoint, PointCloud};
pub use decide::DecideParams;
pub use evidence::{Evidence, EvidenceParams};
pub use floor::{Floor, FloorParams, NoFloor, heading};
pub use fuse::{FuseParams, Fused, KeyFrame};
pub use raycast::{Hit, RaycastParams, VirtualScan};
pub use refine::{RefineParams, Refined};
pub use search::{Candidate, Modes, SearchParams};
pub use target::Target;
pub use tsdf::TsdfParams;
pub use weigh::{WeighParams, weigh};

use crate::clip::{Clip, ClipError};
use crate::geometry::Pose2;
use crate::lidar::LidarMap;
use crate::progress::{self, Cancelled, Progress, Stage};
use fuse::NotFused;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

/// How a clip is aligned, stage by stage.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AlignParams {
    pub seed: u64,
    pub fuse: FuseParams,
    pub floor: FloorParams,
    pub raycast: RaycastParams,
    pub weigh: WeighParams,
    pub search: SearchParams,
    pub refine: RefineParams,
    pub decide: DecideParams,
}

/// Why there is no answer at all. Everything that is known of the clip itself, such as that no floor is in
/// sight, is an answer: an [`Alignment`] in the state `failed`.
#[derive(Debug, thiserror::Error)]
pub enum AlignError {
    #[error("the work was cancelled")]
    Cancelled,
    #[error(transparent)]
    Clip(#[from] ClipError),
}

impl From<Cancelled> for AlignError {
    fn from(_: Cancelled) -> Self {
        AlignError::Cancelled
    }
}

/// The answer and what it was made from.
#[derive(Debug, Clone)]
pub struct Aligned {
    pub alignment: Alignment,
    /// In the clip frame; empty when the floor was not found.
    pub cloud_in_clip: PointCloud,
    pub scan: VirtualScan,
}

/// Finds the pose of a clip in a LiDAR map. `frames` restricts the clip to frame numbers of its layout.
///
/// Fails only when cancelled or when the clip's pictures cannot be read; a clip that cannot be aligned is
/// an answer with its reasons. The stage times of the answer are left to the caller, who has a clock.
pub fn align(
    clip: &Clip,
    frames: Option<Range<u32>>,
    lidar: &LidarMap,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Aligned, AlignError> {
    let observation = observe(clip, frames, params, progress)?;
    let target = Target::new(lidar);
    let alignment = register(&observation, target.as_ref(), params, progress)?;
    Ok(Aligned { alignment, cloud_in_clip: observation.cloud_in_clip, scan: observation.scan })
}

/// What a clip shows, before any map is looked at.
#[derive(Debug, Clone, Default)]
pub struct Observation {
    pub cloud_in_clip: PointCloud,
    pub scan: VirtualScan,
    pub key_frames: usize,
    pub floor: Option<FloorReport>,
    /// Remarks, and last the reason why there is no scan when `scan` is empty for one.
    pub reasons: Vec<Reason>,
}

/// Stages 1-6: from a clip to what the vacuum would see of it.
pub fn observe(
    clip: &Clip,
    frames: Option<Range<u32>>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Observation, AlignError> {
    progress::begin(progress, Stage::Fuse)?;
    let fused = match fuse::fuse(clip, frames, &params.fuse, progress)? {
        Ok(fused) => fused,
        Err(NotFused::NoPosedFrame) => {
            let reason = Reason::new(
                "no_posed_frame",
                "no frame in the range has a camera pose; record with an app that stores device poses",
            );
            return Ok(Observation { reasons: vec![reason], ..Observation::default() });
        }
    };
    let mut observation = Observation {
        key_frames: fused.key_frames.len(),
        reasons: fused.remarks(),
        ..Observation::default()
    };

    progress::begin(progress, Stage::Floor)?;
    let Fused { cloud_in_world, key_frames, .. } = fused;
    let floor =
        floor::find_floor(&cloud_in_world, &key_frames, clip.up_in_world(), &params.floor, params.seed);
    let floor = match floor {
        Ok(floor) => floor,
        Err(why) => {
            observation.reasons.push(why.reason());
            return Ok(observation);
        }
    };
    observation.floor = Some(floor.report());
    observation.cloud_in_clip = cloud_in_world.transformed(&floor.clip_from_world);

    progress::begin(progress, Stage::Raycast)?;
    observation.scan =
        raycast::raycast(&observation.cloud_in_clip, &key_frames, &floor.clip_from_world, &params.raycast);
    Ok(observation)
}

/// Stages 7-9: from what the vacuum would see to a ranked answer. No target is a map without a point.
pub fn register(
    observation: &Observation,
    target: Option<&Target>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Alignment, AlignError> {
    let scan = &observation.scan;
    let mut alignment = Alignment {
        hits: scan.hits.len(),
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
    let hits = weigh::weigh(&scan.hits, &params.weigh);
    if hits.len() < MIN_HITS {
        let detail = format!(
            "the clip shows {} standing points on walls and furniture and {MIN_HITS} are needed; film more of the room, and its lower half",
            hits.len(),
        );
        alignment.reasons.push(Reason::new("too_few_hits", detail));
        return Ok(alignment);
    }

    progress::begin(progress, Stage::Search)?;
    let found = search::search(&hits, target, &params.search, progress)?;

    progress::begin(progress, Stage::Refine)?;
    let starts: Vec<Pose2> = found.modes.iter().map(|mode| mode.map_from_clip).collect();
    let refined = refine::refine(&starts, &hits, target, &params.refine);

    progress::begin(progress, Stage::Decide)?;
    let decision = decide::decide(&refined, &hits, scan, target, &params.decide);

    alignment.state = decision.state;
    alignment.reasons.extend(decision.reasons);
    alignment.coverage = Some(decision.coverage);
    if let Some(best) = decision.ranked.first() {
        if decision.state != AlignmentState::Failed {
            alignment.map_from_clip = Some(best.alternative.map_from_clip);
            alignment.covariance = Some(best.covariance.into());
        }
        alignment.loss_m = Some(best.alternative.loss_m);
        alignment.inliers = Some(best.alternative.inliers);
    }
    alignment.alternatives = decision.ranked.into_iter().map(|r| r.alternative).collect();
    Ok(alignment)
}

/// Fewer hits than this say nothing: a metre of wall.
const MIN_HITS: usize = 30;

/// The verdict on a clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlignmentState {
    /// One pose stands out.
    Aligned,
    /// Several poses that are not close to each other explain the clip about equally well.
    Ambiguous,
    /// No pose can be given; the reasons say why.
    Failed,
}

/// A machine-readable reason for a verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Reason {
    /// Stable, in snake case, for programs: `two_modes`, `too_few_hits`, `no_floor` ...
    pub code: String,
    /// For people.
    pub detail: String,
}

/// One explanation of the clip, the best first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Alternative {
    pub map_from_clip: Pose2,
    /// Mean robust distance of the hits to the map plus the free-space penalty, in metres: what ranks them.
    pub loss_m: f64,
    /// Share of the hits within 0.1 m of the map, 0..1.
    pub inliers: f64,
    /// What free space says against the pose; null where the method does not look at it.
    pub free_space: Option<FreeSpace>,
    /// Posterior probability, null until it is calibrated.
    pub probability: Option<f64>,
}

/// Contradictions between what one side saw free and the other side has standing there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct FreeSpace {
    /// Share of the clip's rays that run through walls of the map, 0..1.
    pub blocked_rays: f64,
    /// Share of the hits that stand where the robot saw free floor, 0..1.
    pub hits_on_floor: f64,
    /// Share of the map's walls that stand where the clip saw free floor, among those it speaks about, 0..1.
    pub walls_on_floor: f64,
}

/// The answer for one clip: `result.json` of `viola align`, and `alignment` of a clip over HTTP.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Alignment {
    pub state: AlignmentState,
    /// That the pose is right; null until it is calibrated.
    pub probability: Option<f64>,
    /// Null when the state is `failed`.
    pub map_from_clip: Option<Pose2>,
    /// Of (x_m, y_m, yaw_rad), row after row: square metres, metre radians, square radians.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// That of the best alternative.
    pub loss_m: Option<f64>,
    pub inliers: Option<f64>,
    /// Share of the LiDAR map's points that the clip's hits explain, 0..1 (the paper's coverage).
    pub coverage: Option<f64>,
    /// The ranked explanations, the chosen one first.
    pub alternatives: Vec<Alternative>,
    pub reasons: Vec<Reason>,
    pub hits: usize,
    pub key_frames: usize,
    pub floor: Option<FloorReport>,
    /// Time of each stage. The only part that differs from run to run.
    pub seconds: BTreeMap<String, f64>,
}

/// What was found of the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct FloorReport {
    /// Height of the first camera above it, in metres.
    pub camera_height_m: f64,
    /// Fused points within 2 cm of the plane.
    pub support_points: usize,
    /// Angle to the capture's gravity in degrees, when the capture knows gravity.
    pub gravity_angle_deg: Option<f64>,
}

impl Reason {
    pub fn new(code: &str, detail: impl Into<String>) -> Reason {
        Reason { code: code.to_owned(), detail: detail.into() }
    }
}

impl Alignment {
    /// No pose, and nothing known.
    fn failed() -> Alignment {
        Alignment {
            state: AlignmentState::Failed,
            probability: None,
            map_from_clip: None,
            covariance: None,
            loss_m: None,
            inliers: None,
            coverage: None,
            alternatives: Vec::new(),
            reasons: Vec::new(),
            hits: 0,
            key_frames: 0,
            floor: None,
            seconds: BTreeMap::new(),
        }
    }
}
