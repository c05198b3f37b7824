//! Names under which the files of a level show its rooms and objects.

use super::RobotLevel;
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
        let rooms: Vec<String> = level.rooms.iter().map(|room| names.unused(room.title())).collect();
        let mut objects = Vec::new();
        for object in &level.objects {
            let room = level.rooms.iter().position(|room| Some(&room.id) == object.room.as_ref());
            let title = object.title();
            objects.push(names.unused(match room.and_then(|index| rooms.get(index)) {
                Some(room) => format!("{room}: {title}"),
                None => title,
            }));
        }
        Titles { rooms, objects }
    }
}

/// The names that were given.
#[derive(Default)]
struct Names {
    taken: BTreeSet<String>,
    /// The last number of each name.
    numbers: BTreeMap<String, usize>,
}

impl Names {
    /// Returns the name, with a number if it is taken.
    fn unused(&mut self, name: String) -> String {
        let number = self.numbers.entry(name.clone()).or_default();
        loop {
            *number += 1;
            let found = numbered(&name, *number);
            if self.taken.insert(found.clone()) {
                return found;
            }
        }
    }
}

/// Returns a name with its number, at most [`MAX_TITLE`] long; the first one has no number.
fn numbered(name: &str, number: usize) -> String {
    let ending = if number == 1 { String::new() } else { format!(" {number}") };
    cut(name, MAX_TITLE - ending.len()) + &ending
}

/// Returns the longest beginning of a text that has at most `max` bytes.
pub fn cut(text: &str, max: usize) -> String {
    let end = (0..=max.min(text.len())).rev().find(|end| text.is_char_boundary(*end));
    text[..end.unwrap_or(0)].to_owned()
}
