//! Corrections of people to the objects and rooms of a home's map, apart from what the clips say.
//!
//! A correction makes the home due for a merge, and the merge applies it: a revision never changes. The
//! state that a person corrects is the current revision with the correction that is kept for the next one.

mod object;
mod room;
mod rows;

pub use object::ObjectChange;
pub use room::RoomChange;
pub use rows::{Corrections, Kept};
pub(super) use rows::{forget_level, of_home};

use super::columns::{Columns, stored};
use super::database::{Connection, Transaction, query};
use super::home_maps::{MapHistory, MapScene, map_file};
use super::{HomeId, Storage, StorageError, homes};
use jiff::Timestamp;
use rows::{find, keep, version};
use serde::Serialize;
use serde::de::DeserializeOwned;
use viola_geometry::Pose2;
use viola_home::level_of_id;

/// Maximum number of corrected objects and rooms in a home: more than a home has of both.
pub const MAX_CORRECTIONS: i64 = 500;

/// Attempts to correct a map that merges replace meanwhile.
const ATTEMPTS: usize = 8;

/// A person's correction of an object or a room.
pub trait Correction: Clone + PartialEq + Serialize + DeserializeOwned {
    const KIND: &'static str;
    /// The object or the room.
    type Target;
    type Change;

    fn target(scene: &MapScene, id: &str) -> Option<Self::Target>;

    /// Returns the key of the correction of the target with this id.
    fn key(scene: &MapScene, id: &str) -> String;

    /// Returns the correction after a change. `order` is the number of the change in its home.
    fn changed(
        state: &CorrectionState<Self>,
        change: &Self::Change,
        scene: &MapScene,
        order: i64,
    ) -> Result<Self, CorrectionError>;

    /// Returns whether nothing is corrected.
    fn is_empty(&self) -> bool;

    /// Brings the places into another frame.
    fn move_by(&mut self, now_from_then: &Pose2);
}

/// An object or a room of the current revision, and the correction that the next one has.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrectionState<C: Correction> {
    /// Null if the current revision does not have it, because it is hidden or a part of another room.
    pub shown: Option<C::Target>,
    pub kept: Option<Kept<C>>,
}

/// Reason why a correction is refused.
#[derive(Debug, thiserror::Error)]
pub enum CorrectionError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the home has no map yet: the first one follows the first clip with an answer")]
    NoMap,
    #[error("the map has no {kind} with the id {id}, and none was corrected under this id")]
    NotFound { kind: &'static str, id: String },
    #[error("{kind} {id} was changed since it was read; read it again")]
    Changed { kind: &'static str, id: String },
    #[error("the home has {MAX_CORRECTIONS} corrected objects and rooms; withdraw one first")]
    TooMany,
    #[error("{detail}")]
    Impossible { field: &'static str, detail: String },
}

/// One level of the current revision of a home's map.
struct Current {
    revision: i64,
    lidar_map_revision: i64,
    scene: MapScene,
    history: MapHistory,
}

impl Storage {
    /// Returns an object or a room and its correction.
    pub async fn corrected<C: Correction>(
        &self,
        home: &HomeId,
        id: &str,
    ) -> Result<CorrectionState<C>, CorrectionError> {
        let current = self.current_scene(home, id).await?;
        let mut snapshot = self.database.snapshot().await?;
        current.state(&mut snapshot, home, id).await
    }

    /// Returns all corrections of a home, each in the frame of the LiDAR map in which it was made.
    pub async fn corrections(&self, home: &HomeId) -> Result<Corrections, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        if !homes::exists(&mut snapshot, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        of_home(&mut snapshot, home).await
    }

    /// Corrects an object or a room if its state is as `expected`; returns its new state. A change that
    /// changes nothing is no correction, and no error: the answer to its first request may have been lost.
    pub async fn correct<C: Correction>(
        &self,
        home: &HomeId,
        id: &str,
        change: &C::Change,
        expected: impl Fn(&CorrectionState<C>) -> bool,
        now: Timestamp,
    ) -> Result<CorrectionState<C>, CorrectionError> {
        let changed = || CorrectionError::Changed { kind: C::KIND, id: id.to_owned() };
        for _ in 0..ATTEMPTS {
            let current = self.current_scene(home, id).await?;
            let mut transaction = self.database.begin().await?;
            if !is_current(&mut transaction, home, &current).await? {
                continue;
            }
            let state: CorrectionState<C> = current.state(&mut transaction, home, id).await?;
            let before = state.kept.as_ref().map(|kept| &kept.correction);
            let order = version(&mut transaction, home).await? + 1;
            let after = C::changed(&state, change, &current.scene, order);
            let after = after.map(|after| Some(after).filter(|after| !after.is_empty()));
            if after.as_ref().is_ok_and(|after| after.as_ref() == before) {
                return Ok(state);
            }
            if !expected(&state) {
                return Err(changed());
            }
            let target = C::key(&current.scene, id);
            let kept = after?.map(|correction| Kept {
                target: target.clone(),
                lidar_map_revision: current.lidar_map_revision,
                correction,
                corrected_at: stored(now),
            });
            if keep(&mut transaction, home, (C::KIND, &target), kept.as_ref()).await? > MAX_CORRECTIONS {
                return Err(CorrectionError::TooMany);
            }
            transaction.commit().await?;
            return Ok(CorrectionState { shown: state.shown, kept });
        }
        Err(changed())
    }

    /// Returns the current revision of the level of an object or a room.
    async fn current_scene(&self, home: &HomeId, id: &str) -> Result<Current, CorrectionError> {
        let map = self.home_map(home, None).await?.ok_or(CorrectionError::NoMap)?;
        let wanted = level_of_id(id);
        let level = map.levels.iter().find(|level| level.level == wanted).or(map.levels.first());
        let level = level.ok_or(CorrectionError::NoMap)?;
        let files = self.home_map_files(home, map.revision, level.level, map_file::SCENE).await?;
        let file = files.first().ok_or(CorrectionError::NoMap)?;
        let Some(scene) = self.map_scene(file).await? else {
            self.check_map_file_removed(file).await?;
            return Err(CorrectionError::NoMap);
        };
        let history = scene.history();
        Ok(Current { revision: map.revision, lidar_map_revision: level.lidar_map_revision, scene, history })
    }
}

impl Current {
    /// Returns an object or a room, and its correction in the frame of this revision.
    async fn state<C: Correction>(
        &self,
        connection: &mut Connection,
        home: &HomeId,
        id: &str,
    ) -> Result<CorrectionState<C>, CorrectionError> {
        let shown = C::target(&self.scene, id);
        let key = C::key(&self.scene, id);
        let kept: Option<Kept<C>> = find(connection, home, C::KIND, &key).await?;
        if shown.is_none() && kept.is_none() {
            return Err(CorrectionError::NotFound { kind: C::KIND, id: id.to_owned() });
        }
        let in_frame = |kept: Kept<C>| Kept {
            correction: kept.in_frame_of(&self.history),
            lidar_map_revision: self.lidar_map_revision,
            ..kept
        };
        Ok(CorrectionState { shown, kept: kept.map(in_frame) })
    }
}

impl<C: Correction> Kept<C> {
    /// Returns the correction in the frame of the map with this history.
    pub fn in_frame_of(&self, history: &MapHistory) -> C {
        let mut correction = self.correction.clone();
        // The history has no frame of the present LiDAR map.
        if let Some(now_from_then) = history.frames.get(&self.lidar_map_revision) {
            correction.move_by(now_from_then);
        }
        correction
    }
}

/// Locks the home; returns whether a revision is still the current one.
async fn is_current(
    transaction: &mut Transaction,
    home: &HomeId,
    current: &Current,
) -> Result<bool, StorageError> {
    if !homes::lock(transaction, home).await? {
        return Err(StorageError::NoSuchHome);
    }
    let newest = query("SELECT MAX(revision) AS revision FROM home_maps WHERE home_id = $1");
    let newest = newest.bind(home.key()).fetch_one(transaction).await?.maybe_number("revision")?;
    Ok(newest == Some(current.revision))
}
