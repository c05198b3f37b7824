//! Corrections of people to the objects and rooms of a home's map, apart from what the clips say.
//!
//! A correction makes the home due for a merge, and the merge applies it: a revision never changes. The
//! state that a person corrects is the current revision with the correction that is kept for the next one.

mod change;
mod rows;

pub use change::{ObjectChange, RoomChange};
pub use rows::{Corrections, Kept};
pub(super) use rows::{forget_level, of_home};

use super::columns::{Columns, stored};
use super::database::{Transaction, query};
use super::home_maps::{MapHistory, MapObject, MapRoom, MapScene, map_file};
use super::{HomeId, Storage, StorageError, homes};
use jiff::Timestamp;
use rows::{find, keep, version};
use serde::Serialize;
use viola_geometry::Pose2;
use viola_home::{
    ObjectCorrection, RoomCorrection, RoomField, RoomMerge, RoomSplit, Seen, correct_rooms, level_of_id,
};

/// Maximum number of corrected objects and rooms in a home: more than a home has of both.
pub const MAX_CORRECTIONS: i64 = 500;

/// Attempts to correct a map that merges replace meanwhile.
const ATTEMPTS: usize = 8;

/// An object of the current revision, and the correction that the next one has.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectState {
    /// Null if the current revision does not show it.
    pub object: Option<MapObject>,
    pub kept: Option<Kept<ObjectCorrection>>,
}

/// A room of the current revision, and the correction that the next one has.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomState {
    /// Null if the current revision does not have it, because it is a part of another room.
    pub room: Option<MapRoom>,
    pub kept: Option<Kept<RoomCorrection>>,
}

/// Reason why a correction is refused.
#[derive(Debug, thiserror::Error)]
pub enum CorrectionError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the home has no map yet: the first one follows the first aligned clip")]
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
    /// Returns an object and its correction.
    pub async fn object_state(&self, home: &HomeId, id: &str) -> Result<ObjectState, CorrectionError> {
        let current = self.current_scene(home, id).await?;
        let kept = find(&mut *self.database.snapshot().await?, home, "object", id).await?;
        object_state(&current, kept, id)
    }

    /// Returns a room and its correction.
    pub async fn room_state(&self, home: &HomeId, id: &str) -> Result<RoomState, CorrectionError> {
        let current = self.current_scene(home, id).await?;
        let key = key_of_room(&current.scene, id);
        let kept = find(&mut *self.database.snapshot().await?, home, "room", &key).await?;
        room_state(&current, kept, id)
    }

    /// Returns all corrections of a home, each in the frame of the LiDAR map in which it was made.
    pub async fn corrections(&self, home: &HomeId) -> Result<Corrections, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        if !homes::exists(&mut snapshot, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        of_home(&mut snapshot, home).await
    }

    /// Corrects an object if its state is as `expected`; returns its new state. A change that changes nothing
    /// is no correction, and no error: the answer to its first request may have been lost.
    pub async fn correct_object(
        &self,
        home: &HomeId,
        id: &str,
        change: &ObjectChange,
        expected: impl Fn(&ObjectState) -> bool,
        now: Timestamp,
    ) -> Result<ObjectState, CorrectionError> {
        for _ in 0..ATTEMPTS {
            let current = self.current_scene(home, id).await?;
            let mut transaction = self.database.begin().await?;
            if !is_current(&mut transaction, home, &current).await? {
                continue;
            }
            let kept = find(&mut transaction, home, "object", id).await?;
            let state = object_state(&current, kept, id)?;
            let seen = state.object.as_ref().map(seen);
            let before = state.kept.as_ref().map(|kept| kept.correction.clone());
            let Some(base) = before.clone().or_else(|| seen.clone().map(ObjectCorrection::of)) else {
                return Err(CorrectionError::NotFound { kind: "object", id: id.to_owned() });
            };
            let after = change.apply(base, seen);
            let after = Some(after).filter(|after| !after.is_empty());
            if after == before {
                return Ok(state);
            }
            if !expected(&state) {
                return Err(CorrectionError::Changed { kind: "object", id: id.to_owned() });
            }
            let kept = write(&mut transaction, home, ("object", id), after, &current, now).await?;
            transaction.commit().await?;
            return Ok(ObjectState { object: state.object, kept });
        }
        Err(CorrectionError::Changed { kind: "object", id: id.to_owned() })
    }

    /// Corrects a room as [`Storage::correct_object`] does an object.
    pub async fn correct_room(
        &self,
        home: &HomeId,
        id: &str,
        change: &RoomChange,
        expected: impl Fn(&RoomState) -> bool,
        now: Timestamp,
    ) -> Result<RoomState, CorrectionError> {
        for _ in 0..ATTEMPTS {
            let current = self.current_scene(home, id).await?;
            let key = key_of_room(&current.scene, id);
            let mut transaction = self.database.begin().await?;
            if !is_current(&mut transaction, home, &current).await? {
                continue;
            }
            let kept = find(&mut transaction, home, "room", &key).await?;
            let state = room_state(&current, kept, id)?;
            let before = state.kept.as_ref().map(|kept| kept.correction.clone());
            let order = version(&mut transaction, home).await? + 1;
            let after = corrected_room(&current, &state, change, order);
            let after = after.map(|after| Some(after).filter(|after| !after.is_empty()));
            if after.as_ref().is_ok_and(|after| *after == before) {
                return Ok(state);
            }
            if !expected(&state) {
                return Err(CorrectionError::Changed { kind: "room", id: id.to_owned() });
            }
            let kept = write(&mut transaction, home, ("room", &key), after?, &current, now).await?;
            transaction.commit().await?;
            return Ok(RoomState { room: state.room, kept });
        }
        Err(CorrectionError::Changed { kind: "room", id: id.to_owned() })
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

fn seen(object: &MapObject) -> Seen {
    Seen {
        class: object.class,
        confidence: object.confidence,
        centre_m: object.centre_m,
        size_m: object.size_m,
        yaw_rad: object.yaw_rad,
    }
}

fn object_state(
    current: &Current,
    kept: Option<Kept<ObjectCorrection>>,
    id: &str,
) -> Result<ObjectState, CorrectionError> {
    let object = current.scene.objects.iter().find(|object| object.id == id).cloned();
    if object.is_none() && kept.is_none() {
        return Err(CorrectionError::NotFound { kind: "object", id: id.to_owned() });
    }
    let in_frame = |mut kept: Kept<ObjectCorrection>| {
        if let Some(now_from_then) = current.frame_from(kept.lidar_map_revision) {
            kept.correction.move_by(&now_from_then);
        }
        Kept { lidar_map_revision: current.lidar_map_revision, ..kept }
    };
    Ok(ObjectState { object, kept: kept.map(in_frame) })
}

fn room_state(
    current: &Current,
    kept: Option<Kept<RoomCorrection>>,
    id: &str,
) -> Result<RoomState, CorrectionError> {
    let room = current.scene.rooms.iter().find(|room| room.room.id == id).cloned();
    if room.is_none() && kept.is_none() {
        return Err(CorrectionError::NotFound { kind: "room", id: id.to_owned() });
    }
    let in_frame = |mut kept: Kept<RoomCorrection>| {
        if let Some(now_from_then) = current.frame_from(kept.lidar_map_revision) {
            kept.correction.move_by(&now_from_then);
        }
        Kept { lidar_map_revision: current.lidar_map_revision, ..kept }
    };
    Ok(RoomState { room, kept: kept.map(in_frame) })
}

impl Current {
    /// Returns the transform from the frame of an earlier LiDAR map; `None` for the present one.
    fn frame_from(&self, lidar_map_revision: i64) -> Option<Pose2> {
        self.history.frames.get(&lidar_map_revision).copied()
    }
}

/// Returns the key of a room's correction: rooms are held by place, and may have another id since.
fn key_of_room(scene: &MapScene, id: &str) -> String {
    let room = scene.rooms.iter().find(|room| room.room.id == id);
    room.and_then(|room| room.correction.clone()).unwrap_or_else(|| id.to_owned())
}

/// Returns the correction of a room after a change.
fn corrected_room(
    current: &Current,
    state: &RoomState,
    change: &RoomChange,
    order: i64,
) -> Result<RoomCorrection, CorrectionError> {
    let kept = state.kept.as_ref().map(|kept| kept.correction.clone());
    let fresh = state.room.as_ref().map(|room| RoomCorrection {
        name: None,
        merge: None,
        split: None,
        at_m: room.room.label_at_m,
    });
    let mut correction = kept.or(fresh).ok_or(CorrectionError::NoMap)?;
    if let Some(name) = &change.name {
        correction.name.clone_from(name);
    }
    let is_now = |field: RoomField| state.room.as_ref().is_some_and(|room| room.corrected.contains(&field));
    if let Some(line) = &change.split_by {
        let split = line.map(|[from_m, to_m]| RoomSplit { from_m, to_m, order });
        let is_same = |old: &RoomSplit| {
            split.as_ref().is_some_and(|new| [new.from_m, new.to_m] == [old.from_m, old.to_m])
        };
        if !correction.split.as_ref().is_some_and(is_same) {
            if split.is_some() && is_now(RoomField::SplitBy) {
                let detail = "the room is divided by another line; divide its other part, or withdraw that line with null first";
                return Err(CorrectionError::Impossible { field: "split_by", detail: detail.to_owned() });
            }
            correction.split = split;
        }
    }
    if let (Some(Some(_)), Some(split), Some(room)) = (&change.split_by, &correction.split, &state.room)
        && !is_now(RoomField::SplitBy)
    {
        let alone =
            RoomCorrection { name: None, merge: None, split: Some(split.clone()), at_m: correction.at_m };
        let mut parts = vec![room.room.clone()];
        correct_rooms(&mut parts, &[(String::new(), alone)]);
        if parts.len() < 2 {
            let detail = "split_by does not divide the room into two parts of at least 0.5 m2".to_owned();
            return Err(CorrectionError::Impossible { field: "split_by", detail });
        }
    }
    if let Some(others) = &change.merge_with {
        // The rooms that are a part of it already have no ids to be named by.
        let parts = correction.merge.take().filter(|_| is_now(RoomField::MergeWith));
        correction.merge = match others {
            Some(others) => {
                let mut with_m = parts.map_or_else(Vec::new, |merge| merge.with_m);
                with_m.extend(places_of(current, state, others)?);
                Some(RoomMerge { with_m, order })
            }
            None => None,
        };
    }
    Ok(correction)
}

/// Returns a point inside each of the rooms to be merged with one.
fn places_of(
    current: &Current,
    state: &RoomState,
    others: &[String],
) -> Result<Vec<[f64; 2]>, CorrectionError> {
    let impossible = |detail: String| CorrectionError::Impossible { field: "merge_with", detail };
    let own =
        state.room.as_ref().ok_or_else(|| impossible("the room is a part of another one now".to_owned()))?;
    let mut with_m = Vec::new();
    let mut whole = own.room.clone();
    for id in others {
        let other = current.scene.rooms.iter().find(|room| room.room.id == *id && *id != own.room.id);
        let other = other
            .ok_or_else(|| impossible(format!("merge_with has '{id}', which is no other room of the map")))?;
        let both = viola_home::merged(&whole, &other.room);
        whole = both.ok_or_else(|| {
            impossible(format!("room '{id}' does not meet room '{}' at a wall", own.room.id))
        })?;
        with_m.push(other.room.label_at_m);
    }
    Ok(with_m)
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

/// Writes a correction for the frame of the current revision, within the limit of a home.
async fn write<T: Serialize>(
    transaction: &mut Transaction,
    home: &HomeId,
    of: (&'static str, &str),
    correction: Option<T>,
    current: &Current,
    now: Timestamp,
) -> Result<Option<Kept<T>>, CorrectionError> {
    let kept = correction.map(|correction| Kept {
        target: of.1.to_owned(),
        lidar_map_revision: current.lidar_map_revision,
        correction,
        corrected_at: stored(now),
    });
    if keep(transaction, home, of, kept.as_ref()).await? > MAX_CORRECTIONS {
        return Err(CorrectionError::TooMany);
    }
    Ok(kept)
}
