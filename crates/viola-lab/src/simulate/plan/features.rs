//! Features of rooms beyond plain rectangles: cut corners, oblique walls, chimney breasts, alcoves, pillars.

use super::{Feature, Plan, RoomKind, fixtures};
use crate::simulate::finish::{Finish, Pattern, WHITE};
use crate::simulate::piece::Footprint;
use crate::simulate::rng::Rng;
use crate::simulate::solid::Solid;
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

/// Draws of stairs in a room before it gets none.
const FLIGHTS: usize = 10;

/// Returns the features of all rooms. Those of one draw stand together or not at all.
pub(super) fn add(plan: &Plan, rng: &mut Rng) -> Vec<Feature> {
    let mut features: Vec<Feature> = vec![];
    if rng.chance(0.35) {
        let draws = (0..plan.rooms.len()).flat_map(|room| [room; FLIGHTS]);
        let mut flights = draws.filter_map(|room| fixtures::stairs(plan, room, rng));
        features.extend(flights.find(|flight| stands(plan, &[], flight)));
    }
    for room in 0..plan.rooms.len() {
        let mut wanted = shapes(plan, room, rng);
        wanted.extend(fixtures::add(plan, room, rng).into_iter().map(|fixture| vec![fixture]));
        for group in wanted {
            if group.iter().all(|feature| stands(plan, &features, feature)) {
                features.extend(group);
            }
        }
    }
    features
}

/// Returns whether a feature leaves free the ways, and a gap to others in its room.
fn stands(plan: &Plan, others: &[Feature], feature: &Feature) -> bool {
    let spot = feature.footprint.grown(0.7);
    plan.openings.iter().all(|opening| !opening.zone(1.0).overlaps(&feature.footprint))
        && others.iter().all(|other| other.room != feature.room || !other.footprint.overlaps(&spot))
}

/// Returns changes of the room's outline.
fn shapes(plan: &Plan, room: usize, rng: &mut Rng) -> Vec<Vec<Feature>> {
    let (space, mut wanted) = (&plan.rooms[room], vec![]);
    let area = space.inner.area_m2();
    if area > 7.0 && rng.chance(0.3) {
        wanted.push(vec![cut_corner(plan, room, false, rng)]);
    } else if area > 10.0 && rng.chance(0.12) {
        wanted.push(vec![cut_corner(plan, room, true, rng)]);
    }
    if area > 8.0 && space.kind != RoomKind::Corridor && rng.chance(0.15) {
        wanted.push(alcove(plan, room, rng));
    }
    if area > 5.0 && space.kind != RoomKind::Corridor {
        for _ in 0..2 {
            if rng.chance(0.4) {
                wanted.push(vec![breast(plan, room, rng)]);
            }
        }
    }
    if area > 22.0 && rng.chance(0.3) {
        wanted.push(vec![pillar(plan, room, rng)]);
    }
    wanted
}

pub(super) fn plaster() -> Finish {
    Finish::plain(WHITE).with(Pattern::Grain, 0.02)
}

/// Returns a part of a wall, from one height to another, with its footprint on the floor.
pub(super) fn wall_block(room: usize, footprint: Footprint, up: [f64; 2]) -> Feature {
    let size = [2.0 * footprint.half[0], 2.0 * footprint.half[1], up[1] - up[0]];
    let bottom = [footprint.centre.x, footprint.centre.y, up[0]];
    let block = Solid::block(Class::Wall, bottom, size, plaster());
    Feature { room, solids: vec![Solid { yaw_rad: footprint.yaw_rad, ..block }], footprint }
}

/// Returns a rectangle at a wall of the room, by its interval along the wall and its depth. `axis` is the
/// wall's direction, `at_min` whether it is the wall of the smaller coordinate.
pub(super) fn at_wall(
    plan: &Plan,
    room: usize,
    axis: usize,
    at_min: bool,
    along: [f64; 2],
    depth: f64,
) -> Footprint {
    let inner = plan.rooms[room].inner;
    let across = if at_min { inner.min[1 - axis] + depth / 2.0 } else { inner.max[1 - axis] - depth / 2.0 };
    let (at, half) = ((along[0] + along[1]) / 2.0, (along[1] - along[0]) / 2.0);
    let (centre, half) = if axis == 0 {
        (Point2::new(at, across), [half, depth / 2.0])
    } else {
        (Point2::new(across, at), [depth / 2.0, half])
    };
    Footprint { centre, half, yaw_rad: 0.0 }
}

/// Returns a wall across a corner of the room; an oblique one replaces a whole wall.
fn cut_corner(plan: &Plan, room: usize, oblique: bool, rng: &mut Rng) -> Feature {
    let inner = plan.rooms[room].inner;
    let (sx, sy) = (rng.sign(), rng.sign());
    let pick = |sign: f64, axis: usize| if sign > 0.0 { inner.max[axis] } else { inner.min[axis] };
    let corner = Point2::new(pick(sx, 0), pick(sy, 1));
    let mut legs = [0, 1].map(|axis| rng.between(0.6, (0.4 * inner.size(axis)).clamp(0.7, 1.6)));
    if oblique {
        let axis = rng.count(0, 1);
        legs[axis] = inner.size(axis) - 0.01;
        legs[1 - axis] = rng.between(0.3, 0.2 * inner.size(1 - axis));
    }
    let [dx, dy] = legs;
    let (a, b) = (Point2::new(corner.x - sx * dx, corner.y), Point2::new(corner.x, corner.y - sy * dy));
    let run = b - a;
    let thickness = 0.1;
    let outwards = nalgebra::Vector2::new(sx * dy, sy * dx).normalize();
    let middle = nalgebra::center(&a, &b) + outwards * (thickness / 2.0);
    let wall =
        Footprint { centre: middle, half: [run.norm() / 2.0, thickness / 2.0], yaw_rad: run.y.atan2(run.x) };
    let mut feature = wall_block(room, wall, [0.0, plan.ceiling_m]);
    feature.footprint = Footprint {
        centre: Point2::new(corner.x - sx * dx / 2.0, corner.y - sy * dy / 2.0),
        half: [dx / 2.0, dy / 2.0],
        yaw_rad: 0.0,
    };
    feature
}

/// Returns a shaft or chimney breast at a wall; two of them make an alcove.
fn breast(plan: &Plan, room: usize, rng: &mut Rng) -> Feature {
    let inner = plan.rooms[room].inner;
    let axis = rng.count(0, 1);
    let width = rng.between(0.4, (0.4 * inner.size(axis)).clamp(0.5, 1.5));
    let depth = rng.between(0.15, 0.5_f64.min(0.15 * inner.size(1 - axis)));
    let at = match rng.count(0, 2) {
        0 => inner.min[axis] + width / 2.0,
        1 => inner.max[axis] - width / 2.0,
        _ => rng.between(inner.min[axis] + width / 2.0, inner.max[axis] - width / 2.0),
    };
    let along = [at - width / 2.0, at + width / 2.0];
    let footprint = at_wall(plan, room, axis, rng.chance(0.5), along, depth);
    wall_block(room, footprint, [0.0, plan.ceiling_m])
}

/// Returns an alcove in a thickened wall; a niche above a sill takes no furniture.
fn alcove(plan: &Plan, room: usize, rng: &mut Rng) -> Vec<Feature> {
    let inner = plan.rooms[room].inner;
    let (axis, at_min) = (rng.count(0, 1), rng.chance(0.5));
    let [low, high] = [inner.min[axis], inner.max[axis]];
    let depth = rng.between(0.18, 0.45);
    let width = rng.between(0.5, (0.5 * (high - low)).clamp(0.6, 2.0));
    let left = rng.between(low + 0.3, high - 0.3 - width);
    let gap = [left, left + width];
    let part =
        |along: [f64; 2], up: [f64; 2]| wall_block(room, at_wall(plan, room, axis, at_min, along, depth), up);
    let whole = [0.0, plan.ceiling_m];
    let mut sides = vec![part([low, gap[0]], whole), part([gap[1], high], whole)];
    let lintel = rng.between(1.9, plan.ceiling_m);
    if rng.chance(0.4) {
        let mut niche = part(gap, [0.0, rng.between(0.3, 1.0)]);
        niche.solids.extend(part(gap, [lintel, plan.ceiling_m]).solids);
        sides.push(niche);
    }
    sides
}

fn pillar(plan: &Plan, room: usize, rng: &mut Rng) -> Feature {
    let space = plan.rooms[room].inner.shrunk(1.1);
    let side = rng.between(0.22, 0.4);
    let centre =
        Point2::new(rng.between(space.min[0], space.max[0]), rng.between(space.min[1], space.max[1]));
    let footprint = Footprint { centre, half: [side / 2.0, side / 2.0], yaw_rad: 0.0 };
    let mut feature = wall_block(room, footprint, [0.0, plan.ceiling_m]);
    if rng.chance(0.4) {
        feature.solids[0].shape = crate::simulate::solid::Shape::Cylinder;
    }
    feature
}
