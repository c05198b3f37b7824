//! Content of a home's map beyond points, and what the next revision needs of it.

use super::objects::MapObject;
use crate::columns::{parse_json, to_json};
use crate::{HomeId, MapFile, Storage, StorageError, map_file};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::{LevelName, Pose2};
use viola_home::{Corrected, Coverage, History, KnownObject, MovedObject, Room, RoomField};

/// A room of a home's map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapRoom {
    #[serde(flatten)]
    pub room: Room,
    /// The level in whose LiDAR map it is.
    #[serde(default)]
    pub level: LevelName,
    /// Properties that a person corrected.
    #[serde(default)]
    pub corrected: Vec<RoomField>,
    /// Key of the correction: the room's id at the time of the correction.
    #[serde(default)]
    pub correction: Option<String>,
}

impl MapRoom {
    pub fn new(level: LevelName, room: Room, corrected: Option<&Corrected<RoomField>>) -> MapRoom {
        MapRoom {
            room,
            level,
            corrected: corrected.map(|one| one.fields.clone()).unwrap_or_default(),
            correction: corrected.map(|one| one.key.clone()),
        }
    }
}

/// Content of one level of a home's map beyond points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapScene {
    pub rooms: Vec<MapRoom>,
    pub objects: Vec<MapObject>,
    pub coverage: Coverage,
    /// Null in revisions of earlier versions.
    #[serde(default)]
    pub history: Option<MapHistory>,
}

/// The part of a revision that depends on the earlier ones, and the corrections that it has.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MapHistory {
    pub ids: History,
    /// Version of the home's corrections that are applied.
    pub corrections: i64,
    /// The home's name in the titles of the plans.
    #[serde(default)]
    pub home_name: Option<String>,
    /// Objects that people hid.
    pub hidden: Vec<String>,
    /// Transforms into this revision's frame from those of earlier LiDAR maps, by revision.
    pub frames: BTreeMap<i64, Pose2>,
    /// Objects of earlier revisions that are not found, and that no clip showed to be gone.
    #[serde(default)]
    pub missing: Vec<MapObject>,
    /// The corrected rooms by the cells of the LiDAR map, before they have the outlines of the plan: corrections divide and join
    /// these. Empty in revisions of earlier versions.
    #[serde(default)]
    pub rooms_of_cells: Vec<Room>,
    /// Histories of levels that were removed, without objects and rooms: such a level may be put again.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub removed_levels: BTreeMap<LevelName, History>,
}

impl MapScene {
    /// Returns the objects in another frame, to be compared with those of a later revision: after those of the
    /// revision the ones that are missing.
    pub fn earlier_objects(&self, other_from_own: &Pose2) -> Vec<MovedObject<'_>> {
        let missing = self.history.iter().flat_map(|history| &history.missing);
        let missing =
            missing.map(|object| MovedObject { is_found: false, ..object.in_frame(other_from_own) });
        self.objects.iter().map(|object| object.in_frame(other_from_own)).chain(missing).collect()
    }

    /// Returns a room as corrections see it.
    pub fn room_of_cells<'a>(&'a self, room: &'a MapRoom) -> &'a Room {
        let of_cells = self.history.as_ref().map(|history| history.rooms_of_cells.as_slice());
        let same = of_cells.unwrap_or_default().iter().find(|one| one.id == room.room.id);
        same.unwrap_or(&room.room)
    }

    /// Returns the text of all that a mesh has of the objects. Meshes of the same tiles differ only if this text does.
    pub fn mesh_parts(&self) -> String {
        let part = |object: &MapObject| {
            (object.id.clone(), object.class, object.centre_m, object.size_m, object.yaw_rad)
        };
        to_json(&self.objects.iter().map(part).collect::<Vec<_>>())
    }

    /// Returns the version of the corrections that it has.
    pub fn corrections(&self) -> i64 {
        self.history.as_ref().map_or(0, |history| history.corrections)
    }

    /// Returns the home's name that it has.
    pub fn home_name(&self) -> Option<&str> {
        self.history.as_ref()?.home_name.as_deref()
    }

    /// Returns the history; that of a revision of an earlier version has its ids and nothing else.
    pub fn history(&self) -> MapHistory {
        if let Some(history) = &self.history {
            return history.clone();
        }
        let known =
            |object: &MapObject| KnownObject::found(object.id.clone(), object.class, &object.bounds());
        let rooms: Vec<Room> = self.rooms.iter().map(|room| room.room.clone()).collect();
        MapHistory {
            ids: History::of(self.objects.iter().map(known).collect(), &rooms),
            ..MapHistory::default()
        }
    }
}

impl Storage {
    /// Returns the scene of a level of a revision; `None` if the revision was removed meanwhile.
    pub(crate) async fn scene_of_level(
        &self,
        home: &HomeId,
        revision: i64,
        level: LevelName,
    ) -> Result<Option<MapScene>, StorageError> {
        let files = self.home_map_files(home, revision, level, map_file::SCENE).await?;
        let Some(file) = files.first() else { return Ok(None) };
        let scene = self.map_scene(file).await?;
        if scene.is_none() {
            self.check_map_file_removed(file).await?;
        }
        Ok(scene)
    }

    /// Returns the scene of a revision; `None` if the revision was removed since.
    pub async fn map_scene(&self, file: &MapFile) -> Result<Option<MapScene>, StorageError> {
        let Some(bytes) = self.map_file_bytes(file).await? else { return Ok(None) };
        Ok(Some(parse_json("scene.json", &bytes)?))
    }
}
