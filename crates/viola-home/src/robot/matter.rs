//! Areas and maps of the Service Area cluster (Matter 1.4, cluster 0x0150): the attributes SupportedAreas and
//! SupportedMaps.

mod tags;

use super::places::is_hung;
use super::titles::{Titles, cut};
use super::{RobotLevel, RobotObject};
use crate::rooms::Room;
use serde::Serialize;
use std::collections::BTreeSet;
use viola_geometry::LevelName;
use viola_geometry::taxonomy::Class;

/// Maximum number of entries of each list.
const MAX_AREAS: usize = 255;
/// Maximum length of a map's name in bytes; titles have at most the length of an area's.
const MAX_MAP_NAME: usize = 64;

/// The two attributes, in the names of the specification.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct MatterFile {
    pub supported_areas: Vec<Area>,
    pub supported_maps: Vec<Map>,
    /// The rooms and objects of the areas, in the order of `supportedAreas`.
    pub sources: Vec<Source>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Area {
    #[serde(rename = "areaID")]
    pub area_id: u32,
    #[serde(rename = "mapID")]
    pub map_id: u32,
    #[serde(rename = "areaInfo")]
    pub info: AreaInfo,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct AreaInfo {
    pub location_info: LocationInfo,
    pub landmark_info: Option<LandmarkInfo>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct LocationInfo {
    pub location_name: String,
    pub floor_number: Option<i16>,
    pub area_type: Option<u8>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct LandmarkInfo {
    pub landmark_tag: u8,
    pub relative_position_tag: u8,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Map {
    #[serde(rename = "mapID")]
    pub map_id: u32,
    pub name: String,
}

/// The source of an area.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Source {
    #[serde(rename = "areaID")]
    pub area_id: u32,
    pub level: LevelName,
    pub room: Option<String>,
    /// None for a room as a whole.
    pub object: Option<String>,
}

/// Returns the areas of a home: first the rooms of all levels, then their objects by descending confidence.
pub fn matter(levels: &[RobotLevel]) -> MatterFile {
    let (mut map_ids, mut area_ids) = (BTreeSet::new(), BTreeSet::new());
    let maps: Vec<Map> = levels
        .iter()
        .map(|level| Map {
            map_id: number(level.level.as_str(), &mut map_ids),
            name: cut(level.level.as_str(), MAX_MAP_NAME),
        })
        .collect();
    let mut file = MatterFile { supported_areas: Vec::new(), supported_maps: maps, sources: Vec::new() };
    let mut add =
        |level: &RobotLevel, map_id: u32, room: Option<&str>, object: Option<&str>, info: AreaInfo| {
            if file.supported_areas.len() == MAX_AREAS {
                return;
            }
            let key = format!("{}/{}/{}", level.level, room.unwrap_or_default(), object.unwrap_or_default());
            let area_id = number(&key, &mut area_ids);
            file.supported_areas.push(Area { area_id, map_id, info });
            file.sources.push(Source {
                area_id,
                level: level.level,
                room: room.map(str::to_owned),
                object: object.map(str::to_owned),
            });
        };
    let map_ids: Vec<u32> = file.supported_maps.iter().map(|map| map.map_id).collect();
    // Each pair of map and info must be unique; the titles of a level are.
    let titles: Vec<Titles> = levels.iter().map(Titles::of).collect();
    for ((level, titles), map_id) in levels.iter().zip(&titles).zip(&map_ids) {
        for (room, title) in level.rooms.iter().zip(&titles.rooms) {
            let info =
                AreaInfo { location_info: location(level, Some(&room.id), title), landmark_info: None };
            add(level, *map_id, Some(&room.id), None, info);
        }
    }
    for ((level, titles), map_id) in levels.iter().zip(&titles).zip(&map_ids) {
        // Nobody cleans beside a ceiling lamp.
        let titled = level.objects.iter().zip(&titles.objects);
        let mut objects: Vec<(&RobotObject, &String)> =
            titled.filter(|(object, _)| !is_hung(object)).collect();
        objects.sort_by(|a, b| b.0.confidence.total_cmp(&a.0.confidence));
        for (object, title) in objects {
            let room = object.room.as_deref();
            let place = location(level, room, title);
            let Some(landmark) = tags::landmark(object, place.area_type) else { continue };
            let info = AreaInfo { location_info: place, landmark_info: Some(landmark) };
            add(level, *map_id, room, Some(&object.id), info);
        }
    }
    file
}

/// Returns a location of this name in a room; without a room only the floor is known.
fn location(level: &RobotLevel, room: Option<&str>, name: &str) -> LocationInfo {
    let type_of = |room: &Room| {
        let in_room = level.objects.iter().filter(|object| object.room.as_ref() == Some(&room.id));
        let classes: Vec<Class> = in_room.map(|object| object.class).collect();
        tags::area(room.name.as_deref(), &classes)
    };
    LocationInfo {
        location_name: name.to_owned(),
        floor_number: floor_number(&level.level),
        area_type: level.room(room).and_then(type_of),
    }
}

/// Returns the floor's number by the name of its level: a number, or a word that is one everywhere.
fn floor_number(level: &LevelName) -> Option<i16> {
    match level.as_str() {
        "main" | "ground" | "ground_floor" | "ground-floor" => Some(0),
        "upper" | "upstairs" => Some(1),
        "basement" | "cellar" => Some(-1),
        name => name.parse().ok(),
    }
}

/// Returns a number that follows from a key (FNV-1a, 32 bits), or the next one that is not taken: an area keeps its
/// id while its room or object does.
fn number(key: &str, taken: &mut BTreeSet<u32>) -> u32 {
    let mut number = 0x811c_9dc5_u32;
    for byte in key.bytes() {
        number = (number ^ u32::from(byte)).wrapping_mul(0x0100_0193);
    }
    while !taken.insert(number) {
        number = number.wrapping_add(1);
    }
    number
}
