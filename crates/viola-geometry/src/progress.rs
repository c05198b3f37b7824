//! How long work reports itself and hears that it should stop, without knowing a clock or a channel.

use serde::{Deserialize, Serialize};

/// The stages of aligning one clip, in the order in which they run.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Open the container and read the poses and the intrinsics.
    Decode,
    /// Follow the camera through the pictures of a clip without poses.
    Track,
    /// Decode the key frames and fuse them into a signed distance map.
    Fuse,
    /// Ask the network, if there is one, what the key frames show.
    Label,
    /// Find the floor plane.
    Floor,
    /// Cast rays at the vacuum's height.
    Raycast,
    /// Search the whole map for candidate poses.
    Search,
    /// Refine all candidates at once.
    Refine,
    /// Compare the candidates and say how sure the best one is.
    Decide,
    /// Fill in what the clip did not see; search, refine and decide come again behind it.
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

    /// The name used in results, logs and events.
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

    /// Where this stage begins and ends on the whole job's scale 0..1. The shares are typical times,
    /// so that a bar moves evenly; nothing else depends on them.
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

    /// `fraction` of this stage on the whole job's scale 0..1.
    pub fn overall(self, fraction: f64) -> f64 {
        let (from, to) = self.span();
        from + (to - from) * fraction.clamp(0.0, 1.0)
    }
}

/// Heard by the method while it works. Called from worker threads, so it must be quick.
pub trait Progress: Sync {
    /// A stage begins.
    fn enter(&self, stage: Stage);
    /// `fraction` (0..1) of the current stage is done.
    fn advance(&self, fraction: f64);
    /// Whether somebody asked to stop. Stages ask often and end with [`Cancelled`].
    fn cancelled(&self) -> bool;
    /// Whether the time that the current stage may take is over: what it has by then counts. Only stages that say so
    /// in their documentation ask.
    fn out_of_time(&self) -> bool {
        false
    }
}

/// The work was stopped because [`Progress::cancelled`] said so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Ends the work with [`Cancelled`] when somebody asked to stop.
pub fn check(progress: &dyn Progress) -> Result<(), Cancelled> {
    if progress.cancelled() { Err(Cancelled) } else { Ok(()) }
}

/// Begins a stage, unless somebody asked to stop.
pub fn begin(progress: &dyn Progress, stage: Stage) -> Result<(), Cancelled> {
    progress.enter(stage);
    check(progress)
}

/// Nobody listens and nobody cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn enter(&self, _stage: Stage) {}
    fn advance(&self, _fraction: f64) {}
    fn cancelled(&self) -> bool {
        false
    }
}
