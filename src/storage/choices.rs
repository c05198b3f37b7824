//! A person's word on where a clip is. It stands beside the method's own answer, which is kept as it is, and goes
//! before it until it is withdrawn, also through every new answer.

use super::changes::{self, Changed};
use super::columns::to_json;
use super::database::{Transaction, query};
use super::{Clip, ClipState, HomeId, Storage, StorageError, clips, home_maps, lidar_maps};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_formats::lidar::LidarInfo;
use viola_geometry::Pose2;
use viola_reconstruct::Reason;

/// How far from the box around everything that the LiDAR map knows a clip may begin: the camera may stand in a room
/// that the robot never entered, but not in another house.
const REACH_M: f64 = 10.0;

const CHOSEN: &str = "chosen_by_person";
const EARLIER: &str = "choice_of_earlier_lidar_map";
const WAITS: &str = "choice_without_result";

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

/// What a person says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Chosen {
    /// An index into the clip's present alternatives.
    Alternative(u64),
    /// `map_from_clip`; finite.
    Pose(Pose2),
}

/// Why a choice is not taken.
#[derive(Debug, thiserror::Error)]
pub enum ChoiceError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the clip is `{}` and has no answer to choose from; wait for its job, or give map_from_clip", .0.name())]
    NoAnswerYet(ClipState),
    #[error("the clip has {count} alternatives; their indices begin with 0")]
    NoSuchAlternative { count: usize },
    #[error(
        "{field} is {given_m} m; the LiDAR map spans {min_m:.2} to {max_m:.2} m there, and a clip begins within {REACH_M} m of it"
    )]
    OutOfReach { field: &'static str, given_m: f64, min_m: f64, max_m: f64 },
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
    fn says_the_same(&self, other: &Choice) -> bool {
        Choice { chosen_at: other.chosen_at, ..self.clone() } == *other
    }
}

/// The method's own verdict, without a choice.
fn own_verdict(clip: &Clip) -> Verdict {
    match &clip.alignment {
        Some(alignment) => Verdict { state: alignment.state.into(), reasons: alignment.reasons.clone() },
        None => {
            let reasons = clip.reasons.iter().filter(|reason| reason.code != WAITS).cloned().collect();
            Verdict { state: clip.state, reasons }
        }
    }
}

impl Storage {
    /// Records a person's choice in place of the one before. The same choice again changes nothing.
    pub async fn choose(
        &self,
        home: &HomeId,
        id: Uuid,
        chosen: Chosen,
        now: Timestamp,
    ) -> Result<Clip, ChoiceError> {
        let mut transaction = self.database.begin().await?;
        let clip = clips::find_locked(&mut transaction, home, id).await?;
        let map = lidar_maps::current(&mut transaction, home).await?.ok_or(StorageError::NoLidarMap)?;
        let (map_from_clip, alternative) = match chosen {
            Chosen::Alternative(index) => alternative(&clip, index)?,
            Chosen::Pose(pose) => (reachable(pose, &map.info)?, None),
        };
        let lidar_map_revision = map.revision;
        let choice = Choice { map_from_clip, alternative, lidar_map_revision, chosen_at: now };
        if clip.choice.as_ref().is_some_and(|before| before.says_the_same(&choice)) {
            return Ok(clip);
        }
        let verdict = choice.over(own_verdict(&clip), clip.result_key.is_some(), lidar_map_revision);
        Ok(settle(transaction, &clip, Some(&choice), verdict, now).await?)
    }

    /// Takes a person's choice back: the clip goes back to the method's own verdict. Without a choice nothing changes.
    pub async fn withdraw_choice(
        &self,
        home: &HomeId,
        id: Uuid,
        now: Timestamp,
    ) -> Result<Clip, StorageError> {
        let mut transaction = self.database.begin().await?;
        let clip = clips::find_locked(&mut transaction, home, id).await?;
        if clip.choice.is_none() {
            return Ok(clip);
        }
        let verdict = own_verdict(&clip);
        settle(transaction, &clip, None, verdict, now).await
    }
}

fn alternative(clip: &Clip, index: u64) -> Result<(Pose2, Option<u32>), ChoiceError> {
    let alignment = clip.alignment.as_ref().ok_or(ChoiceError::NoAnswerYet(clip.state))?;
    let index = u32::try_from(index).ok();
    let found = index.and_then(|index| alignment.alternatives.get(index as usize));
    let found = found.ok_or(ChoiceError::NoSuchAlternative { count: alignment.alternatives.len() })?;
    Ok((found.map_from_clip, index))
}

/// The pose, its yaw in (-pi, pi], when a clip of this home can be there.
fn reachable(pose: Pose2, info: &LidarInfo) -> Result<Pose2, ChoiceError> {
    let sides = [("map_from_clip.x_m", pose.x_m), ("map_from_clip.y_m", pose.y_m)];
    for (axis, (field, given_m)) in sides.into_iter().enumerate() {
        let (min_m, max_m) = (info.min_m[axis], info.max_m[axis]);
        if !(min_m - REACH_M..=max_m + REACH_M).contains(&given_m) {
            return Err(ChoiceError::OutOfReach { field, given_m, min_m, max_m });
        }
    }
    Ok(Pose2::new(pose.x_m, pose.y_m, pose.yaw_rad))
}

/// Writes what became of the clip.
async fn settle(
    mut transaction: Transaction,
    clip: &Clip,
    choice: Option<&Choice>,
    verdict: Verdict,
    now: Timestamp,
) -> Result<Clip, StorageError> {
    query("UPDATE clips SET choice = $2, state = $3, reasons = $4, updated_at = $5 WHERE id = $1")
        .bind(clip.id.to_string())
        .bind(choice.map(to_json))
        .bind(verdict.state.name())
        .bind(to_json(&verdict.reasons))
        .bind(now.as_millisecond())
        .execute(&mut transaction)
        .await?;
    // Without a result the clip is in no map, before and after.
    if clip.result_key.is_some() {
        home_maps::changed(&mut transaction, &clip.home).await?;
    }
    let changed = Changed::Clip { id: clip.id, state: verdict.state };
    changes::record(&mut transaction, &clip.home, changed, now).await?;
    let clip = clips::find(&mut transaction, &clip.home, clip.id).await?;
    transaction.commit().await?;
    Ok(clip)
}
