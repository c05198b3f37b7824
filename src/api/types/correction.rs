//! Corrections of people, and changes between revisions of a map.

use super::answer;
use super::home_map::{MapObject, Room};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;
use viola_storage::{CorrectionState, Kept};

answer! {
    /// A corrected property of an object.
    enum ObjectField from viola_home::ObjectField {
        Class,
        Name,
        CentreM,
        SizeM,
        YawRad,
        Pinned,
    }
}

answer! {
    /// A corrected property of a room.
    enum RoomField from viola_home::RoomField {
        Name,
        MergeWith,
        SplitBy,
    }
}

/// A person's correction of an object; null where nothing is corrected.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct ObjectCorrection {
    /// Id of the object.
    #[schema(example = "sofa-1")]
    id: String,
    #[schema(example = "bed")]
    class: Option<String>,
    name: Option<String>,
    #[schema(min_items = 3, max_items = 3, example = json!([2.1, 3.4, 0.4]))]
    centre_m: Option<[f64; 3]>,
    #[schema(min_items = 3, max_items = 3)]
    size_m: Option<[f64; 3]>,
    yaw_rad: Option<f64>,
    pinned: bool,
    hidden: bool,
    corrected_at: Timestamp,
}

impl From<Kept<viola_home::ObjectCorrection>> for ObjectCorrection {
    fn from(kept: Kept<viola_home::ObjectCorrection>) -> ObjectCorrection {
        let of = kept.correction;
        ObjectCorrection {
            id: kept.target,
            class: of.class.map(|class| class.name().to_owned()),
            name: of.name,
            centre_m: of.centre_m,
            size_m: of.size_m,
            yaw_rad: of.yaw_rad,
            pinned: of.pinned,
            hidden: of.hidden,
            corrected_at: kept.corrected_at,
        }
    }
}

/// A person's correction of the room around a point; null where nothing is corrected.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct RoomCorrection {
    /// Id of the room when it was first corrected, with a number behind it if another room's correction has that id.
    id: String,
    /// The point: a new LiDAR map may divide the rooms differently, and the room that has the point is corrected.
    at_m: [f64; 2],
    name: Option<String>,
    /// Points in the rooms that are one with it.
    merge_with_m: Option<Vec<[f64; 2]>>,
    split_by: Option<Line>,
    corrected_at: Timestamp,
}

/// The line through two different points.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct Line {
    from_m: [f64; 2],
    to_m: [f64; 2],
}

impl From<Kept<viola_home::RoomCorrection>> for RoomCorrection {
    fn from(kept: Kept<viola_home::RoomCorrection>) -> RoomCorrection {
        let of = kept.correction;
        RoomCorrection {
            id: kept.target,
            at_m: of.at_m,
            name: of.name,
            merge_with_m: of.merge.map(|merge| merge.with_m),
            split_by: of.split.map(|line| Line { from_m: line.from_m, to_m: line.to_m }),
            corrected_at: kept.corrected_at,
        }
    }
}

/// An object of the current map, and the correction that the next revision has
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct CorrectedObject {
    /// Null if the current map does not show it, because it is hidden or no clip shows it.
    object: Option<MapObject>,
    correction: Option<ObjectCorrection>,
}

impl From<CorrectionState<viola_home::ObjectCorrection>> for CorrectedObject {
    fn from(state: CorrectionState<viola_home::ObjectCorrection>) -> CorrectedObject {
        CorrectedObject {
            object: state.shown.map(MapObject::from),
            correction: state.kept.map(ObjectCorrection::from),
        }
    }
}

/// A room of the current map, and the correction that the next revision has
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct CorrectedRoom {
    /// Null if the current map does not have it, because it is a part of another room.
    room: Option<Room>,
    correction: Option<RoomCorrection>,
}

impl From<CorrectionState<viola_home::RoomCorrection>> for CorrectedRoom {
    fn from(state: CorrectionState<viola_home::RoomCorrection>) -> CorrectedRoom {
        CorrectedRoom { room: state.shown.map(Room::from), correction: state.kept.map(RoomCorrection::from) }
    }
}

/// All corrections of a home
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct Corrections {
    objects: Vec<ObjectCorrection>,
    rooms: Vec<RoomCorrection>,
}

impl From<viola_storage::Corrections> for Corrections {
    fn from(all: viola_storage::Corrections) -> Corrections {
        Corrections {
            objects: all.objects.into_iter().map(ObjectCorrection::from).collect(),
            rooms: all.rooms.into_iter().map(RoomCorrection::from).collect(),
        }
    }
}

/// The reason for which an object is not in the map any more:
/// - `seen_again`: a clip that was recorded after the object was last seen looked through its place.
/// - `hidden`: a person hid it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(in crate::api) enum GoneReason {
    SeenAgain,
    Hidden,
}

/// The reason for which an object is not in the map any more, although no clip shows that it is gone:
/// - `clips_removed`: none of the clips that saw it is on its level of the map any more, so nothing is known of the object.
/// - `not_found`: the clips that saw it are still in the map, but the object is not found in it. It may be another object's
///   part now, or be recognised again with its id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(in crate::api) enum LostReason {
    ClipsRemoved,
    NotFound,
}

/// An object that is not in the later revision, although no clip shows that it is gone.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct LostObject {
    pub reason: LostReason,
    pub object: MapObject,
}

/// An object that is gone in the later revision.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct GoneObject {
    pub reason: GoneReason,
    pub object: MapObject,
}

/// An object that is in another place in the later revision.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct MovedObject {
    pub from: MapObject,
    /// With another id, unless a person moved it: ids stay with places.
    pub to: MapObject,
}

/// The changes of a home's objects between two revisions of its map
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub(in crate::api) struct MapChanges {
    /// The earlier revision; 0 is the home before the first.
    #[schema(minimum = 0, example = 3)]
    pub from: i64,
    /// The later revision.
    #[schema(minimum = 1, example = 4)]
    pub to: i64,
    /// Objects of the later revision only, in places that an earlier clip looked through.
    pub added: Vec<MapObject>,
    /// Objects of the later revision that are seen for the first time, without a clip that shows the place empty before.
    /// Without times of recording all new objects are here.
    pub discovered: Vec<MapObject>,
    /// Objects of the later revision that are known from before the earlier one, which did not have them: they were not
    /// recognised, their clips were not in the map, or a person had hidden them.
    pub found_again: Vec<MapObject>,
    /// Objects that are in another place: by their id, or by class and size if one is gone from one place and new
    /// in the other.
    pub moved: Vec<MovedObject>,
    /// Objects of the earlier revision only, in places that a later clip looked through, and hidden ones.
    pub gone: Vec<GoneObject>,
    /// The other objects of the earlier revision only.
    pub lost: Vec<LostObject>,
}
