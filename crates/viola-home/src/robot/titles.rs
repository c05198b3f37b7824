//! Names under which the files of a level show its rooms and objects.

use super::RobotLevel;
use super::segments::Segment;
use crate::rooms::Room;
use std::collections::{BTreeMap, BTreeSet};

/// Maximum length of a name in bytes: that of Matter, since all files have the same names.
const MAX_TITLE: usize = 128;

/// The names of a level's rooms and objects, in its order. No two are the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Titles {
    pub rooms: Vec<String>,
    /// An object's name begins with that of its room.
    pub objects: Vec<String>,
}

impl Titles {
    pub fn of(level: &RobotLevel) -> Titles {
        let mut names = Names::default();
        let rooms = names.all(level.rooms.iter().map(Room::title).collect());
        let objects = level.objects.iter().map(|object| {
            let room = level.rooms.iter().position(|room| Some(&room.id) == object.room.as_ref());
            let title = object.title();
            match room.and_then(|index| rooms.get(index)) {
                Some(room) => format!("{room}: {title}"),
                None => title,
            }
        });
        let objects = names.all(objects.collect());
        Titles { rooms, objects }
    }

    /// Returns the names of the robot's segments, in their order; none for a segment without a room. Several segments of
    /// one room, as after a merge of rooms, have numbers, since a person must tell them apart.
    pub fn segments(&self, level: &RobotLevel, segments: &[Segment]) -> Vec<Option<String>> {
        let title = |segment: &Segment| {
            let room = segment.room?;
            level.rooms.iter().position(|other| other.id == room.id).and_then(|index| self.rooms.get(index))
        };
        let titles: Vec<Option<&String>> = segments.iter().map(title).collect();
        // The rooms' own names stay theirs, also those of rooms without a segment.
        let mut names = Names::default();
        names.reserved.extend(self.rooms.iter().cloned());
        let mut unique = names.all(titles.iter().copied().flatten().cloned().collect()).into_iter();
        titles.iter().map(|title| title.and_then(|_| unique.next())).collect()
    }
}

/// The names that were given.
#[derive(Default)]
struct Names {
    taken: BTreeSet<String>,
    /// Names that belong to somebody: no number makes another name one of these.
    reserved: BTreeSet<String>,
    /// The last number of each name.
    numbers: BTreeMap<String, usize>,
}

impl Names {
    /// Returns the names in their order, the repeated ones with numbers. No number makes a name that of another one.
    fn all(&mut self, names: Vec<String>) -> Vec<String> {
        self.reserved.extend(names.iter().map(|name| numbered(name, 1)));
        names.into_iter().map(|name| self.unused(name)).collect()
    }

    /// Returns the name, with a number if it is taken.
    fn unused(&mut self, name: String) -> String {
        let number = self.numbers.entry(name.clone()).or_default();
        loop {
            *number += 1;
            let found = numbered(&name, *number);
            let is_reserved = *number > 1 && self.reserved.contains(&found);
            if !is_reserved && self.taken.insert(found.clone()) {
                return found;
            }
        }
    }
}

/// Returns a name with its number, at most [`MAX_TITLE`] long; the first one has no number. Some robots' maps have names with
/// blanks at their ends.
fn numbered(name: &str, number: usize) -> String {
    let ending = if number == 1 { String::new() } else { format!(" {number}") };
    cut(name.trim(), MAX_TITLE - ending.len()) + &ending
}

/// Returns the longest beginning of a text that has at most `max` bytes.
pub fn cut(text: &str, max: usize) -> String {
    let end = (0..=max.min(text.len())).rev().find(|end| text.is_char_boundary(*end));
    text[..end.unwrap_or(0)].to_owned()
}
