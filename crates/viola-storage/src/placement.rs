//! The placement of a clip in its home's map.

use super::ClipState;
use serde::{Deserialize, Serialize};
use viola_align::Alignment;
use viola_geometry::{LevelName, Pose2};
use viola_home::{PlacedBy, Verdict};
use viola_reconstruct::Reason;

/// Pose of a clip in a revision of the home's map, and its source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// The level in whose LiDAR map the pose is.
    #[serde(default)]
    pub level: LevelName,
    pub map_from_clip: Pose2,
    /// Height of the clip frame's origin, which is on the floor of the answer, above the floor at this pose: not 0 if an
    /// alternative above another floor was chosen.
    #[serde(default, skip_serializing_if = "viola_geometry::is_zero")]
    pub rise_m: f64,
    pub by: PlacedBy,
    /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1; null if a person chose it.
    pub probability: Option<f64>,
    /// Revision of the home's map.
    pub map_revision: i64,
    /// Key of the files of the answer that the other clips completed; `None` for other placements and in rows of earlier
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) answer: Option<String>,
}

/// Maximum distance of the placement from the first alternative that it refines.
const SAME_M: f64 = 0.3;

impl Placement {
    /// Returns whether it may be of the answer with these files. It stays beside a newer answer until the next merge, and
    /// that answer may be of another LiDAR map.
    pub(super) fn is_of(&self, result_key: Option<&str>) -> bool {
        self.answer.is_none() || self.answer.as_deref() == result_key
    }

    /// Gives an answer the pose that the clips around its clip decided, with its probability.
    pub(super) fn apply(&self, answer: &mut Alignment) {
        if self.by != PlacedBy::Neighbours {
            return;
        }
        let is_same =
            |own: &Pose2| answer.level == self.level && own.distance_m(&self.map_from_clip) < SAME_M;
        if !answer.map_from_clip.as_ref().is_some_and(is_same) {
            // It is that of the first alternative.
            answer.covariance = None;
        }
        answer.level = self.level;
        answer.map_from_clip = Some(self.map_from_clip);
        answer.probability = self.probability;
    }
}

/// Returns the state after a merge of a clip whose own alignment left its pose open; `None` for other clips. `by` is
/// the source of its pose in the map, if it has one.
pub fn state_by_others(verdict: &Verdict, by: Option<PlacedBy>) -> Option<ClipState> {
    let alone = match verdict {
        Verdict::Ambiguous { .. } => ClipState::Ambiguous,
        Verdict::Unplaced => ClipState::Failed,
        Verdict::Aligned { .. } | Verdict::Chosen { .. } => return None,
    };
    Some(if by.is_some() { ClipState::Aligned } else { alone })
}

/// Returns the reasons that replace those of a clip's own alignment; `None` if its own stay.
pub fn reasons_of_placement(by: Option<PlacedBy>) -> Option<Vec<Reason>> {
    (by == Some(PlacedBy::Neighbours)).then(|| {
        let detail = "the clip alone leaves its pose open; what the clips around it saw decided it";
        vec![Reason::new("decided_by_neighbours", detail)]
    })
}
