//! For Valetudo: the robot's map with the names of rooms, and bodies of its REST calls for rooms and objects
//! (Hypfer/Valetudo, `ZoneCleaningCapabilityRouter.js` and `GoToLocationCapabilityRouter.js`).

use super::area::Rectangle;
use super::drive::GoalArea;
use super::places::{Goal, Place, Places};
use super::segments::{Segment, segments};
use super::titles::Titles;
use super::{RobotLevel, Xy};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use viola_formats::lidar::RobotFrame;
use viola_geometry::taxonomy::Class;

/// Maximum size of a map that is sent back: it is held as values in memory. The largest known has 0.7 MB.
const MAX_MAP_BYTES: usize = 8 << 20;

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ValetudoFile {
    pub coordinates: Coordinates,
    /// The uploaded map, in which `metaData.name` of each segment is the name of its room; null with a reason in
    /// `map_absent`.
    pub map: Option<Value>,
    pub map_absent: Option<Absent>,
    pub segments: Vec<SegmentName>,
    /// The free space that has all goals.
    pub goal_area: GoalArea,
    pub rooms: Vec<Target>,
    pub objects: Vec<Target>,
}

/// The coordinates of zones and goals.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coordinates {
    /// Format of the uploaded LiDAR map.
    pub format: String,
    /// True for Valetudo's: the bodies can be sent as they are. Else they are in the LiDAR map's own frame.
    pub is_valetudo: bool,
    /// `cm` or `m`.
    pub unit: &'static str,
    pub is_y_down: bool,
}

/// A reason for which a part of the answer is absent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Absent {
    pub code: &'static str,
    pub detail: String,
}

/// A segment and the room whose name it gets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegmentName {
    pub segment: String,
    pub room: Option<String>,
    /// The room's name, with a number if several segments would have it; null for a room without a name: the segment
    /// keeps its own.
    pub name: Option<String>,
    /// Fraction of the segment's cells in the room.
    pub overlap: f64,
}

/// A room or an object to clean and to drive to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    pub id: String,
    pub name: Option<String>,
    pub class: Option<Class>,
    pub room: Option<String>,
    /// Body of `PUT /api/v2/robot/capabilities/ZoneCleaningCapability`; null without a zone.
    pub zone_cleaning: Option<ZoneCleaning>,
    /// Fraction of the area that the zones cover.
    pub covered: f64,
    /// Body of `PUT /api/v2/robot/capabilities/GoToLocationCapability`; null without free space.
    pub go_to: Option<GoTo>,
    /// The same goal in the map's frame, in metres.
    pub goal: Option<Goal>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ZoneCleaning {
    pub action: &'static str,
    pub zones: Vec<Zone>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Zone {
    pub points: Corners,
    pub iterations: u8,
}

/// Corners of a zone: upper left, upper right, lower right, lower left.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Corners {
    pub p_a: Xy,
    pub p_b: Xy,
    pub p_c: Xy,
    pub p_d: Xy,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GoTo {
    pub action: &'static str,
    pub coordinates: Xy,
}

/// Returns the answer for a level. `json` is the uploaded Valetudo map, if it is one.
pub fn valetudo(level: &RobotLevel, places: &Places, json: Option<&[u8]>) -> ValetudoFile {
    let segments = segment_names(level);
    let (map, map_absent) = match named(json, &segments) {
        Ok(map) => (Some(map), None),
        Err(absent) => (None, Some(absent)),
    };
    let frames = &level.lidar.frames;
    let frame = frames.valetudo.unwrap_or(RobotFrame::MAP);
    let (rooms, objects) = places.all.iter().map(|place| target(place, &frame)).partition(is_room);
    ValetudoFile {
        coordinates: Coordinates {
            format: level.lidar.info.format.clone(),
            is_valetudo: frames.valetudo.is_some(),
            unit: frame.unit(),
            is_y_down: frame.is_y_down,
        },
        map,
        map_absent,
        segments,
        goal_area: places.goal_area,
        rooms,
        objects,
    }
}

fn is_room(target: &Target) -> bool {
    target.class.is_none()
}

/// Returns the segments in the order of the LiDAR map.
fn segment_names(level: &RobotLevel) -> Vec<SegmentName> {
    let segments = segments(level);
    let titles = Titles::of(level).segments(level, &segments);
    let name = |(segment, title): (&Segment, Option<String>)| SegmentName {
        segment: segment.id.to_owned(),
        room: segment.room.map(|room| room.id.clone()),
        name: segment.room.and_then(|room| room.name.as_ref()).and(title),
        overlap: segment.overlap,
    };
    segments.iter().zip(titles).map(name).collect()
}

/// Returns the map with the names of its segments; everything else in it stays.
fn named(json: Option<&[u8]>, segments: &[SegmentName]) -> Result<Value, Absent> {
    let absent = |code, detail: String| Absent { code, detail };
    let json = json.ok_or_else(|| {
        let detail = "the LiDAR map was not uploaded as Valetudo's JSON, so it has no segments to name";
        absent("not_valetudo", detail.to_owned())
    })?;
    if json.len() > MAX_MAP_BYTES {
        let detail = format!("the LiDAR map has {} bytes; at most {MAX_MAP_BYTES} are sent back", json.len());
        return Err(absent("map_too_large", detail));
    }
    let mut map: Value =
        serde_json::from_slice(json).map_err(|error| absent("unreadable_map", error.to_string()))?;
    // The map may be a part of the robot's state.
    if map.get("layers").is_none()
        && let Some(own) = map.get_mut("map")
    {
        map = own.take();
    }
    let layers = map.get_mut("layers").and_then(Value::as_array_mut);
    let is_segment = |layer: &&mut Value| layer.get("type").and_then(Value::as_str) == Some("segment");
    let layers: Vec<&mut Value> = layers.into_iter().flatten().filter(is_segment).collect();
    let ids: Vec<Option<String>> = layers.iter().map(|layer| segment_id(layer)).collect();
    let with_id: BTreeSet<&str> = ids.iter().flatten().map(String::as_str).collect();
    let by_id: BTreeMap<&str, &SegmentName> =
        segments.iter().map(|segment| (segment.segment.as_str(), segment)).collect();
    // The reader numbers the segments without an id, and keeps their order.
    let mut numbered = segments.iter().filter(|segment| !with_id.contains(segment.segment.as_str()));
    for (layer, id) in layers.into_iter().zip(&ids) {
        // Several layers may have one id: they are parts of one segment.
        let segment = match id {
            Some(id) => by_id.get(id.as_str()).copied(),
            None => numbered.next(),
        };
        let Some(name) = segment.and_then(|segment| segment.name.as_ref()) else { continue };
        let meta = layer
            .as_object_mut()
            .map(|layer| layer.entry("metaData").or_insert_with(|| Value::Object(Default::default())));
        if let Some(meta) = meta.and_then(Value::as_object_mut) {
            meta.insert("name".to_owned(), Value::from(name.as_str()));
        }
    }
    Ok(map)
}

/// Returns the id that a layer has: a text, or a number in early versions.
fn segment_id(layer: &Value) -> Option<String> {
    let id = layer.get("metaData")?.get("segmentId")?;
    id.as_str().map(str::to_owned).or_else(|| id.as_i64().map(|number| number.to_string()))
}

fn target(place: &Place, frame: &RobotFrame) -> Target {
    let Place { id, name, class, room, zone, goal, .. } = place.clone();
    let zones: Vec<Zone> = zone.rectangles.iter().map(|rectangle| of_rectangle(rectangle, frame)).collect();
    Target {
        id,
        name,
        class,
        room,
        zone_cleaning: (!zones.is_empty()).then_some(ZoneCleaning { action: "clean", zones }),
        covered: super::round(zone.covered),
        go_to: goal
            .map(|goal| GoTo { action: "goto", coordinates: frame.rounded([goal.x_m, goal.y_m]).into() }),
        goal,
    }
}

fn of_rectangle(rectangle: &Rectangle, frame: &RobotFrame) -> Zone {
    let ([left, bottom], [right, top]) = (rectangle.low_m, rectangle.high_m);
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    let [p_a, p_b, p_c, p_d] = corners.map(|corner| frame.rounded(corner).into());
    Zone { points: Corners { p_a, p_b, p_c, p_d }, iterations: 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A segment without cells has about 60 bytes.
    #[test]
    fn a_map_of_very_many_segments_is_named_soon() {
        const COUNT: usize = 100_000;
        let layer = |id: usize| json!({"type": "segment", "metaData": {"segmentId": id.to_string()}});
        let file = json!({"layers": (0..COUNT).map(layer).collect::<Vec<Value>>()}).to_string();
        let name = |id: usize| Some(format!("Room {id}"));
        let segment =
            |id: usize| SegmentName { segment: id.to_string(), room: None, name: name(id), overlap: 1.0 };
        let map = named(Some(file.as_bytes()), &(0..COUNT).map(segment).collect::<Vec<_>>()).unwrap();
        for id in [0, COUNT / 2, COUNT - 1] {
            assert_eq!(map["layers"][id]["metaData"]["name"].as_str(), name(id).as_deref());
        }
    }
}
