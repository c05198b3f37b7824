//! Outlines of the map's rooms by the plan.

use super::divide::in_plan;
use super::masonry::{common_m2, united};
use super::model::{Opening, OpeningKind, Plan, PlanRoom, strip};
use crate::rooms::Room;
use crate::rooms::outline::Outline;

/// Minimum fraction of a room's own area in what the plan draws of it.
const HELD: f64 = 0.8;
/// Openings reach this much into the rooms, so that no seam remains before them.
const SEAM_M: f64 = 0.02;
/// The rooms of an opening are this far before its wall.
const BEFORE_M: f64 = 0.1;

impl Plan {
    /// Returns all that the plan draws of a room of the map: one polygon of its parts and the openings between them. None if
    /// the parts do not meet, or if most of the room is elsewhere.
    pub(crate) fn whole_room(&self, room: &Room) -> Option<PlanRoom> {
        let is_part = |part: &&PlanRoom| part.id.as_ref() == Some(&room.id) && part.area_m2 > 0.0;
        let parts: Vec<&PlanRoom> = self.rooms.iter().filter(is_part).collect();
        let main = *parts.iter().max_by(|a, b| a.area_m2.total_cmp(&b.area_m2))?;
        let outline = if parts.len() == 1 { main.outline.clone() } else { joined(&parts, &self.openings)? };
        let own = in_plan(room, &self.map_from_plan.inverse());
        let is_held = common_m2(&own, &outline) >= HELD * own.area_m2();
        is_held.then(|| PlanRoom { area_m2: outline.area_m2(), outline, ..main.clone() })
    }
}

/// Returns parts of a room with the openings between them; none if they are apart from each other.
fn joined(parts: &[&PlanRoom], openings: &[Opening]) -> Option<Outline> {
    let is_between = |opening: &&Opening| {
        let sides = sides_m(opening);
        opening.kind != OpeningKind::Window
            && sides.iter().all(|p| parts.iter().any(|part| part.contains(*p)))
    };
    let ways = openings.iter().filter(is_between).map(|way| Outline {
        ring_m: strip(way.from_m, way.to_m, way.thickness_m + SEAM_M).to_vec(),
        holes_m: Vec::new(),
    });
    let all: Vec<Outline> = parts.iter().map(|part| part.outline.clone()).chain(ways).collect();
    let mut pieces = united(&all);
    if pieces.len() == 1 { pieces.pop() } else { None }
}

/// Returns a place before the middle of an opening, on each side.
fn sides_m(opening: &Opening) -> [[f64; 2]; 2] {
    let corners = strip(opening.from_m, opening.to_m, opening.thickness_m + 2.0 * BEFORE_M);
    let middle = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|axis| (a[axis] + b[axis]) / 2.0);
    [middle(corners[0], corners[1]), middle(corners[2], corners[3])]
}
