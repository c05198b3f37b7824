//! Gaps within one room, which divide nothing: people merged the rooms beside them, or they are in a room of the robot's
//! software. Rooms that people corrected need no gap beside them.

use super::evidence::Evidence;
use super::gaps::Gap;
use crate::rooms::{Room, RoomSource};
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::{Point2, Vector2};

/// Places of the samples beside a gap: parts of its width, and distances from its wall.
const ALONG: [f64; 3] = [0.25, 0.5, 0.75];
const BESIDE_M: [f64; 5] = [0.05, 0.1, 0.2, 0.3, 0.4];

/// Numbers from 1 of the rooms that no gap divides.
pub(super) struct Merges {
    /// People made them of several.
    by_people: BTreeSet<u32>,
    of_robot: BTreeSet<u32>,
    /// People named, divided or merged them. A room that lines divide has the number of its first part.
    corrected: BTreeSet<u32>,
}

impl Merges {
    /// `found` are the rooms before people corrected them; `roots` are those of [`super::divide::roots`].
    pub fn new(found: &[Room], rooms: &[Room], roots: &[u32]) -> Merges {
        // A merged room and its parts hold the labels of all rooms of which it was made, any other one its own.
        let mut labels: BTreeMap<u32, usize> = BTreeMap::new();
        for part in found {
            let label = Point2::from(part.label_at_m);
            if let Some(at) = rooms.iter().position(|room| room.contains(&label)) {
                *labels.entry(roots[at + 1]).or_default() += 1;
            }
        }
        let is_merged = |number: &u32| labels.get(&roots[*number as usize]).is_some_and(|count| *count > 1);
        let mut parts: BTreeMap<u32, usize> = BTreeMap::new();
        roots.iter().for_each(|root| *parts.entry(*root).or_default() += 1);
        let is_divided = |number: &u32| parts.get(&roots[*number as usize]).is_some_and(|count| *count > 1);
        let numbered = || (1u32..).zip(rooms);
        let of_robot = numbered().filter(|(_, room)| room.source == RoomSource::LidarMap);
        let corrected = numbered()
            .filter(|(number, room)| room.name.is_some() || is_divided(number) || is_merged(number));
        Merges {
            by_people: (1..=rooms.len() as u32).filter(is_merged).collect(),
            of_robot: of_robot.map(|(number, _)| number).collect(),
            corrected: corrected.map(|(number, _)| roots[number as usize]).collect(),
        }
    }

    /// Returns whether people named, divided or merged a room: it is one without a wall beside it.
    pub fn is_corrected(&self, room: u32) -> bool {
        self.corrected.contains(&room)
    }

    /// Returns whether a gap is within one of the rooms.
    pub fn hold(&self, gap: &Gap, evidence: &Evidence) -> bool {
        let room = room_around(gap, evidence);
        room.is_some_and(|room| self.by_people.contains(&room) || self.of_robot.contains(&room))
    }

    /// Returns whether a gap within one of the rooms is a doorway: wall was seen above it, or it divided the rooms that
    /// people merged.
    pub fn is_doorway(&self, gap: &Gap, evidence: &Evidence) -> bool {
        gap.has_lintel || room_around(gap, evidence).is_some_and(|room| self.by_people.contains(&room))
    }
}

/// Returns the room that is on both sides of a gap.
fn room_around(gap: &Gap, evidence: &Evidence) -> Option<u32> {
    let [room, other] = [-1.0, 1.0].map(|sign| {
        let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
        let places = beside(gap, sign);
        for room in places.iter().map(|place| evidence.divided_room(place)).filter(|room| *room != 0) {
            *counts.entry(room).or_default() += 1;
        }
        let most = counts.into_iter().max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)));
        most.map(|(room, _)| room)
    });
    room.filter(|_| room == other)
}

/// Returns places on one side of a gap.
fn beside(gap: &Gap, sign: f64) -> Vec<Point2> {
    let [from, to] = gap.ends_m.map(Point2::from);
    let along = to - from;
    let across = Vector2::new(-along.y, along.x).normalize() * sign;
    let place = |part: f64, off_m: f64| from + along * part + across * (gap.thickness_m / 2.0 + off_m);
    ALONG.iter().flat_map(|part| BESIDE_M.map(|off_m| place(*part, off_m))).collect()
}
