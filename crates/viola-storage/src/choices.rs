//! Poses that a person chooses for clips. A choice overrides the method's answer, which is kept unchanged,
//! until it is withdrawn, even after new answers.

use super::changes::{self, Changed};
use super::choice::{Choice, Verdict, WAITS, camera_height_m};
use super::columns::{stored, to_json};
use super::database::{Transaction, query};
use super::{
    Clip, ClipState, FromEarlier, HomeId, LidarMapRevision, Storage, StorageError, clips, clock, home_maps,
    lidar_maps,
};
use jiff::Timestamp;
use uuid::Uuid;
use viola_align::{Alignment, Alternative};
use viola_formats::lidar::LidarInfo;
use viola_geometry::{LevelName, Pose2};

/// Margin around the LiDAR map's bounding box within which a clip may begin: the camera may stand in a room
/// that the robot never entered, but not in another house.
const REACH_M: f64 = 10.0;

/// A person's choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Chosen {
    /// An index into the clip's present alternatives.
    Alternative(u64),
    /// A level and `map_from_clip`; finite.
    Pose(LevelName, Pose2),
}

/// Reason why a choice is refused.
#[derive(Debug, thiserror::Error)]
pub enum ChoiceError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the clip is `{}` and has no answer to choose from; wait for its job, or give map_from_clip", .0.name())]
    NoAnswerYet(ClipState),
    #[error("the home has no LiDAR map of the level '{0}'")]
    NoSuchLevel(LevelName),
    #[error("the clip has {count} alternatives; their indices begin with 0")]
    NoSuchAlternative { count: usize },
    #[error(
        "{field} is {given_m} m; the LiDAR map spans {min_m:.2} to {max_m:.2} m there, and a clip begins within {REACH_M} m of it"
    )]
    OutOfReach { field: &'static str, given_m: f64, min_m: f64, max_m: f64 },
}

/// Returns the method's own verdict, without a choice.
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
    /// Records a person's choice in place of the previous one, if the clip is as `expected`. The same choice again
    /// changes nothing, and is no error: its first answer may have been lost.
    pub async fn choose(
        &self,
        home: &HomeId,
        id: Uuid,
        chosen: Chosen,
        expected: impl Fn(&Clip) -> bool + Send,
        now: Timestamp,
    ) -> Result<Clip, ChoiceError> {
        let mut transaction = self.database.begin().await?;
        let clip = clips::find_locked(&mut transaction, home, id).await?;
        let maps = lidar_maps::levels(&mut transaction, home).await?;
        let choice = choice_of(&clip, &maps, chosen, now);
        let is_same =
            |choice: &Choice| clip.choice.as_ref().is_some_and(|before| before.says_the_same(choice));
        if choice.as_ref().is_ok_and(is_same) {
            return Ok(clip);
        }
        if !expected(&clip) {
            return Err(StorageError::Changed { what: "clip" }.into());
        }
        let choice = choice?;
        let verdict = choice.over(own_verdict(&clip), clip.result_key.is_some(), choice.lidar_map_revision);
        Ok(settle(transaction, &clip, Some(&choice), verdict, now).await?)
    }

    /// Withdraws a choice, if the clip is as `expected`: the clip returns to the method's own verdict. Without a
    /// choice nothing changes.
    pub async fn withdraw_choice(
        &self,
        home: &HomeId,
        id: Uuid,
        expected: impl Fn(&Clip) -> bool + Send,
        now: Timestamp,
    ) -> Result<Clip, StorageError> {
        let mut transaction = self.database.begin().await?;
        let clip = clips::find_locked(&mut transaction, home, id).await?;
        if clip.choice.is_none() {
            return Ok(clip);
        }
        if !expected(&clip) {
            return Err(StorageError::Changed { what: "clip" });
        }
        let verdict = own_verdict(&clip);
        settle(transaction, &clip, None, verdict, now).await
    }
}

/// Moves the choices on a level's replaced LiDAR map into the frame of its new revision. The clips are queued afterwards,
/// which tells of the change.
pub(super) async fn carry_over(
    transaction: &mut Transaction,
    home: &HomeId,
    level: LevelName,
    from: &FromEarlier,
    revision: i64,
) -> Result<(), StorageError> {
    let rows = query("SELECT id, choice FROM clips WHERE home_id = $1 AND choice IS NOT NULL ORDER BY id")
        .bind(home.key())
        .fetch_all(&mut *transaction)
        .await?;
    for row in &rows {
        let mut choice: Choice = row.json("choice")?;
        if choice.carry_over(level, from, revision) {
            query("UPDATE clips SET choice = $2 WHERE id = $1")
                .bind(row.id("id")?.to_string())
                .bind(to_json(&choice))
                .execute(&mut *transaction)
                .await?;
        }
    }
    Ok(())
}

/// Returns what a person chose, in the frame of the level's current LiDAR map.
fn choice_of(
    clip: &Clip,
    maps: &[LidarMapRevision],
    chosen: Chosen,
    now: Timestamp,
) -> Result<Choice, ChoiceError> {
    if maps.is_empty() {
        return Err(StorageError::NoLidarMap.into());
    }
    let map_of = |level| maps.iter().find(|map| map.level == level).ok_or(ChoiceError::NoSuchLevel(level));
    let choice = |level, map_from_clip| -> Result<Choice, ChoiceError> {
        Ok(Choice {
            level,
            map_from_clip,
            alternative: None,
            camera_height_m: None,
            lidar_map_revision: map_of(level)?.revision,
            carried_from: None,
            chosen_at: stored(now),
        })
    };
    match chosen {
        Chosen::Alternative(index) => {
            let (alignment, alternative) = alternative(clip, index)?;
            Ok(Choice {
                alternative: u32::try_from(index).ok(),
                camera_height_m: camera_height_m(alignment, alternative),
                ..choice(alternative.level, alternative.map_from_clip)?
            })
        }
        Chosen::Pose(level, pose) => choice(level, reachable(pose, &map_of(level)?.info)?),
    }
}

/// Returns an alternative and the answer that has it.
fn alternative(clip: &Clip, index: u64) -> Result<(&Alignment, &Alternative), ChoiceError> {
    let alignment = clip.alignment.as_ref().ok_or(ChoiceError::NoAnswerYet(clip.state))?;
    let found = usize::try_from(index).ok().and_then(|index| alignment.alternatives.get(index));
    let found = found.ok_or(ChoiceError::NoSuchAlternative { count: alignment.alternatives.len() })?;
    Ok((alignment, found))
}

/// Returns the pose, its yaw in (-pi, pi], if a clip of this home can be there.
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

/// Writes the clip's choice and verdict, and commits.
async fn settle(
    mut transaction: Transaction,
    clip: &Clip,
    choice: Option<&Choice>,
    verdict: Verdict,
    now: Timestamp,
) -> Result<Clip, StorageError> {
    let update = concat!(
        "UPDATE clips SET choice = $2, state = $3, reasons = $4, ",
        clock::change_at!("$5"),
        " WHERE id = $1"
    );
    query(update)
        .bind(clip.id.to_string())
        .bind(choice.map(to_json))
        .bind(verdict.state.name())
        .bind(to_json(&verdict.reasons))
        .bind(now.as_millisecond())
        .execute(&mut transaction)
        .await?;
    // Without a result the clip is in no map, before and after.
    if clip.result_key.is_some() {
        home_maps::changed(&mut transaction, &clip.home, now).await?;
    }
    let changed = Changed::Clip { id: clip.id, state: verdict.state };
    changes::record(&mut transaction, &clip.home, changed, now).await?;
    let clip = clips::find(&mut transaction, &clip.home, clip.id).await?;
    transaction.commit().await?;
    Ok(clip)
}
