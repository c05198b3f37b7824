//! Fixtures of rooms: stairs, fireplaces, half-height walls, pipes.

use super::features::{at_wall, plaster, wall_block};
use super::{Feature, Plan, RoomKind};
use crate::simulate::finish::{DARK, Finish, METAL, Pattern, WHITE, wood};
use crate::simulate::piece::{Footprint, Piece};
use crate::simulate::rng::Rng;
use std::f64::consts::{FRAC_PI_2, PI};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2};

/// Minimum width of the way that a fixture leaves free, in metres.
const WAY_M: f64 = 1.0;

pub(super) fn add(plan: &Plan, room: usize, rng: &mut Rng) -> Vec<Feature> {
    let space = &plan.rooms[room];
    let area = space.inner.area_m2();
    let living = matches!(space.kind, RoomKind::Living | RoomKind::Studio | RoomKind::Dining);
    let mut out = vec![];
    if living && area > 14.0 && rng.chance(0.15) {
        out.push(fireplace(plan, room, rng));
    }
    if area > 16.0 && rng.chance(0.15) {
        out.push(divider(plan, room, rng));
    }
    if rng.chance(if space.kind == RoomKind::Bathroom { 0.4 } else { 0.15 }) {
        out.push(pipes(plan, room, rng));
    }
    out
}

/// Returns the feature of a piece that stands with its back (+y) at a wall of the room, by its centre along
/// the wall.
fn placed(plan: &Plan, room: usize, piece: &Piece, axis: usize, at_min: bool, along: f64) -> Feature {
    let inner = plan.rooms[room].inner;
    let half = piece.size[1] / 2.0;
    let across = if at_min { inner.min[1 - axis] + half } else { inner.max[1 - axis] - half };
    let pose = match (axis, at_min) {
        (0, false) => Pose2::new(along, across, 0.0),
        (0, true) => Pose2::new(along, across, PI),
        (_, false) => Pose2::new(across, along, -FRAC_PI_2),
        (_, true) => Pose2::new(across, along, FRAC_PI_2),
    };
    let solids = piece.solids.iter().map(|solid| solid.moved(&pose)).collect();
    Feature { room, solids, footprint: piece.footprint_at(&pose) }
}

/// Returns a straight flight of stairs along a wall: a few steps to a landing, or up to the ceiling. None if
/// the room is too small.
pub(super) fn stairs(plan: &Plan, room: usize, rng: &mut Rng) -> Option<Feature> {
    let space = &plan.rooms[room];
    let usual = matches!(space.kind, RoomKind::Corridor | RoomKind::Living | RoomKind::Studio);
    let axis = if space.inner.size(0) >= space.inner.size(1) { 0 } else { 1 };
    let (length, depth) = (space.inner.size(axis), space.inner.size(1 - axis));
    let width = rng.between(0.75, 1.0);
    let (tread, rise) = (rng.between(0.24, 0.29), rng.between(0.165, 0.195));
    let most = (((length - 1.5) / tread) as usize).min(((plan.ceiling_m - 0.1) / rise) as usize);
    if !usual || depth < width + WAY_M || most < 4 || plan.slopes.iter().any(|slope| slope.room == room) {
        return None;
    }
    let steps = if rng.chance(0.5) { most } else { rng.count(3, most.min(8)) };
    let landing = if steps < most { rng.between(0.0, 0.9).min((most - steps) as f64 * tread) } else { 0.0 };
    let run = steps as f64 * tread + landing;
    let finish = if rng.chance(0.6) { wood(rng) } else { Finish::plain([0.62, 0.61, 0.60]) };
    let mut piece = Piece::new(Class::Stairs, [run, width, steps as f64 * rise]);
    let rail = rng.chance(0.6).then(|| if rng.chance(0.5) { Finish::plain(METAL) } else { wood(rng) });
    let (up, left) = (rng.sign(), -run / 2.0);
    for step in 0..steps {
        let last = step + 1 == steps;
        let deep = if last { tread + landing } else { tread };
        let x = up * (left + step as f64 * tread + deep / 2.0);
        let height = (step + 1) as f64 * rise;
        piece.block([x, 0.0, 0.0], [deep, width, height - 0.035], finish.darker(0.8));
        // The tread sticks out over the riser.
        piece.block([x - up * 0.01, 0.0, height - 0.035], [deep + 0.02, width, 0.035], finish);
        if let Some(rail) = rail {
            piece.post([x, 0.03 - width / 2.0, height], 0.012, 0.85, rail);
            piece.block([x, 0.03 - width / 2.0, height + 0.85], [deep + 0.04, 0.05, 0.05], rail);
        }
    }
    let (at_min, inner) = (rng.chance(0.5), space.inner);
    // The upper end is at a wall; the piece's x points along the axis or against it.
    let with_axis = (axis == 0) != at_min;
    let rises_with_axis = (up > 0.0) == with_axis;
    let along = if rises_with_axis { inner.max[axis] - run / 2.0 } else { inner.min[axis] + run / 2.0 };
    Some(placed(plan, room, &piece, axis, at_min, along))
}

/// Returns an open fireplace with a chimney breast, a hearth and a mantel.
fn fireplace(plan: &Plan, room: usize, rng: &mut Rng) -> Feature {
    let (width, depth) = (rng.between(1.1, 1.6), rng.between(0.3, 0.55));
    let (open, high) = (rng.between(0.55, 0.8), rng.between(0.6, 0.85));
    let mut piece = Piece::new(Class::Other, [width, depth, plan.ceiling_m]);
    let stone = match rng.count(0, 2) {
        0 => plaster(),
        1 => Finish::plain([0.60, 0.36, 0.28]).with(Pattern::Tiles, 0.07),
        _ => Finish::plain([0.55, 0.53, 0.50]).with(Pattern::Grain, 0.05),
    };
    let side = (width - open) / 2.0;
    for sign in [-1.0, 1.0] {
        piece.block([sign * (width - side) / 2.0, 0.0, 0.0], [side, depth, high], stone);
    }
    piece.block([0.0, depth / 2.0 - 0.03, 0.0], [open, 0.06, high], Finish::plain([0.05; 3]));
    piece.block([0.0, 0.0, 0.0], [open, depth, 0.12], Finish::plain(DARK));
    piece.block([0.0, 0.0, high], [width, depth, 0.25], stone);
    let mantel = if rng.chance(0.5) { wood(rng) } else { Finish::plain(WHITE).glossy(0.2) };
    piece.block([0.0, -0.04, high + 0.25], [width + 0.1, depth + 0.08, 0.05], mantel);
    let breast = [width * rng.between(0.6, 1.0), depth * rng.between(0.6, 0.95)];
    let bottom = [0.0, (depth - breast[1]) / 2.0, high + 0.3];
    piece.block(bottom, [breast[0], breast[1], plan.ceiling_m - high - 0.3], plaster()).class = Class::Wall;
    let (axis, inner) = (rng.count(0, 1), plan.rooms[room].inner);
    let along = rng.between(inner.min[axis] + width / 2.0, inner.max[axis] - width / 2.0);
    placed(plan, room, &piece, axis, rng.chance(0.5), along)
}

/// Returns a half-height wall that juts into the room.
fn divider(plan: &Plan, room: usize, rng: &mut Rng) -> Feature {
    let (axis, inner) = (rng.count(0, 1), plan.rooms[room].inner);
    let thick = rng.between(0.08, 0.16);
    let length = rng.between(0.7, (0.5 * inner.size(1 - axis)).min(inner.size(1 - axis) - WAY_M));
    let at = inner.min[axis] + rng.between(0.3, 0.7) * inner.size(axis);
    let along = [at - thick / 2.0, at + thick / 2.0];
    let footprint = at_wall(plan, room, axis, rng.chance(0.5), along, length);
    wall_block(room, footprint, [0.0, rng.between(0.9, 1.35)])
}

/// Returns upright pipes in a corner.
fn pipes(plan: &Plan, room: usize, rng: &mut Rng) -> Feature {
    let inner = plan.rooms[room].inner;
    let count = rng.count(1, 3);
    let corner = [rng.chance(0.5), rng.chance(0.5)];
    let (along_x, reach) = (rng.chance(0.5), 0.07 + 0.1 * count as f64);
    let half = if along_x { [reach / 2.0, 0.07] } else { [0.07, reach / 2.0] };
    let middle = |axis: usize| {
        if corner[axis] { inner.min[axis] + half[axis] } else { inner.max[axis] - half[axis] }
    };
    let centre = Point2::new(middle(0), middle(1));
    let finish = Finish::plain(rng.pick([WHITE, METAL, [0.65, 0.42, 0.30]])).glossy(0.3);
    let mut piece = Piece::new(Class::Other, [2.0 * half[0], 2.0 * half[1], plan.ceiling_m]);
    for index in 0..count {
        let offset = (index as f64 + 0.5) * 0.1 - 0.05 * count as f64;
        let (x, y) = if along_x { (offset, 0.0) } else { (0.0, offset) };
        piece.post([x, y, 0.0], rng.between(0.012, 0.045), plan.ceiling_m, finish);
    }
    let pose = Pose2::new(centre.x, centre.y, 0.0);
    let solids = piece.solids.iter().map(|solid| solid.moved(&pose)).collect();
    Feature { room, solids, footprint: Footprint { centre, half, yaw_rad: 0.0 } }
}

#[cfg(test)]
mod tests {
    use crate::simulate::{Home, HomeParams, Set};
    use viola_formats::lidar::Cell;
    use viola_geometry::Point2;
    use viola_geometry::taxonomy::Class;

    #[test]
    fn stairs_are_not_driven() {
        let mut flights = 0;
        for seed in 0..40 {
            let home = Home::generate(&HomeParams::new(Set::Normal, seed));
            let is_stairs = |f: &&super::Feature| f.solids.iter().any(|s| s.class == Class::Stairs);
            let Some(stairs) = home.plan.features.iter().find(is_stairs) else { continue };
            flights += 1;
            let survey = home.survey();
            let mut free = 0;
            for k in 0..100 {
                let fraction = |k: usize| (k as f64 + 0.5) / 10.0 * 2.0 - 1.0;
                let spot = stairs.footprint;
                let (x, y) = (fraction(k % 10) * spot.half[0], fraction(k / 10) * spot.half[1]);
                let at = viola_geometry::Pose2::new(spot.centre.x, spot.centre.y, spot.yaw_rad)
                    .apply(&Point2::new(x, y));
                let cell = survey.cells.at(&survey.robot_from_home.apply(&at));
                free += usize::from(cell == Some(Cell::Free));
                assert!(survey.scans.iter().all(|scan| (scan.x_m - at.x).hypot(scan.y_m - at.y) > 0.1));
            }
            assert!(free <= 15, "{seed}: {free} % of the stairs are free floor");
        }
        assert!(flights >= 3, "{flights} flights");
    }
}
