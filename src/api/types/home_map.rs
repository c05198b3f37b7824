//! A home's fused map: revisions, rooms, objects, coverage.

use super::clip::{ClipState, PlacedBy};
use super::correction::{ObjectField, RoomField};
use super::job::Reason;
use super::names::{HomeId, LevelName, Pose2};
use super::{Answer, answer};
use jiff::Timestamp;
use uuid::Uuid;

answer! {
    /// The part of the LiDAR map that was seen.
    struct Coverage from viola_home::Coverage {
        /// Fraction of the LiDAR map's occupied points that the fused map explains: it has a surface other than the floor
        /// within 10 cm of it, below 2 m. 0 for a map without such points.
        seen: f64,
        /// Fraction of the LiDAR map's free area over which the fused map has the floor or an object on it. 0
        /// for a map without free area.
        floor_seen: f64,
        by_room: Vec<RoomCoverage>,
    }
}

answer! {
    /// The part of one room that was seen.
    struct RoomCoverage from viola_home::RoomCoverage {
        /// Id of the room.
        room: String,
        /// Fraction of the occupied points in the room and at its walls.
        seen: f64,
        floor_seen: f64,
    }
}

answer! {
    /// Contents of a home's map.
    struct HomeMapInfo from viola_home::HomeMapInfo {
        points: usize,
        voxel_m: f64,
        /// Corners of its bounding box, in the LiDAR map's frame; null if it is empty or has several levels.
        #[schema(min_items = 3, max_items = 3, example = json!([0.2, 0.1, 0.0]))]
        min_m: Option<[f32; 3]>,
        #[schema(min_items = 3, max_items = 3, example = json!([9.8, 7.1, 2.5]))]
        max_m: Option<[f32; 3]>,
        /// Points by class, the largest first.
        classes: Vec<ClassCount>,
    }
}

answer! {
    struct ClassCount from viola_home::ClassCount {
        #[schema(example = "floor")]
        class: String,
        points: usize,
    }
}

answer! {
    /// Source of a room.
    enum RoomSource from viola_home::RoomSource {
        /// A segment of the robot's software.
        LidarMap,
        /// Computed from the map.
        Computed,
    }
}

/// A room, in the LiDAR map's frame.
#[derive(Debug, Clone, PartialEq, serde::Serialize, utoipa::ToSchema)]
pub(in crate::api) struct Room {
    /// The robot's own id; that of a computed room is the same in the next revisions while the room is in the same
    /// place.
    id: String,
    /// The level in whose LiDAR map it is.
    level: LevelName,
    name: Option<String>,
    source: RoomSource,
    /// Area of the polygon without its holes, in square metres.
    area_m2: f64,
    /// The outer ring, counter-clockwise; the last corner is not the first one again.
    polygon_m: Vec<[f64; 2]>,
    /// Rings inside, clockwise.
    holes_m: Vec<Vec<[f64; 2]>>,
    /// A point inside, far from the border, for a label.
    label_at_m: [f64; 2],
    /// Properties that a person corrected.
    corrected: Vec<RoomField>,
}

impl From<viola_storage::MapRoom> for Room {
    fn from(source: viola_storage::MapRoom) -> Room {
        let room = source.room;
        Room {
            id: room.id,
            level: LevelName::answer(source.level),
            name: room.name,
            source: room.source.into(),
            area_m2: room.area_m2,
            polygon_m: room.polygon_m,
            holes_m: room.holes_m,
            label_at_m: room.label_at_m,
            corrected: source.corrected.into_iter().map(RoomField::from).collect(),
        }
    }
}

answer! {
    /// One state of a home's fused map. It never changes.
    struct HomeMap from viola_storage::HomeMap {
        /// Counts from 1; the highest is the current one.
        #[schema(minimum = 1, example = 4)]
        revision: i64,
        /// The newest revision of the LiDAR maps that it is made of.
        #[schema(minimum = 1, example = 1)]
        lidar_map_revision: i64,
        /// Its levels, by their names: each has the frame of its own LiDAR map.
        levels: Vec<MapLevel>,
        /// The clips in it, in an order independent of their arrival; points name a clip by its index here.
        clips: Vec<MapClip>,
        info: HomeMapInfo,
        created_at: Timestamp,
    }
}

answer! {
    /// State of a home's newest map:
    /// - `current`: it has every change of the home. A home without clips and without a map is `current` too.
    /// - `due`: changes of the home wait for the next merge, which comes by itself.
    /// - `failing`: changes wait, and at least two merges in a row have failed. The service tries again after pauses of up to
    ///   30 minutes; read its log for the cause.
    enum MapState from viola_storage::MapState {
        Current,
        Due,
        Failing,
    }
}

answer! {
    /// One level of a home's map.
    struct MapLevel from viola_storage::MapLevel {
        level: LevelName,
        /// The LiDAR map in whose frame it is.
        #[schema(minimum = 1, example = 1)]
        lidar_map_revision: i64,
        info: HomeMapInfo,
    }
}

answer! {
    /// A clip in a home's map.
    struct MapClip from viola_storage::MapClip {
        clip: Uuid,
        /// The level in whose LiDAR map it is.
        level: LevelName,
        /// Refined together with the clips that it overlaps.
        map_from_clip: Pose2,
        /// As `rise_m` of the clip's placement.
        #[schema(required = false)]
        rise_m: f64,
        by: PlacedBy,
        /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1; null if a person chose it.
        #[schema(minimum = 0, maximum = 1, example = 0.97)]
        probability: Option<f64>,
        recorded_at: Option<Timestamp>,
        /// Points that the clip brought.
        points: usize,
        /// Distance in metres by which the refinement moved the clip's origin from its own alignment.
        moved_m: f64,
        /// Angle in degrees by which it turned the clip.
        moved_deg: f64,
    }
}

answer! {
    /// A clip that is not in its home's map, with the reasons.
    struct LeftOut from viola_storage::LeftOut {
        clip: Uuid,
        state: ClipState,
        reasons: Vec<Reason>,
        /// The oldest clip of the home with the same recording, of which the map takes one; null if this is it.
        duplicate_of: Option<Uuid>,
    }
}

answer! {
    /// An object in a home, in the LiDAR map's frame: an upright box and its properties.
    struct MapObject from viola_storage::MapObject {
        /// The same in the next revisions while the object is in the same place, even if its class changes. No other
        /// object of the home ever has it.
        #[schema(example = "sofa-1")]
        id: String,
        /// The level in whose LiDAR map it is.
        level: LevelName,
        #[schema(example = "sofa")]
        class: String,
        /// 0..1, from the share of its points' evidence for this class and from the fit of its size.
        confidence: f64,
        #[schema(min_items = 3, max_items = 3, example = json!([2.1, 3.4, 0.4]))]
        centre_m: [f64; 3],
        /// Along its own x, y and z: length, width, height. The length is not the shorter of the two.
        #[schema(min_items = 3, max_items = 3)]
        size_m: [f64; 3],
        /// Direction of its own x axis, in [0, pi).
        yaw_rad: f64,
        /// Id of the room that it is in.
        room: Option<String>,
        /// Points of the map.
        points: usize,
        /// The clips that saw a substantial share of it.
        clips: Vec<Uuid>,
        /// Time of recording of the newest of those clips, if it is known.
        last_seen: Option<Timestamp>,
        /// Name that a person gave it.
        name: Option<String>,
        /// Properties that a person corrected.
        corrected: Vec<ObjectField>,
    }
}

answer! {
    /// An object and its home.
    struct HomeObject from viola_storage::HomeObject {
        home: HomeId,
        #[serde(flatten)]
        object: MapObject,
    }
}
