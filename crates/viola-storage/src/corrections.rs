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

use super::columns::stored;
use super::database::{Connection, Transaction, query};
use super::home_maps::{MapHistory, MapLevel, MapScene};
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
pub trait Correction: Clone + PartialEq + Serialize + DeserializeOwned + 'static {
    const KIND: &'static str;
    /// The object or the room.
    type Target;
    type Change: Clone + Send + 'static;

    fn target(scene: &MapScene, id: &str) -> Option<Self::Target>;

    /// Returns the key of the correction of the target with this id.
    fn key(scene: &MapScene, id: &str) -> String;

    /// Returns an error if the rooms of the map do not allow the change. It may take seconds, so it does not run with the
    /// home locked.
    fn check(scene: &MapScene, id: &str, change: &Self::Change) -> Result<(), CorrectionError>;

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

    /// Returns all corrections of a home, each in the frame of its level in the current revision.
    pub async fn corrections(&self, home: &HomeId) -> Result<Corrections, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        homes::require(&mut snapshot, home).await?;
        let mut all = of_home(&mut snapshot, home).await?;
        drop(snapshot);
        // The map is read later than the corrections, so its history has their frames.
        let levels = self.home_map(home, None).await?.map(|map| (map.revision, map.levels));
        let (revision, levels) = levels.unwrap_or_default();
        for level in &levels {
            let has_objects = of_earlier_maps(&mut all.objects, level).next().is_some();
            let has_rooms = of_earlier_maps(&mut all.rooms, level).next().is_some();
            if !has_objects && !has_rooms {
                continue;
            }
            let Some(scene) = self.scene_of_level(home, revision, level.level).await? else { continue };
            let history = scene.history();
            for kept in of_earlier_maps(&mut all.objects, level) {
                kept.move_to(level.lidar_map_revision, &history);
            }
            for kept in of_earlier_maps(&mut all.rooms, level) {
                kept.move_to(level.lidar_map_revision, &history);
            }
        }
        Ok(all)
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
            let (current, checked) = check_apart::<C>(current, id, change.clone()).await;
            let mut transaction = self.database.begin().await?;
            if !is_current(&mut transaction, home, &current).await? {
                continue;
            }
            let state: CorrectionState<C> = current.state(&mut transaction, home, id).await?;
            let before = state.kept.as_ref().map(|kept| &kept.correction);
            let order = version(&mut transaction, home).await? + 1;
            let after = checked.and_then(|()| C::changed(&state, change, &current.scene, order));
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
            let kept_rows = keep(&mut transaction, home, (C::KIND, &target), kept.as_ref(), now).await?;
            if kept_rows > MAX_CORRECTIONS {
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
        let scene = self.scene_of_level(home, map.revision, level.level).await?;
        let scene = scene.ok_or(CorrectionError::NoMap)?;
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
        let mut kept: Option<Kept<C>> = find(connection, home, C::KIND, &key).await?;
        if shown.is_none() && kept.is_none() {
            return Err(CorrectionError::NotFound { kind: C::KIND, id: id.to_owned() });
        }
        if let Some(kept) = &mut kept {
            kept.move_to(self.lidar_map_revision, &self.history);
        }
        Ok(CorrectionState { shown, kept })
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

    /// Brings the correction into the frame of a LiDAR map, which is that of a map with this history.
    fn move_to(&mut self, lidar_map_revision: i64, history: &MapHistory) {
        self.correction = self.in_frame_of(history);
        self.lidar_map_revision = lidar_map_revision;
    }
}

/// Checks a change on a thread that may block; returns the map, too.
async fn check_apart<C: Correction>(
    current: Current,
    id: &str,
    change: C::Change,
) -> (Current, Result<(), CorrectionError>) {
    let id = id.to_owned();
    let check = move || {
        let checked = C::check(&current.scene, &id, &change);
        (current, checked)
    };
    match tokio::task::spawn_blocking(check).await {
        Ok(done) => done,
        Err(error) => std::panic::resume_unwind(error.into_panic()),
    }
}

/// Returns the corrections of a level that are in the frames of other LiDAR maps than its present one.
fn of_earlier_maps<'a, C>(
    kept: &'a mut [Kept<C>],
    level: &'a MapLevel,
) -> impl Iterator<Item = &'a mut Kept<C>> {
    kept.iter_mut().filter(move |kept| {
        level_of_id(&kept.target) == level.level && kept.lidar_map_revision != level.lidar_map_revision
    })
}

/// Locks the home; returns whether a revision is still the current one.
async fn is_current(
    transaction: &mut Transaction,
    home: &HomeId,
    current: &Current,
) -> Result<bool, StorageError> {
    homes::lock_existing(transaction, home).await?;
    let newest = query("SELECT MAX(revision) AS revision FROM home_maps WHERE home_id = $1");
    let newest = newest.bind(home.key()).fetch_one(transaction).await?.maybe_number("revision")?;
    Ok(newest == Some(current.revision))
}
