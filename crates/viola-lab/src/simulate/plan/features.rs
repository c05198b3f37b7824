//! Features of rooms beyond plain rectangles: cut corners, chimney breasts, pillars.

use super::{Feature, Plan, RoomKind};
use crate::simulate::finish::{Finish, Pattern, WHITE};
use crate::simulate::piece::Footprint;
use crate::simulate::rng::Rng;
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

pub(super) fn add(plan: &Plan, rng: &mut Rng) -> Vec<Feature> {
    let mut features: Vec<Feature> = vec![];
    for (room, space) in plan.rooms.iter().enumerate() {
        let area = space.inner.area_m2();
        let mut wanted = vec![];
        if area > 7.0 && rng.chance(0.3) {
            wanted.push(cut_corner(plan, room, rng));
        }
        if area > 5.0 && space.kind != RoomKind::Corridor {
            for _ in 0..2 {
                if rng.chance(0.4) {
                    wanted.push(breast(plan, room, rng));
                }
            }
        }
        if area > 22.0 && rng.chance(0.3) {
            wanted.push(pillar(plan, room, rng));
        }
        for feature in wanted {
            let of_ways = plan.openings.iter().all(|o| !o.zone(1.0).overlaps(&feature.footprint));
            let of_others = features.iter().all(|f| !f.footprint.grown(0.7).overlaps(&feature.footprint));
            if of_ways && of_others {
                features.push(feature);
            }
        }
    }
    features
}

fn plaster() -> Finish {
    Finish::plain(WHITE).with(Pattern::Grain, 0.02)
}

/// Returns a wall across a corner of the room.
fn cut_corner(plan: &Plan, room: usize, rng: &mut Rng) -> Feature {
    let inner = plan.rooms[room].inner;
    let (sx, sy) = (rng.sign(), rng.sign());
    let pick = |sign: f64, axis: usize| if sign > 0.0 { inner.max[axis] } else { inner.min[axis] };
    let corner = Point2::new(pick(sx, 0), pick(sy, 1));
    let dx = rng.between(0.6, (0.4 * inner.size(0)).clamp(0.7, 1.6));
    let dy = rng.between(0.6, (0.4 * inner.size(1)).clamp(0.7, 1.6));
    let (a, b) = (Point2::new(corner.x - sx * dx, corner.y), Point2::new(corner.x, corner.y - sy * dy));
    let run = b - a;
    let thickness = 0.1;
    let outwards = nalgebra::Vector2::new(sx * dy, sy * dx).normalize();
    let middle = nalgebra::center(&a, &b) + outwards * (thickness / 2.0);
    let wall =
        Footprint { centre: middle, half: [run.norm() / 2.0, thickness / 2.0], yaw_rad: run.y.atan2(run.x) };
    let mut feature = Feature::wall_block(room, wall, plan.ceiling_m, Class::Wall, plaster());
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
    let across =
        if rng.chance(0.5) { inner.min[1 - axis] + depth / 2.0 } else { inner.max[1 - axis] - depth / 2.0 };
    let (centre, half) = if axis == 0 {
        (Point2::new(at, across), [width / 2.0, depth / 2.0])
    } else {
        (Point2::new(across, at), [depth / 2.0, width / 2.0])
    };
    let footprint = Footprint { centre, half, yaw_rad: 0.0 };
    Feature::wall_block(room, footprint, plan.ceiling_m, Class::Wall, plaster())
}

fn pillar(plan: &Plan, room: usize, rng: &mut Rng) -> Feature {
    let space = plan.rooms[room].inner.shrunk(1.1);
    let side = rng.between(0.22, 0.4);
    let centre =
        Point2::new(rng.between(space.min[0], space.max[0]), rng.between(space.min[1], space.max[1]));
    let footprint = Footprint { centre, half: [side / 2.0, side / 2.0], yaw_rad: 0.0 };
    let mut feature = Feature::wall_block(room, footprint, plan.ceiling_m, Class::Wall, plaster());
    if rng.chance(0.4) {
        feature.solid.shape = crate::simulate::solid::Shape::Cylinder;
    }
    feature
}
