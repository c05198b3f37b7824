//! Identity of a home's objects and rooms over the revisions of its map.
//!
//! An object keeps its id while it is where it was. The next revision's objects are assigned to the known
//! ones by class, overlap of the boxes and distance; an object without a known one gets an id that the home
//! never used. Rooms of the robot's software keep its ids; computed rooms are assigned by their common area.
//!
//! Ids are the one part of the map with a history: the rest is a function of the set of clips, while ids
//! also depend on the order in which the clips came. The history is a part of each revision.

mod assignment;
mod changes;
mod evidence;
mod frames;
mod known;
mod likeness;
mod stated;

pub use changes::{MovedObject, ObjectChanges, RevisionObjects, object_changes};
pub use evidence::KnownPoint;
pub use frames::map_from_earlier;
pub use known::{KnownObject, MIN_MOVE_M};
pub use stated::{Stated, Statement};

use super::assemble::LookedThrough;
use super::level_ids::{on_level, own_part};
use super::objects::Object;
use super::rooms::{Room, RoomSource};
use assignment::{Candidate, best_pairs};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::taxonomy::Class;
use viola_geometry::{LevelName, Point2, Pose2};

/// Revisions for which an object or a room that is not found is remembered: as many as are kept, so that
/// nothing of a deleted clip outlives them. Of an object whose clips are in the map only those revisions count that
/// rebuilt its place.
const REMEMBERED: u32 = 5;
/// Maximum number of objects that are remembered without being found.
const MAX_MISSING: usize = 500;
/// Name of the counter of computed rooms. No class has it.
const ROOM_NUMBERS: &str = "room";

/// A room that had an id, where it was last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownRoom {
    pub id: String,
    pub source: RoomSource,
    pub polygon_m: Vec<[f64; 2]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes_m: Vec<Vec<[f64; 2]>>,
    pub missing: u32,
}

/// Ids of the earlier revisions of one level; input of the next one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct History {
    /// Ids on other levels than `main` begin with the level's name.
    #[serde(default, skip_serializing_if = "LevelName::is_main")]
    level: LevelName,
    /// The highest number that was given out for each class, and for rooms.
    numbers: BTreeMap<String, u32>,
    pub objects: Vec<KnownObject>,
    pub rooms: Vec<KnownRoom>,
}

impl History {
    /// Returns the history of objects and rooms that have ids already, as of a map without a history.
    pub fn of(objects: Vec<KnownObject>, rooms: &[Room]) -> History {
        let number = rooms.iter().filter_map(|room| room.id.parse().ok()).max().unwrap_or(0);
        let numbers = BTreeMap::from([(ROOM_NUMBERS.to_owned(), number)]);
        let rooms = rooms.iter().map(known_room).collect();
        let mut history = History { numbers, rooms, ..History::default() };
        objects.iter().for_each(|known| history.take_number_of(&known.id));
        History { objects, ..history }
    }

    /// Returns the empty history of a level.
    pub fn of_level(level: LevelName) -> History {
        History { level, ..History::default() }
    }

    /// Returns the history without objects and rooms: it gives out no id again.
    pub fn without_places(mut self) -> History {
        self.take_numbers_of_robot();
        History { objects: Vec::new(), rooms: Vec::new(), ..self }
    }

    /// Brings the known places into the frame of another LiDAR map.
    pub fn move_by(&mut self, now_from_then: &Pose2) {
        for known in &mut self.objects {
            known.move_by(now_from_then);
        }
        for room in &mut self.rooms {
            for corner in std::iter::once(&mut room.polygon_m).chain(&mut room.holes_m).flatten() {
                let at = now_from_then.apply(&Point2::from(*corner));
                *corner = [at.x, at.y];
            }
        }
    }

    /// Gives the objects of the next revision their ids, and remembers these objects. `looked`: the space
    /// that the clips of the next revision looked through. The rest of an object that is gone is no object.
    pub fn identify_objects(&mut self, objects: &mut Vec<Object>, stated: &Stated, looked: &LookedThrough) {
        self.remember_stated(stated);
        self.name_objects(objects, stated, looked);
        let known: BTreeMap<&str, &KnownObject> =
            self.objects.iter().map(|known| (known.id.as_str(), known)).collect();
        let mut left_over: BTreeSet<String> = BTreeSet::new();
        objects.retain(|object| {
            let known = known.get(object.id.as_str()).filter(|known| !stated.contains_key(&known.id));
            let is_left_over = known.is_some_and(|known| known.is_left_over(object, looked));
            if is_left_over {
                left_over.insert(object.id.clone());
            }
            !is_left_over
        });
        let found: BTreeSet<&str> = objects.iter().map(|object| object.id.as_str()).collect();
        let (last, mut missing): (Vec<KnownObject>, Vec<KnownObject>) =
            self.objects.drain(..).partition(|known| found.contains(known.id.as_str()));
        for known in &mut missing {
            // A forgotten object's leftovers would be a new object.
            known.missing = if left_over.contains(&known.id) { 0 } else { known.missing };
            known.miss(looked);
        }
        missing.retain(|known| known.missing <= REMEMBERED || stated.contains_key(&known.id));
        missing.sort_by(|a, b| {
            let forgotten_first = |known: &KnownObject| !stated.contains_key(&known.id);
            forgotten_first(a).cmp(&forgotten_first(b)).then(a.missing.cmp(&b.missing)).then(a.id.cmp(&b.id))
        });
        missing.truncate(MAX_MISSING.max(stated.len()));
        let last: BTreeMap<&str, &KnownObject> =
            last.iter().map(|known| (known.id.as_str(), known)).collect();
        let known =
            |object: &Object| KnownObject::next(object, last.get(object.id.as_str()).copied(), looked);
        self.objects = objects.iter().map(known).chain(missing).collect();
    }

    /// Gives the objects the ids of the known ones that they are, and new ids to the others. Leaves out an unknown object
    /// in a place from which a person moved one.
    fn name_objects(&mut self, objects: &mut Vec<Object>, stated: &Stated, looked: &LookedThrough) {
        let mut candidates = Vec::new();
        for (row, known) in self.objects.iter().enumerate() {
            let statement = stated.get(&known.id);
            for (column, score) in likeness::of_objects(known, statement, objects, looked) {
                // Squared: otherwise a third, weak pair is worth an exchange of two objects that stayed.
                candidates.push(Candidate { row, column, score: score * score });
            }
        }
        let mut ids: Vec<Option<String>> = vec![None; objects.len()];
        for (row, column) in best_pairs(&candidates) {
            ids[column] = Some(self.objects[row].id.clone());
        }
        let is_left_over =
            |object: &Object| stated.values().any(|statement| statement.is_left_over(object, looked));
        let named = objects.drain(..).zip(ids).filter(|(object, id)| id.is_some() || !is_left_over(object));
        for (object, id) in named.collect::<Vec<_>>() {
            let id = id.unwrap_or_else(|| {
                let number = self.next_number(object.class.name());
                on_level(self.level, format!("{}-{number}", object.class.name()))
            });
            objects.push(Object { id, ..object });
        }
    }

    /// Gives computed rooms their ids.
    pub fn identify_rooms(&mut self, rooms: &mut [Room]) {
        self.take_numbers_of_robot();
        let mut candidates = Vec::new();
        for (row, known) in self.rooms.iter().enumerate() {
            for (column, room) in rooms.iter().enumerate() {
                // The ids of the robot's software are not ours to give.
                let are_both_computed = [known.source, room.source] == [RoomSource::Computed; 2];
                let score = are_both_computed.then(|| likeness::of_rooms(known, room)).flatten();
                candidates.extend(score.map(|score| Candidate { row, column, score }));
            }
        }
        let mut ids: Vec<Option<String>> = vec![None; rooms.len()];
        for (row, column) in best_pairs(&candidates) {
            ids[column] = Some(self.rooms[row].id.clone());
        }
        for (room, id) in rooms.iter_mut().zip(ids) {
            room.id = match (room.source, id) {
                (RoomSource::LidarMap, _) => on_level(self.level, room.id.clone()),
                (RoomSource::Computed, Some(id)) => id,
                (RoomSource::Computed, None) => {
                    let number = self.next_number(ROOM_NUMBERS);
                    on_level(self.level, number.to_string())
                }
            };
        }
        let found: BTreeSet<&str> = rooms.iter().map(|room| room.id.as_str()).collect();
        let mut missing: Vec<KnownRoom> =
            self.rooms.drain(..).filter(|known| !found.contains(known.id.as_str())).collect();
        missing.iter_mut().for_each(|known| known.missing = known.missing.saturating_add(1));
        missing.retain(|known| known.missing <= REMEMBERED);
        self.rooms = rooms.iter().map(known_room).chain(missing).collect();
    }

    /// Knows corrected objects that were forgotten, or that came from a map without a history.
    fn remember_stated(&mut self, stated: &Stated) {
        for (id, statement) in stated {
            self.take_number_of(id);
            if self.objects.iter().any(|known| known.id == *id) {
                continue;
            }
            let class = own_part(id).rsplit_once('-').map_or("", |(class, _)| class);
            let class = Class::ALL.iter().copied().find(|one| one.name() == class).unwrap_or(Class::Other);
            self.objects.push(KnownObject::found(id.clone(), class, &statement.bounds));
        }
    }

    fn next_number(&mut self, of: &str) -> u32 {
        let number = self.numbers.entry(of.to_owned()).or_default();
        *number = number.saturating_add(1);
        *number
    }

    /// Makes sure that no computed room gets the id of one of the robot's: a correction of that one may be kept by its id.
    fn take_numbers_of_robot(&mut self) {
        let of_robot = self.rooms.iter().filter(|known| known.source == RoomSource::LidarMap);
        // Larger numbers are hashes, which the counter does not reach.
        let highest = of_robot.filter_map(|known| own_part(&known.id).parse::<u16>().ok()).max();
        if let Some(highest) = highest {
            self.take_number(ROOM_NUMBERS, u32::from(highest));
        }
    }

    /// Makes sure that an id is not given out again.
    fn take_number_of(&mut self, id: &str) {
        let Some((class, number)) = own_part(id).rsplit_once('-') else { return };
        let Ok(number) = number.parse::<u32>() else { return };
        self.take_number(class, number);
    }

    fn take_number(&mut self, of: &str, number: u32) {
        let highest = self.numbers.entry(of.to_owned()).or_default();
        *highest = number.max(*highest);
    }
}

fn known_room(room: &Room) -> KnownRoom {
    let Room { id, source, polygon_m, holes_m, .. } = room.clone();
    KnownRoom { id, source, polygon_m, holes_m, missing: 0 }
}

#[cfg(test)]
mod tests;
