//! The states of a clip.

use serde::{Deserialize, Serialize};
use viola_align::AlignmentState;

/// State of a clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClipState {
    /// Stored, with no job queued or running; the reasons say why: `no_lidar_map` or `cancelled`.
    Uploaded,
    /// Its job waits for a worker.
    Queued,
    /// Its job runs.
    Aligning,
    /// One pose stands out, or a person chose one.
    Aligned,
    /// No pose is certain enough: see the reasons and the alignment's alternatives.
    Ambiguous,
    /// No pose can be given; the reasons say why.
    Failed,
}

impl ClipState {
    pub const ALL: [ClipState; 6] = [
        ClipState::Uploaded,
        ClipState::Queued,
        ClipState::Aligning,
        ClipState::Aligned,
        ClipState::Ambiguous,
        ClipState::Failed,
    ];

    /// Returns whether a queued or running job will give the clip another state.
    pub fn is_under_way(self) -> bool {
        matches!(self, ClipState::Queued | ClipState::Aligning)
    }

    pub fn name(self) -> &'static str {
        match self {
            ClipState::Uploaded => "uploaded",
            ClipState::Queued => "queued",
            ClipState::Aligning => "aligning",
            ClipState::Aligned => "aligned",
            ClipState::Ambiguous => "ambiguous",
            ClipState::Failed => "failed",
        }
    }
}

impl From<AlignmentState> for ClipState {
    fn from(state: AlignmentState) -> ClipState {
        match state {
            AlignmentState::Aligned => ClipState::Aligned,
            AlignmentState::Ambiguous => ClipState::Ambiguous,
            AlignmentState::Failed => ClipState::Failed,
        }
    }
}
