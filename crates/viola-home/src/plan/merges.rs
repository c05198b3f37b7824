//! Rooms that people made of several: no doorway divides them.

use super::evidence::Evidence;
use super::gaps::Gap;
use crate::rooms::Room;
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::{Point2, Vector2};

/// Places of the samples beside a gap: parts of its width, and distances from its wall.
const ALONG: [f64; 3] = [0.25, 0.5, 0.75];
const BESIDE_M: [f64; 5] = [0.05, 0.1, 0.2, 0.3, 0.4];

/// Numbers from 1 of the rooms that people made of several.
pub(super) struct Merges(BTreeSet<u32>);

impl Merges {
    /// `found` are the rooms before people corrected them.
    pub fn new(found: &[Room], rooms: &[Room]) -> Merges {
        // A merged room holds the labels of all its parts, any other one its own.
        let parts =
            |room: &Room| found.iter().filter(|part| room.contains(&Point2::from(part.label_at_m))).count();
        Merges((1..).zip(rooms).filter(|(_, room)| parts(room) > 1).map(|(number, _)| number).collect())
    }

    /// Returns whether a gap is within a merged room.
    pub fn hold(&self, gap: &Gap, evidence: &Evidence) -> bool {
        let [room, other] = [-1.0, 1.0].map(|sign| {
            let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
            for room in beside(gap, sign).iter().map(|place| evidence.room(place)).filter(|room| *room != 0) {
                *counts.entry(room).or_default() += 1;
            }
            let most = counts.into_iter().max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)));
            most.map(|(room, _)| room)
        });
        room == other && room.is_some_and(|room| self.0.contains(&room))
    }
}

/// Returns places on one side of a gap.
fn beside(gap: &Gap, sign: f64) -> Vec<Point2> {
    let [from, to] = gap.ends_m.map(Point2::from);
    let along = to - from;
    let across = Vector2::new(-along.y, along.x).normalize() * sign;
    let place = |part: f64, off_m: f64| from + along * part + across * (gap.thickness_m / 2.0 + off_m);
    ALONG.iter().flat_map(|part| BESIDE_M.map(|off_m| place(*part, off_m))).collect()
}
