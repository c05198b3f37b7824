//! Doors, passages, open plans and windows.

use super::{Leaf, Opening, OpeningKind, Plan, RoomKind, Wall};
use crate::simulate::rng::Rng;
use viola_geometry::Point2;

/// Minimum distance of an opening from the ends of its wall.
const MARGIN_M: f64 = 0.2;

/// Adds ways that connect all rooms, with corridors and living rooms as preferred hubs, and the home's
/// entrance.
pub(super) fn open_doors(plan: &mut Plan, rng: &mut Rng) {
    let mut edges: Vec<(f64, usize)> = plan
        .walls
        .iter()
        .enumerate()
        .filter(|(_, wall)| wall.to - wall.from >= 0.8 + 2.0 * MARGIN_M)
        .filter_map(|(index, wall)| match wall.rooms {
            [Some(a), Some(b)] => {
                Some((reluctance(plan.rooms[a].kind, plan.rooms[b].kind) + rng.between(0.0, 0.5), index))
            }
            _ => None,
        })
        .collect();
    edges.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Kruskal's algorithm: a minimum spanning tree.
    let mut group: Vec<usize> = (0..plan.rooms.len()).collect();
    for (cost, index) in edges {
        let wall = plan.walls[index].clone();
        let [Some(a), Some(b)] = wall.rooms else { continue };
        let joins = group[a] != group[b];
        if joins {
            let (from, to) = (group[b], group[a]);
            group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
        }
        // Additional ways make loops, as in many homes.
        if joins || (cost < 1.6 && rng.chance(0.25)) {
            let opening = way(plan, &wall, [plan.rooms[a].kind, plan.rooms[b].kind], rng);
            plan.openings.push(opening);
        }
    }
    open_entrance(plan, rng);
}

/// Returns the cost of a door between two kinds of rooms.
fn reluctance(a: RoomKind, b: RoomKind) -> f64 {
    use RoomKind::*;
    let either = |kind: RoomKind| a == kind || b == kind;
    match () {
        () if either(Corridor) => 0.0,
        () if either(Living) && (either(Kitchen) || either(Dining)) => 0.5,
        () if either(Living) || either(Studio) => 1.2,
        () if either(Kitchen) && either(Dining) => 1.0,
        () if either(Bedroom) && either(Bathroom) => 2.0,
        () if either(Bathroom) => 5.0,
        () if either(Storage) => 2.5,
        () => 3.5,
    }
}

fn way(plan: &Plan, wall: &Wall, kinds: [RoomKind; 2], rng: &mut Rng) -> Opening {
    use RoomKind::*;
    let both = |a: RoomKind, b: RoomKind| kinds == [a, b] || kinds == [b, a];
    let length = wall.to - wall.from - 2.0 * MARGIN_M;
    let day = kinds.iter().all(|kind| matches!(kind, Living | Kitchen | Dining | Studio | Corridor));
    let kind = if (both(Living, Kitchen) || both(Living, Dining) || both(Kitchen, Dining))
        && length > 1.6
        && rng.chance(0.5)
    {
        OpeningKind::Wide
    } else if day && rng.chance(0.35) {
        OpeningKind::Passage
    } else {
        OpeningKind::Door
    };
    let width_m = match kind {
        OpeningKind::Wide => rng.between(1.6, 4.0).min(length),
        OpeningKind::Passage => rng.between(0.85, 1.2).min(length),
        _ => rng.between(0.8, 0.9).min(length),
    };
    let head_m = match kind {
        OpeningKind::Wide => rng.pick([plan.ceiling_m, (plan.ceiling_m - 0.25).max(2.0)]),
        _ => rng.between(1.98, 2.12).min(plan.head_limit_m()),
    };
    let slack = length - width_m;
    // Most doors are near a corner.
    let offset = match rng.count(0, 3) {
        0 => rng.between(0.0, slack),
        1 => slack - rng.between(0.0, 0.15_f64.min(slack)),
        _ => rng.between(0.0, 0.15_f64.min(slack)),
    };
    let at = wall.from + MARGIN_M + offset + width_m / 2.0;
    // Leaves open into the room, never into the corridor.
    let swing = if kinds[0] == Corridor || (kinds[1] != Corridor && rng.chance(0.5)) { 1.0 } else { -1.0 };
    // Most doors are open; some of the others leave too narrow a gap for the vacuum. A closed door hides its
    // room from the vacuum, so only rooms at the end of the ways have one.
    let is_end = kinds.iter().any(|kind| matches!(kind, Storage | Bathroom | Child | Study));
    let open_deg = match rng.between(0.0, 1.0) {
        draw if is_end && draw < 0.04 => 0.0,
        draw if draw > 0.96 => rng.between(10.0, 60.0),
        _ => rng.between(72.0, 100.0),
    };
    let sliding = pocket(plan, wall, at, width_m).filter(|_| kind == OpeningKind::Door && rng.chance(0.2));
    let leaf = if sliding.is_some() { Leaf::Sliding } else { Leaf::Hinged };
    let hinge = sliding.unwrap_or(if offset < slack / 2.0 { -1.0 } else { 1.0 });
    let detail = rng.fork("detail", plan.openings.len() as u64).seed();
    let open_rad = f64::to_radians(open_deg);
    Opening { hinge, swing, open_rad, leaf, ..closed(kind, wall, at, width_m, [0.0, head_m], detail) }
}

/// Returns an opening whose middle is at a place along a wall. Its leaf, if it has one, is closed.
fn closed(
    kind: OpeningKind,
    wall: &Wall,
    at: f64,
    width_m: f64,
    [sill_m, head_m]: [f64; 2],
    detail: u64,
) -> Opening {
    Opening {
        kind,
        centre: if wall.along_x { Point2::new(at, wall.line) } else { Point2::new(wall.line, at) },
        along_x: wall.along_x,
        width_m,
        sill_m,
        head_m,
        rooms: wall.rooms,
        hinge: 1.0,
        swing: 1.0,
        open_rad: 0.0,
        leaf: Leaf::Hinged,
        detail,
    }
}

/// Returns the side of a door on which its leaf fits into the wall, -1 or 1.
fn pocket(plan: &Plan, wall: &Wall, at: f64, width_m: f64) -> Option<f64> {
    // A leaf needs some wall on both of its sides.
    let thick_enough = plan.wall_m > 0.09;
    [-1.0, 1.0].into_iter().find(|side| {
        let end = at + side * (1.5 * width_m + 0.05);
        thick_enough && end > wall.from && end < wall.to
    })
}

/// Adds a closed door to the outside, from the corridor if it has an outer wall.
fn open_entrance(plan: &mut Plan, rng: &mut Rng) {
    let rank = |kind: RoomKind| match kind {
        RoomKind::Corridor => 0,
        RoomKind::Living | RoomKind::Studio => 1,
        RoomKind::Kitchen | RoomKind::Dining => 2,
        _ => 9,
    };
    let outer = plan.walls.iter().filter(|wall| wall.to - wall.from >= 0.9 + MARGIN_M);
    let mut candidates: Vec<(usize, &Wall)> = outer
        .filter_map(|wall| match wall.rooms {
            [Some(room), None] | [None, Some(room)] => Some((rank(plan.rooms[room].kind), wall)),
            _ => None,
        })
        .collect();
    candidates.sort_by_key(|(rank, _)| *rank);
    let Some(&(_, wall)) = candidates.first() else { return };
    let half = 0.45 + MARGIN_M / 2.0;
    let at = rng.between(wall.from + half, wall.to - half);
    let (up, detail) = ([0.0, plan.head_limit_m().min(2.05)], rng.fork("entrance", 0).seed());
    let opening = Opening {
        hinge: rng.sign(),
        swing: if wall.rooms[0].is_some() { -1.0 } else { 1.0 },
        ..closed(OpeningKind::Entrance, wall, at, 0.9, up, detail)
    };
    plan.openings.push(opening);
}

/// Adds windows in the outer walls, away from the entrance. In a glazed home nearly all outer walls are glass
/// from the floor up.
pub(super) fn open_windows(plan: &mut Plan, glazed: bool, rng: &mut Rng) {
    let mut windows = vec![];
    for wall in &plan.walls {
        let room = match wall.rooms {
            [Some(room), None] | [None, Some(room)] => room,
            _ => continue,
        };
        let kind = plan.rooms[room].kind;
        let length = wall.to - wall.from - 0.6;
        let wanted = match kind {
            RoomKind::Storage => 0.0,
            RoomKind::Corridor => 0.4,
            RoomKind::Bathroom => 0.6,
            _ if glazed => 1.0,
            _ => 0.85,
        };
        if length < 0.7 || !rng.chance(wanted) {
            continue;
        }
        let count = if length > 3.4 && rng.chance(0.6) { 2 } else { 1 };
        let part_m = length / count as f64;
        for index in 0..count {
            let widest = if kind == RoomKind::Bathroom { 0.9 } else { 2.2 };
            let drawn_m = rng.between(0.7, widest).min(part_m - 0.2).max(0.5);
            let is_front = glazed && kind != RoomKind::Bathroom;
            let width_m = if is_front { (part_m - 0.2).max(0.5) } else { drawn_m };
            let slack = part_m - width_m;
            let at = wall.from
                + 0.3
                + part_m * (index as f64 + 0.5)
                + rng.between(-0.3, 0.3).clamp(-slack / 2.0, slack / 2.0);
            // French windows reach the floor: the vacuum's LiDAR sees through them.
            let to_the_floor = matches!(kind, RoomKind::Living | RoomKind::Studio | RoomKind::Bedroom);
            let sill_m = match kind {
                _ if is_front => 0.0,
                RoomKind::Bathroom => rng.between(1.2, 1.5),
                _ if to_the_floor && width_m > 0.8 && rng.chance(0.3) => 0.05,
                _ if rng.chance(0.15) => rng.between(0.4, 0.7),
                _ => rng.between(0.75, 1.0),
            };
            let head_m = rng.between(2.05, 2.4).min(plan.head_limit_m());
            let detail = rng.fork("detail", windows.len() as u64).seed();
            let window = closed(OpeningKind::Window, wall, at, width_m, [sill_m, head_m], detail);
            let clear = plan.openings.iter().all(|other| {
                other.along_x != window.along_x
                    || other.line() != window.line()
                    || (other.at() - window.at()).abs() > (other.width_m + window.width_m) / 2.0 + 0.2
            });
            if clear {
                windows.push(window);
            }
        }
    }
    plan.openings.extend(windows);
}
