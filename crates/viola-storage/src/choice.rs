//! The pose that a person chose for a clip, and its effect on the method's own verdict.

use super::ClipState;
use super::lidar_maps::FromEarlier;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use viola_align::{Alignment, Alternative};
use viola_geometry::{LevelName, Pose2};
use viola_home as home;
use viola_reconstruct::Reason;
use viola_reconstruct::floor::SAME_FLOOR_M;

const CHOSEN: &str = "chosen_by_person";
const EARLIER: &str = "choice_of_earlier_lidar_map";
const CARRIED_OVER: &str = "choice_carried_over";
pub(super) const WAITS: &str = "choice_without_result";

/// The pose of a clip that a person chose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    #[serde(default)]
    pub level: LevelName,
    /// In the frame of the level's LiDAR map of `lidar_map_revision`.
    pub map_from_clip: Pose2,
    /// Index among the alternatives that the clip had then; null if the person gave a pose.
    pub alternative: Option<u32>,
    /// Height of the first camera above the floor of that alternative, if the alternatives were above several floors: a new answer
    /// may be above another one than the answer at that time. `None` in rows of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) camera_height_m: Option<f64>,
    /// Revision of the level's LiDAR map at the time of the choice, or a later one that it was carried over to.
    pub lidar_map_revision: i64,
    /// Revision at the time of the choice, if it was carried over.
    #[serde(default)]
    pub carried_from: Option<i64>,
    pub chosen_at: Timestamp,
}

/// Returns the height of the first camera above the floor of an alternative; `None` if all of them are above one floor.
pub(super) fn camera_height_m(answer: &Alignment, alternative: &Alternative) -> Option<f64> {
    let is_one = answer.alternatives.iter().all(|one| one.rise_m == 0.0);
    let floor = answer.floor.as_ref().filter(|_| !is_one)?;
    Some(floor.camera_height_m + alternative.rise_m)
}

/// State of a clip and its reasons.
pub(super) struct Verdict {
    pub state: ClipState,
    pub reasons: Vec<Reason>,
}

impl Choice {
    /// Applies the choice to the method's own verdict. A choice for an earlier LiDAR map stays valid, since
    /// the frames may agree, and adds a reason. Without a result there is nothing to place. While a job is
    /// queued or running, the choice waits for its end.
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
            Some(n) => format!("a person chose alternative {n} of the answer at that time"),
            None => "a person gave the pose".to_owned(),
        };
        let mut reasons = vec![Reason::new(CHOSEN, detail)];
        if self.lidar_map_revision < lidar_map_revision {
            let detail = format!(
                "the person chose on revision {} of the LiDAR map, which was replaced: it is now {lidar_map_revision}, and the \
                 two could not be registered to each other. The clip was aligned again to the new map, and the choice stays \
                 where it was, which may be wrong there: look at the clip, and choose again or withdraw the choice",
                self.lidar_map_revision
            );
            reasons.push(Reason::new(EARLIER, detail));
        } else if let Some(earlier) = self.carried_from {
            let detail = format!(
                "the person chose on revision {earlier} of the LiDAR map; the pose was moved into the frame of revision {}, \
                 which was registered to it",
                self.lidar_map_revision
            );
            reasons.push(Reason::new(CARRIED_OVER, detail));
        }
        Verdict { state: ClipState::Aligned, reasons }
    }

    /// Returns the choice as a verdict for the home's map, in which the clip is in the frame of `answer`.
    pub(super) fn verdict(&self, answer: Option<&Alignment>) -> home::Verdict {
        let rise_m = self.rise_m(answer);
        home::Verdict::Chosen { level: self.level, map_from_clip: self.map_from_clip, rise_m }
    }

    /// Returns the height of the floor of `answer` above the floor of the choice, as `rise_m` of an alternative.
    pub(super) fn rise_m(&self, answer: Option<&Alignment>) -> f64 {
        let floor = answer.and_then(|answer| answer.floor.as_ref());
        let rise_m =
            self.camera_height_m.zip(floor).map(|(chosen_m, floor)| chosen_m - floor.camera_height_m);
        // A new answer may find the same floor a little higher or lower.
        rise_m.filter(|rise_m| rise_m.abs() >= SAME_FLOOR_M).unwrap_or(0.0)
    }

    /// Moves the choice into the frame of a new revision of its level's LiDAR map, if it is of the replaced one.
    pub(super) fn carry_over(&mut self, level: LevelName, from: &FromEarlier, revision: i64) -> bool {
        let is_meant = self.level == level && self.lidar_map_revision == from.revision;
        if is_meant {
            self.map_from_clip = from.map_from_earlier.compose(&self.map_from_clip);
            self.carried_from.get_or_insert(from.revision);
            self.lidar_map_revision = revision;
        }
        is_meant
    }

    /// Returns whether two choices are equal apart from their time.
    pub(super) fn says_the_same(&self, other: &Choice) -> bool {
        Choice { chosen_at: other.chosen_at, ..self.clone() } == *other
    }
}
