//! The method: finds the pose of a clip in a LiDAR map.
//!
//! [`align_levels`] runs the stages of docs/method.md: `observe` (2 to 6), `register` (7 to 9), `complete` (10).
//! Everything here is a pure function of its arguments: the same clip, map, parameters and seed give the same answer
//! on any number of threads.

mod answer;
pub mod complete;
mod early;
mod maps;
mod observe;
mod refine;
mod register;
mod rooms;
mod scale;
mod scan;
mod score;
mod search;
mod target;
mod within;

pub use answer::{
    Alignment, AlignmentState, Alternative, AnswerSummary, BetterScale, CompletionReport, FreeSpace,
    ReferenceCamera, ViewReport,
};
pub use complete::{Activation, CompleteParams, Completion, completing, register_completing};
pub use maps::later_from_earlier;
pub use observe::{FloorHypothesis, Observation, Scale, observe};
pub use refine::{Refined, Spread, refine};
pub use register::register;
pub use rooms::NamedRooms;
pub use scale::observe_any_scale;
pub use scan::{FREE_CELL_M, HIT_SPACING_M, Hit, Landmark, RaycastParams, VACUUM_HEIGHT_M, VirtualScan};
pub use score::{
    Coefficient, CovarianceModel, Evidence, FEATURES, HitWeightParams, LossWeights, MIN_ALIGNED_PROBABILITY,
    MODEL, MadeBy, Model, PoseScorer, ScoreParams, TYPICAL_HITS, features, fraction_of_odds, is_different,
};
pub use search::{Candidate, Modes, SearchLimits, SearchParams};
pub use target::Target;

use std::ops::Range;
use viola_formats::clip::{Clip, ClipError};
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::{Cancelled, Progress};
use viola_geometry::{LevelName, Pose3};
use viola_reconstruct::{Feature, KeyFrame, LabelParams, PointCloud, ReconstructError, TrackParams, View};

/// Parameters of an alignment, stage by stage.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AlignParams {
    pub seed: u64,
    pub track: TrackParams,
    pub label: LabelParams,
    pub raycast: RaycastParams,
    pub hit_weights: HitWeightParams,
    pub search: SearchParams,
    pub score: ScoreParams,
    pub complete: CompleteParams,
}

/// An error that leaves no answer. A problem of the clip itself, such as no floor in sight, is an answer: an
/// [`Alignment`] in the state `failed`.
#[derive(Debug, thiserror::Error)]
pub enum AlignError {
    #[error("the work was cancelled")]
    Cancelled,
    #[error(transparent)]
    Clip(#[from] ClipError),
}

impl From<ReconstructError> for AlignError {
    fn from(error: ReconstructError) -> Self {
        match error {
            ReconstructError::Cancelled => AlignError::Cancelled,
            ReconstructError::Clip(error) => AlignError::Clip(error),
        }
    }
}

impl From<Cancelled> for AlignError {
    fn from(_: Cancelled) -> Self {
        AlignError::Cancelled
    }
}

/// The answer and the data that it was made from.
#[derive(Debug, Clone)]
pub struct Aligned {
    pub alignment: Alignment,
    /// In the clip frame; empty if the floor was not found.
    pub cloud_in_clip: PointCloud,
    pub scan: VirtualScan,
    /// Views of the key frames; empty if the floor was not found.
    pub views: Vec<View>,
    /// Places that other clips may recognise, in the clip frame; empty if the floor was not found.
    pub features: Vec<Feature>,
    /// The completed parts, if the clip was completed.
    pub completion: Option<Completion>,
}

/// The LiDAR map of one level of a home.
#[derive(Debug, Clone, Copy)]
pub struct LevelMap<'a> {
    pub level: LevelName,
    pub lidar: &'a LidarMap,
}

/// Finds the pose of a clip in the LiDAR map of a home with one level; see [`align_levels`].
pub fn align(
    clip: &Clip,
    frames: Option<Range<u32>>,
    lidar: &LidarMap,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Aligned, AlignError> {
    align_levels(clip, frames, &[LevelMap { level: LevelName::MAIN, lidar }], params, progress)
}

/// Finds the level and the pose of a clip in the LiDAR maps of a home. `frames` restricts the clip to frame
/// numbers of its layout. The order of the levels does not matter.
///
/// Fails only if cancelled or if the clip's pictures cannot be read; a clip that cannot be aligned returns an
/// answer with its reasons. The caller, which has a clock, sets the stage times of the answer.
pub fn align_levels(
    clip: &Clip,
    frames: Option<Range<u32>>,
    levels: &[LevelMap],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Aligned, AlignError> {
    let mut targets: Vec<Target> =
        levels.iter().filter_map(|map| Target::of_level(map.level, map.lidar)).collect();
    targets.sort_by_key(|target| target.level);
    let targets: Vec<&Target> = targets.iter().collect();
    let observation = if clip.info().metric {
        match observe::fuse(clip, frames, params, progress)? {
            Ok(fusion) => {
                early::report(&fusion, &targets, params, progress)?;
                fusion.observe(clip, params, progress)?
            }
            Err(reasons) => Observation { reasons, ..Observation::default() },
        }
    } else {
        observe_any_scale(&targets, clip, frames, params, progress)?
    };
    let (alignment, completion) = register_completing(&observation, &targets, params, progress)?;
    Ok(Aligned::new(observation, alignment, completion))
}

impl Aligned {
    fn new(observation: Observation, alignment: Alignment, completion: Option<Completion>) -> Aligned {
        let (scan, floor_offset_m) = observation.view_of(&alignment);
        let lower = Pose3::translation(0.0, 0.0, floor_offset_m);
        let views = observation.clip_from_world.map_or_else(Vec::new, |clip_from_world| {
            let view = |key: KeyFrame| View {
                clip_from_camera: lower * clip_from_world * key.world_from_camera,
                readings: key.readings,
            };
            observation.keys.into_iter().map(view).collect()
        });
        let features =
            observation.features.into_iter().map(|feature| feature.raised(floor_offset_m)).collect();
        Aligned {
            alignment,
            scan,
            cloud_in_clip: observation.cloud_in_clip.transformed(&lower),
            views,
            features,
            completion,
        }
    }
}
