//! The pose that a person chose for a clip, and what becomes of the method's own verdict.

use super::ClipState;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use viola_geometry::Pose2;
use viola_reconstruct::Reason;

const CHOSEN: &str = "chosen_by_person";
const EARLIER: &str = "choice_of_earlier_lidar_map";
pub(super) const WAITS: &str = "choice_without_result";

/// The pose of a clip that a person chose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Choice {
    /// In the frame of the LiDAR map of `lidar_map_revision`.
    pub map_from_clip: Pose2,
    /// Index among the alternatives that the clip had then; null when the person gave a pose.
    #[schema(minimum = 0, example = 1)]
    pub alternative: Option<u32>,
    /// The LiDAR map that the person looked at.
    #[schema(minimum = 1, example = 1)]
    pub lidar_map_revision: i64,
    pub chosen_at: Timestamp,
}

/// The state of a clip and why it is in it.
pub(super) struct Verdict {
    pub state: ClipState,
    pub reasons: Vec<Reason>,
}

impl Choice {
    /// What becomes of the method's own verdict when the choice stands. A choice for an earlier LiDAR map goes on, in
    /// the hope that the frames agree, and says so. Without a result there is nothing to place, and while a job is under
    /// way it takes effect when that ends.
    pub(super) fn over(&self, own: Verdict, has_result: bool, lidar_map_revision: i64) -> Verdict {
        if own.state.is_under_way() {
            return own;
        }
        if !has_result {
            let detail = "a person chose a pose; it is used once a job of the clip has run to an answer";
            let reasons = own.reasons.into_iter().chain([Reason::new(WAITS, detail)]).collect();
            return Verdict { state: own.state, reasons };
        }
        let detail = match self.alternative {
            Some(n) => format!("a person chose alternative {n} of the answer of then"),
            None => "a person gave the pose".to_owned(),
        };
        let mut reasons = vec![Reason::new(CHOSEN, detail)];
        if self.lidar_map_revision < lidar_map_revision {
            let detail = format!(
                "the person chose on revision {} of the LiDAR map, which is now {lidar_map_revision}; the frame may have \
                 moved: look at the clip again, and choose anew or withdraw the choice",
                self.lidar_map_revision
            );
            reasons.push(Reason::new(EARLIER, detail));
        }
        Verdict { state: ClipState::Aligned, reasons }
    }

    /// Whether two choices differ in nothing but their time.
    pub(super) fn says_the_same(&self, other: &Choice) -> bool {
        Choice { chosen_at: other.chosen_at, ..self.clone() } == *other
    }
}
