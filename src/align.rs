//! The method: from a clip and a LiDAR map to the clip's pose in the map.
//!
//! [`align`] reads like the paper's overview, one line a stage. Everything here is a pure function of its
//! arguments: the same clip, map, parameters and seed give the same answer on any number of threads.

mod answer;
mod cloud;
pub mod complete;
mod decide;
mod estimate;
mod evidence;
mod extract;
mod floor;
mod free;
mod fuse;
pub mod label;
mod observe;
pub mod paper;
mod posterior;
mod pyramid;
mod raycast;
mod refine;
mod register;
mod rooms;
mod search;
mod space;
mod standing;
mod target;
mod things;
pub mod track;
mod tsdf;
mod weigh;

pub use answer::{Alignment, AlignmentState, Alternative, FloorReport, FreeSpace, Reason};
pub use cloud::{CloudPoint, PointCloud};
pub use complete::{Activation, CompleteParams, Completion, CompletionReport, register_completing};
pub use decide::DecideParams;
pub use estimate::{Estimate, estimate};
pub use evidence::{Evidence, EvidenceParams};
pub use floor::{Floor, FloorParams, NoFloor, heading};
pub use fuse::{FuseParams, Fused, KeyFrame, Readings, View};
pub use label::{Label, LabelParams, LabelReport};
pub use observe::{Observation, Rival, observe};
pub use posterior::{Coefficient, FEATURES, Posterior, features};
pub use raycast::{Hit, RaycastParams, VirtualScan};
pub use refine::{RefineParams, Refined, refine};
pub use register::register;
pub use rooms::NamedRooms;
pub use search::{Candidate, Modes, Reach, SearchParams};
pub use target::Target;
pub use things::Thing;
pub use track::TrackParams;
pub use tsdf::TsdfParams;
pub use weigh::{WeighParams, weigh};

use crate::clip::{Clip, ClipError};
use crate::geometry::Pose3;
use crate::lidar::LidarMap;
use crate::progress::{Cancelled, Progress};
use std::ops::Range;

/// How a clip is aligned, stage by stage.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AlignParams {
    pub seed: u64,
    pub track: TrackParams,
    pub fuse: FuseParams,
    pub label: LabelParams,
    pub floor: FloorParams,
    pub raycast: RaycastParams,
    pub weigh: WeighParams,
    pub search: SearchParams,
    pub refine: RefineParams,
    pub decide: DecideParams,
    pub complete: CompleteParams,
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
    /// What the key frames saw; empty when the floor was not found.
    pub views: Vec<View>,
    /// What was filled in, where it was.
    pub completion: Option<Completion>,
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
    let (mut alignment, completion) = register_completing(&observation, target.as_ref(), params, progress)?;
    track::doubt(&mut alignment);
    let (scan, sunk_m) = observation.view_of(&alignment);
    let lower = Pose3::translation(0.0, 0.0, sunk_m);
    let views = observation.clip_from_world.map_or_else(Vec::new, |clip_from_world| {
        let view = |key: KeyFrame| View {
            clip_from_camera: lower * clip_from_world * key.world_from_camera,
            readings: key.readings,
        };
        observation.keys.into_iter().map(view).collect()
    });
    Ok(Aligned {
        alignment,
        scan,
        cloud_in_clip: observation.cloud_in_clip.transformed(&lower),
        views,
        completion,
    })
}
