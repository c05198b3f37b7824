//! Progress and cancellation of long work, independent of clocks and channels.

use crate::{LevelName, Pose2};
use serde::{Deserialize, Serialize};

/// The stages of aligning one clip, in the order in which they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Open the container and read the poses and the intrinsics.
    Decode,
    /// Follow the camera of a clip without poses, or refine poses that drift.
    Track,
    /// Decode the key frames and fuse them into a signed distance map.
    Fuse,
    /// Label the surface by pictures, shapes and networks.
    Label,
    /// Find the floor plane.
    Floor,
    /// Cast rays at the vacuum's height.
    Raycast,
    /// Search the whole map for candidate poses.
    Search,
    /// Refine all candidates at once.
    Refine,
    /// Compare the candidates and compute the confidence of the best one.
    Decide,
    /// Complete the unseen parts of the clip; then search, refine and decide run again.
    Complete,
    /// Write pictures and clouds.
    Report,
}

impl Stage {
    pub const ALL: [Stage; 11] = [
        Stage::Decode,
        Stage::Track,
        Stage::Fuse,
        Stage::Label,
        Stage::Floor,
        Stage::Raycast,
        Stage::Search,
        Stage::Refine,
        Stage::Decide,
        Stage::Complete,
        Stage::Report,
    ];

    /// Returns the name in results, logs and events.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Decode => "decode",
            Stage::Track => "track",
            Stage::Fuse => "fuse",
            Stage::Label => "label",
            Stage::Floor => "floor",
            Stage::Raycast => "raycast",
            Stage::Search => "search",
            Stage::Refine => "refine",
            Stage::Decide => "decide",
            Stage::Complete => "complete",
            Stage::Report => "report",
        }
    }

    /// Returns the start and end of this stage as fractions of the whole job. They are typical times, so
    /// a progress bar moves evenly; nothing else depends on them.
    pub fn span(self) -> (f64, f64) {
        match self {
            Stage::Decode => (0.0, 0.03),
            Stage::Track => (0.03, 0.20),
            Stage::Fuse => (0.20, 0.35),
            Stage::Label => (0.35, 0.70),
            Stage::Floor => (0.70, 0.74),
            Stage::Raycast => (0.74, 0.77),
            Stage::Search => (0.77, 0.86),
            Stage::Refine => (0.86, 0.88),
            Stage::Decide => (0.88, 0.89),
            Stage::Complete => (0.89, 0.96),
            Stage::Report => (0.96, 1.0),
        }
    }

    /// Converts a fraction of this stage to a fraction of the whole job.
    pub fn overall(self, fraction: f64) -> f64 {
        let (from, to) = self.span();
        from + (to - from) * fraction.clamp(0.0, 1.0)
    }
}

/// A pose that is known before the answer. The answer, which also uses the labels of pictures, may differ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EarlyPose {
    /// The level in whose LiDAR map the pose is.
    #[serde(default)]
    pub level: LevelName,
    pub map_from_clip: Pose2,
    /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1.
    pub probability: f64,
}

/// Receives the progress of the method. Worker threads call it, so it must be quick. A receiver around another one names
/// each call that it forwards: the others are ignored.
pub trait Progress: Sync {
    /// Reports the start of a stage.
    fn enter(&self, _stage: Stage) {}
    /// Reports that `fraction` (0..1) of the current stage is done.
    fn advance(&self, _fraction: f64) {}
    /// Returns whether a stop was requested. Stages poll this often and end with [`Cancelled`].
    fn cancelled(&self) -> bool;
    /// Returns whether the current stage's time budget is used up; the stage then keeps its results so far.
    /// Only stages with a documented budget poll this.
    fn out_of_time(&self) -> bool {
        false
    }
    /// Returns whether a pose before the answer is wanted; it costs a second registration.
    fn wants_early_pose(&self) -> bool {
        false
    }
    /// Reports a pose before the answer, at most once.
    fn early_pose(&self, _pose: EarlyPose) {}
}

/// The work stopped because [`Progress::cancelled`] returned true.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Returns [`Cancelled`] if a stop was requested.
pub fn check(progress: &dyn Progress) -> Result<(), Cancelled> {
    if progress.cancelled() { Err(Cancelled) } else { Ok(()) }
}

/// Reports the start of a stage, then returns [`Cancelled`] if a stop was requested.
pub fn begin(progress: &dyn Progress, stage: Stage) -> Result<(), Cancelled> {
    progress.enter(stage);
    check(progress)
}

/// A [`Progress`] that ignores reports and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn cancelled(&self) -> bool {
        false
    }
}
