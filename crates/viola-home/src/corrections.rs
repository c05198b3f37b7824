//! Corrections of people: they are applied to what was found in the clips, and kept apart from it.
//!
//! A correction of an object is held by the object's id, which [`super::identity`] keeps. A correction of a
//! room is held by a point inside the room, since every LiDAR map divides the rooms differently. Places are in the
//! map's frame, and move with it when a new LiDAR map has another one.

mod keys;

use super::identity::{Stated, Statement};
use super::objects::{Object, UprightBox, half_turn};
use super::rooms::{Room, merged, room_at, split};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2};

/// Largest distance of a corrected room from the point that holds the correction.
const ROOM_REACH_M: f64 = 1.0;

/// A corrected property of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectField {
    Class,
    Name,
    CentreM,
    SizeM,
    YawRad,
    Pinned,
}

/// A corrected property of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoomField {
    Name,
    MergeWith,
    SplitBy,
}

/// An object as the map had it when it was corrected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    pub class: Class,
    pub confidence: f64,
    pub centre_m: [f64; 3],
    pub size_m: [f64; 3],
    pub yaw_rad: f64,
}

impl Seen {
    fn bounds(&self) -> UprightBox {
        UprightBox { centre_m: self.centre_m, size_m: self.size_m, yaw_rad: self.yaw_rad }
    }
}

/// A person's correction of an object; `None` leaves what was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectCorrection {
    pub class: Option<Class>,
    pub name: Option<String>,
    pub centre_m: Option<[f64; 3]>,
    pub size_m: Option<[f64; 3]>,
    pub yaw_rad: Option<f64>,
    /// True if the object stays as it was seen, whatever later clips show.
    pub pinned: bool,
    /// True if the object is not shown.
    pub hidden: bool,
    /// The object when it was first corrected, or when it was pinned.
    pub seen: Seen,
}

impl ObjectCorrection {
    /// Returns a correction of nothing.
    pub fn of(seen: Seen) -> ObjectCorrection {
        ObjectCorrection {
            class: None,
            name: None,
            centre_m: None,
            size_m: None,
            yaw_rad: None,
            pinned: false,
            hidden: false,
            seen,
        }
    }

    /// Returns whether nothing is corrected.
    pub fn is_empty(&self) -> bool {
        *self == ObjectCorrection::of(self.seen.clone())
    }

    /// Brings the places into another frame.
    pub fn move_by(&mut self, now_from_then: &Pose2) {
        let seen = self.seen.bounds().moved(now_from_then);
        (self.seen.centre_m, self.seen.yaw_rad) = (seen.centre_m, seen.yaw_rad);
        if let Some([x, y, z]) = self.centre_m {
            let at = now_from_then.apply(&Point2::new(x, y));
            self.centre_m = Some([at.x, at.y, z]);
        }
        self.yaw_rad = self.yaw_rad.map(|yaw_rad| half_turn(yaw_rad + now_from_then.yaw_rad));
    }

    /// Returns whether the object is in the map even if no clip shows it.
    fn is_kept(&self) -> bool {
        self.pinned || self.centre_m.is_some()
    }

    /// Returns the corrected box of an object that was found with this one.
    fn over(&self, found: &UprightBox) -> UprightBox {
        let base = if self.pinned { self.seen.bounds() } else { *found };
        UprightBox {
            centre_m: self.centre_m.unwrap_or(base.centre_m),
            size_m: self.size_m.unwrap_or(base.size_m),
            yaw_rad: self.yaw_rad.map_or(base.yaw_rad, half_turn),
        }
    }

    fn fields(&self) -> Vec<ObjectField> {
        let fields = [
            (self.class.is_some(), ObjectField::Class),
            (self.name.is_some(), ObjectField::Name),
            (self.centre_m.is_some(), ObjectField::CentreM),
            (self.size_m.is_some(), ObjectField::SizeM),
            (self.yaw_rad.is_some(), ObjectField::YawRad),
            (self.pinned, ObjectField::Pinned),
        ];
        fields.into_iter().filter(|(is_set, _)| *is_set).map(|(_, field)| field).collect()
    }
}

/// The corrected properties of one object or room.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected<Field> {
    /// The key of the correction, or of the first one to come.
    pub key: String,
    pub name: Option<String>,
    pub fields: Vec<Field>,
}

impl<Field> Corrected<Field> {
    fn nothing(key: String) -> Corrected<Field> {
        Corrected { key, name: None, fields: Vec::new() }
    }
}

/// Returns what corrections state, for [`super::History::identify_objects`]. `times_ms` are the times of the corrections.
pub fn stated(corrections: &[(String, ObjectCorrection)], times_ms: impl IntoIterator<Item = i64>) -> Stated {
    let statement = |correction: &ObjectCorrection, stated_at_ms: i64| {
        let seen = correction.seen.bounds();
        Statement {
            bounds: correction.over(&seen),
            put_from: correction.centre_m.map(|_| seen),
            is_hidden: correction.hidden,
            stated_at_ms,
        }
    };
    let timed = corrections.iter().zip(times_ms);
    timed.map(|((id, correction), time_ms)| (id.clone(), statement(correction, time_ms))).collect()
}

/// Applies corrections to the objects, which have their lasting ids. Returns what was corrected by id, and
/// the ids of the hidden objects.
pub fn correct_objects(
    objects: &mut Vec<Object>,
    corrections: &[(String, ObjectCorrection)],
) -> (BTreeMap<String, Corrected<ObjectField>>, BTreeSet<String>) {
    let (mut corrected, mut hidden) = (BTreeMap::new(), BTreeSet::new());
    for (id, correction) in corrections {
        if correction.hidden {
            objects.retain(|object| object.id != *id);
            hidden.insert(id.clone());
            continue;
        }
        if !objects.iter().any(|object| object.id == *id) && correction.is_kept() {
            objects.push(unseen(id, &correction.seen));
        }
        let Some(object) = objects.iter_mut().find(|object| object.id == *id) else { continue };
        if correction.pinned {
            object.class = correction.seen.class;
        }
        object.class = correction.class.unwrap_or(object.class);
        let UprightBox { centre_m, size_m, yaw_rad } = correction.over(&object.bounds());
        (object.centre_m, object.size_m, object.yaw_rad) = (centre_m, size_m, yaw_rad);
        let fields = correction.fields();
        if !fields.is_empty() {
            let key = id.clone();
            corrected.insert(id.clone(), Corrected { key, name: correction.name.clone(), fields });
        }
    }
    (corrected, hidden)
}

fn unseen(id: &str, seen: &Seen) -> Object {
    Object { id: id.to_owned(), ..Object::new(seen.class, seen.confidence, &seen.bounds(), 0) }
}

/// The rooms that are one with another, each by a point inside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoomMerge {
    pub with_m: Vec<[f64; 2]>,
    /// Merges and splits are applied in the order in which people made them.
    pub order: i64,
}

/// The line through two points that divides a room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoomSplit {
    pub from_m: [f64; 2],
    pub to_m: [f64; 2],
    pub order: i64,
}

/// A person's correction of the room around a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoomCorrection {
    pub name: Option<String>,
    pub merge: Option<RoomMerge>,
    pub split: Option<RoomSplit>,
    /// A point inside the room, far from its border.
    pub at_m: [f64; 2],
}

impl RoomCorrection {
    /// Returns whether nothing is corrected.
    pub fn is_empty(&self) -> bool {
        self.name.is_none() && self.merge.is_none() && self.split.is_none()
    }

    /// Brings the places into another frame.
    pub fn move_by(&mut self, now_from_then: &Pose2) {
        let with = self.merge.iter_mut().flat_map(|merge| &mut merge.with_m);
        let line = self.split.iter_mut().flat_map(|split| [&mut split.from_m, &mut split.to_m]);
        for place in with.chain(line).chain([&mut self.at_m]) {
            let at = now_from_then.apply(&Point2::from(*place));
            *place = [at.x, at.y];
        }
    }

    fn order_of(&self, field: RoomField) -> Option<i64> {
        match field {
            RoomField::MergeWith => self.merge.as_ref().map(|merge| merge.order),
            RoomField::SplitBy => self.split.as_ref().map(|split| split.order),
            RoomField::Name => self.name.as_ref().map(|_| i64::MAX),
        }
    }
}

/// A line through two points that divides two rooms.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomDivision {
    pub from_m: [f64; 2],
    pub to_m: [f64; 2],
    /// Ids of the rooms on its sides.
    pub rooms: [String; 2],
}

/// The corrections that were applied to the rooms.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CorrectedRooms {
    /// The corrected properties, by the room's id.
    pub by_id: BTreeMap<String, Corrected<RoomField>>,
    pub divisions: Vec<RoomDivision>,
}

/// Applies corrections to the rooms. A correction that a new LiDAR map made impossible, such as a merge of rooms that no
/// longer meet, is left out.
pub fn correct_rooms(rooms: &mut Vec<Room>, corrections: &[(String, RoomCorrection)]) -> CorrectedRooms {
    let all = corrections.iter().flat_map(|(key, correction)| {
        [RoomField::MergeWith, RoomField::SplitBy, RoomField::Name]
            .into_iter()
            .filter_map(move |field| Some((correction.order_of(field)?, key, field, correction)))
    });
    let mut all: Vec<_> = all.collect();
    all.sort_by_cached_key(|(order, key, ..)| ((*order).max(divided_at(key, corrections)), *key, *order));
    let mut corrected: BTreeMap<String, Corrected<RoomField>> = BTreeMap::new();
    let mut divisions: Vec<RoomDivision> = Vec::new();
    let mut parts: BTreeSet<String> = BTreeSet::new();
    for (_, key, field, correction) in all {
        let Some(index) = at(rooms, &correction.at_m, Some(key.as_str())) else { continue };
        // A correction of a part is not that of the whole room, which no line divides any more.
        if part_id(&rooms[index].id) == *key && !parts.contains(key) {
            continue;
        }
        let is_done = match field {
            RoomField::MergeWith => {
                correction.merge.as_ref().is_some_and(|merge| join(rooms, index, merge, &mut divisions))
            }
            RoomField::SplitBy => {
                let division = correction.split.as_ref().and_then(|line| cut(rooms, index, line, correction));
                let is_done = division.is_some();
                parts.extend(division.iter().map(|division| part_id(&division.rooms[0])));
                divisions.extend(division);
                is_done
            }
            // The name of a room that was merged into another is not that of both.
            RoomField::Name => {
                let held = corrected.get(&rooms[index].id).filter(|held| held.key != *key);
                let holder = held.and_then(|held| corrections.iter().find(|(key, _)| *key == held.key));
                let is_named = holder.is_some_and(|(_, holder)| holder.name.is_some());
                if !is_named {
                    rooms[index].name.clone_from(&correction.name);
                }
                !is_named
            }
        };
        let Some(index) = at(rooms, &correction.at_m, Some(key.as_str())).filter(|_| is_done) else {
            continue;
        };
        let of_room =
            corrected.entry(rooms[index].id.clone()).or_insert_with(|| Corrected::nothing(key.clone()));
        of_room.name.clone_from(&rooms[index].name);
        of_room.fields.extend((!of_room.fields.contains(&field)).then_some(field));
    }
    corrected.extend(keys::own_keys(rooms, corrections, &corrected));
    CorrectedRooms { by_id: corrected, divisions }
}

/// Returns the room at a point. Furniture that stands on the point is cut out of its room: then the room is the one with
/// `id`, if that is near, or the nearest one.
fn at(rooms: &[Room], place: &[f64; 2], id: Option<&str>) -> Option<usize> {
    let place = Point2::from(*place);
    let is_known = |room: &Room| Some(room.id.as_str()) == id && room.distance_m(&place) <= ROOM_REACH_M;
    let inside = rooms.iter().position(|room| room.contains(&place));
    inside.or_else(|| rooms.iter().position(is_known)).or_else(|| room_at(rooms, &place, ROOM_REACH_M))
}

/// Joins other rooms to one; returns whether at least one was joined. Lines between rooms that are one now divide nothing.
fn join(rooms: &mut Vec<Room>, index: usize, merge: &RoomMerge, divisions: &mut Vec<RoomDivision>) -> bool {
    let id = rooms[index].id.clone();
    let mut is_done = false;
    for place in &merge.with_m {
        let Some(own) = rooms.iter().position(|room| room.id == id) else { return is_done };
        let Some(other) = at(rooms, place, None).filter(|other| *other != own) else { continue };
        if let Some(both) = merged(&rooms[own], &rooms[other]) {
            rooms[own] = both;
            let joined = rooms.remove(other);
            let beside = divisions.iter_mut().flat_map(|division| &mut division.rooms);
            beside.filter(|beside| **beside == joined.id).for_each(|beside| beside.clone_from(&id));
            divisions.retain(|division| division.rooms[0] != division.rooms[1]);
            is_done = true;
        }
    }
    is_done
}

/// Divides a room; returns the division, or none if the room cannot be divided there.
fn cut(
    rooms: &mut Vec<Room>,
    index: usize,
    line: &RoomSplit,
    correction: &RoomCorrection,
) -> Option<RoomDivision> {
    let other_id = part_id(&rooms[index].id);
    let [from, to, anchor] = [line.from_m, line.to_m, correction.at_m].map(Point2::from);
    if rooms.iter().any(|room| room.id == other_id) {
        return None;
    }
    let [own, other] = split(&rooms[index], &from, &to, &anchor, &other_id)?;
    let division =
        RoomDivision { from_m: line.from_m, to_m: line.to_m, rooms: [own.id.clone(), other.id.clone()] };
    rooms[index] = own;
    rooms.insert(index + 1, other);
    Some(division)
}

/// Returns when the room of a part was divided, which may be after the part was corrected; the lowest number for other rooms.
fn divided_at(key: &str, corrections: &[(String, RoomCorrection)]) -> i64 {
    let is_part = |rest: &str| !rest.is_empty() && rest.trim_start_matches("-b").is_empty();
    let wholes =
        corrections.iter().filter(|(whole, _)| key.strip_prefix(whole.as_str()).is_some_and(is_part));
    wholes.filter_map(|(_, whole)| whole.order_of(RoomField::SplitBy)).max().unwrap_or(i64::MIN)
}

/// Returns the id of the part of a divided room that does not keep the room's id.
fn part_id(id: &str) -> String {
    format!("{id}-b")
}

#[cfg(test)]
mod tests;
