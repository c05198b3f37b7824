//! Furniture at a wall that no clip saw. The LiDAR map has its outline, as it has that of walls.

use super::axes::place;
use super::cells::Cells;
use super::evidence::{Evidence, Facing};
use super::islands::{MOST_FURNITURE_M2, SHORTEST_FURNITURE_M, is_unfilmed};
use super::ring::{Ring, rings};

/// Footprints of furniture at a wall: beds stand with their head there.
const LEAST_M2: f64 = 0.12;
const MOST_AT_WALL_M2: f64 = 4.8;
/// The wall on both sides of furniture is in one line within this.
const SAME_LINE_M: f64 = 0.07;

/// Wall is looked for this far behind furniture: inner walls are thicker.
const BEHIND_M: f64 = 0.03;
/// Widths of the doorway between a piece of wall and the next one in its line.
const DOOR_M: [f64; 2] = [0.55, 1.35];
/// Largest thickness of an inner wall.
const WALL_M: f64 = 0.3;
/// Distance of samples.
const STEP_M: f64 = 0.05;

/// A solid rectangle between lines of cells, and its sides that look into the room.
struct Bite {
    low: [usize; 2],
    high: [usize; 2],
    sides: Vec<Facing>,
}

/// Makes furniture at walls and in corners a part of its room.
pub(super) fn fill(cells: &mut Cells, evidence: &Evidence) {
    // Furniture beside other furniture is at the wall once that is filled.
    const ROUNDS: usize = 3;
    for _ in 0..ROUNDS {
        let rings = rings(cells);
        let places = rings.iter().flat_map(|ring| (0..ring.len()).map(move |at| (ring, at)));
        let bites = places.flat_map(|(ring, at)| [at_wall(cells, ring, at), in_corner(ring, at)]).flatten();
        let mut is_changed = false;
        // Each is compared with those before it: two on both sides of a wall would open it together.
        for bite in bites.collect::<Vec<Bite>>() {
            let Some(bite) = without_wall(cells, bite) else { continue };
            if is_furniture(cells, evidence, &bite) {
                places_of(cells, &bite).into_iter().for_each(|at| cells.inside[at] = true);
                is_changed = true;
            }
        }
        if !is_changed {
            return;
        }
    }
}

/// Returns the rectangle before a wall whose first corner is at a place of a ring.
fn at_wall(cells: &Cells, ring: &Ring, at: usize) -> Option<Bite> {
    let corner = |i: usize| ring.corner(at + i);
    let turn = |i: usize| ring.turn(at + i);
    // Corners 1 and 4 are at the wall, 2 and 3 at the front.
    if ring.len() < 8 || turn(0) <= 0 || turn(1) >= 0 || turn(2) >= 0 || turn(3) <= 0 {
        return None;
    }
    let along = if corner(2)[1] == corner(3)[1] { 0 } else { 1 };
    let across = 1 - along;
    let place = |i: usize| cells.lines[across][corner(i)[across]];
    if (place(1) - place(4)).abs() > SAME_LINE_M {
        return None;
    }
    let front = corner(2)[across];
    let up = front > corner(1)[across];
    let back =
        if up { corner(1)[across].min(corner(4)[across]) } else { corner(1)[across].max(corner(4)[across]) };
    let mut bite = Bite::between(corner(2), corner(3));
    (bite.low[across], bite.high[across]) = (front.min(back), front.max(back));
    let beside = [true, false].map(|up| Facing { axis: along, up });
    bite.sides = std::iter::once(Facing { axis: across, up }).chain(beside).collect();
    Some(bite)
}

/// Returns the rectangle in a corner whose first corner is at a place of a ring.
fn in_corner(ring: &Ring, at: usize) -> Option<Bite> {
    // Corners 1 and 3 are at the walls.
    if ring.len() < 6 || ring.turn(at) <= 0 || ring.turn(at + 1) >= 0 || ring.turn(at + 2) <= 0 {
        return None;
    }
    let [from, front, to] = [1, 2, 3].map(|i| ring.corner(at + i));
    let mut bite = Bite::between(from, to);
    let side = |axis: usize| Facing { axis, up: front[axis] == bite.high[axis] };
    bite.sides = vec![side(0), side(1)];
    Some(bite)
}

impl Bite {
    fn between(a: [usize; 2], b: [usize; 2]) -> Bite {
        let bound = |pick: fn(usize, usize) -> usize| [0, 1].map(|axis| pick(a[axis], b[axis]));
        Bite { low: bound(usize::min), high: bound(usize::max), sides: Vec::new() }
    }
}

fn places_of(cells: &Cells, bite: &Bite) -> Vec<usize> {
    let Bite { low, high, .. } = bite;
    (low[0]..high[0]).flat_map(|i| (low[1]..high[1]).map(move |j| cells.index([i, j]))).collect()
}

/// Returns whether a rectangle is solid, as large as furniture, and has an outline that the LiDAR saw and no clip.
fn is_furniture(cells: &Cells, evidence: &Evidence, bite: &Bite) -> bool {
    let span_m = [0, 1].map(|axis| [bite.low[axis], bite.high[axis]].map(|line| cells.lines[axis][line]));
    let size_m = span_m.map(|[low, high]| high - low);
    let most_m2 = if bite.sides.len() > 2 { MOST_AT_WALL_M2 } else { MOST_FURNITURE_M2 };
    if !(LEAST_M2..=most_m2).contains(&(size_m[0] * size_m[1]))
        || size_m[0].min(size_m[1]) < SHORTEST_FURNITURE_M
    {
        return false;
    }
    if places_of(cells, bite).into_iter().any(|at| cells.inside[at] || cells.pillars[at]) {
        return false;
    }
    if !has_wall_behind(cells, bite, &span_m) {
        return false;
    }
    let (mut length_m, mut upright_m, mut lidar_m) = (0.0, 0.0, 0.0);
    for side in &bite.sides {
        let line_m = span_m[side.axis][usize::from(side.up)];
        let along_m = span_m[1 - side.axis];
        let side_m = along_m[1] - along_m[0];
        length_m += side_m;
        upright_m += side_m * evidence.upright_fraction(*side, line_m, along_m);
        lidar_m += side_m * evidence.lidar_fraction(*side, line_m, along_m);
    }
    is_unfilmed(length_m, upright_m, lidar_m)
}

/// Returns whether at least half of each back of a rectangle is at solid cells.
fn has_wall_behind(cells: &Cells, bite: &Bite, span_m: &[[f64; 2]; 2]) -> bool {
    let behind = Facing::ALL.into_iter().filter(|facing| !bite.sides.contains(facing));
    behind.into_iter().all(|facing| {
        let line_m = span_m[facing.axis][usize::from(facing.up)];
        let beyond_m = line_m + if facing.up { BEHIND_M } else { -BEHIND_M };
        let is_solid = |along_m: &f64| !cells.is_inside(place(facing.axis, beyond_m, *along_m));
        let solid = steps(span_m[1 - facing.axis]).filter(is_solid).count();
        2 * solid >= steps(span_m[1 - facing.axis]).count()
    })
}

/// Returns a rectangle without the wall at one of its sides, if that continues behind a doorway: furniture stands before it.
/// `None` if nothing is left.
fn without_wall(cells: &Cells, mut bite: Bite) -> Option<Bite> {
    let [front, beside @ ..] = bite.sides.as_slice() else { return Some(bite) };
    if beside.len() < 2 {
        return Some(bite);
    }
    for side in beside {
        let Some(other_face) = wall_beyond_door(cells, &bite, *front, *side) else { continue };
        if side.up {
            bite.high[side.axis] = other_face;
        } else {
            bite.low[side.axis] = other_face;
        }
    }
    (0..2).all(|axis| bite.low[axis] < bite.high[axis]).then_some(bite)
}

/// Returns the line of the other face of a wall behind a doorway, one face of which is in line with a side of a rectangle.
fn wall_beyond_door(cells: &Cells, bite: &Bite, front: Facing, side: Facing) -> Option<usize> {
    let line_m = |facing: Facing| {
        let bounds = if facing.up { &bite.high } else { &bite.low };
        cells.lines[facing.axis][bounds[facing.axis]]
    };
    let (ahead, inward) = (if front.up { 1.0 } else { -1.0 }, if side.up { -1.0 } else { 1.0 });
    let at = |off_m: f64, in_m: f64| {
        place(front.axis, line_m(front) + ahead * off_m, line_m(side) + inward * in_m)
    };
    let is_inside = |off_m: f64, in_m: f64| cells.is_inside(at(off_m, in_m));
    let end_m = steps([0.0, DOOR_M[1]]).find(|off_m| !is_inside(*off_m, SAME_LINE_M))?;
    // The room is right beside the next wall, on both sides.
    let is_wall = end_m >= DOOR_M[0] && is_inside(end_m + STEP_M, -SAME_LINE_M);
    let through_m = steps([SAME_LINE_M, WALL_M]).find(|in_m| is_inside(end_m + STEP_M, *in_m))?;
    let beyond = cells.at(at(end_m + STEP_M, through_m)).filter(|_| is_wall)?;
    Some(cells.place(beyond)[side.axis] + usize::from(side.up))
}

/// Returns the middles of equal steps between two values, at most [`STEP_M`] long.
fn steps([from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    let count = ((to - from) / STEP_M).ceil().max(1.0) as usize;
    (0..count).map(move |i| from + (i as f64 + 0.5) / count as f64 * (to - from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn furniture_in_a_corner_has_a_wall_behind() {
        // Furniture in the middle column; the lower row and the right column are wall, as far as they are no room.
        let cells = |is_room_behind: bool| {
            let inside =
                vec![false, false, is_room_behind, true, false, is_room_behind, true, true, is_room_behind];
            let lines = [vec![0.0, 1.0, 1.6, 2.6], vec![0.0, 0.1, 0.7, 1.7]];
            Cells { inside, ..Cells::of(lines) }
        };
        let sides = vec![Facing { axis: 0, up: false }, Facing { axis: 1, up: true }];
        let bite = Bite { low: [1, 1], high: [2, 2], sides };
        let span_m = [[1.0, 1.6], [0.1, 0.7]];
        assert!(has_wall_behind(&cells(false), &bite, &span_m));
        assert!(!has_wall_behind(&cells(true), &bite, &span_m));
    }
}
