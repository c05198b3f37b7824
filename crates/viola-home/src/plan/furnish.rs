//! Furniture of the plan: objects along its axes, within their rooms, none over another.

use super::model::{Furniture, PlanRoom};
use crate::objects::{Object, is_furniture};
use crate::rooms::outline::{contains, distance_m};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2};

/// Objects within this of the plan's axes are drawn along them.
const SNAP_RAD: f64 = 0.35;
/// An object is moved and cut by at most this.
const MOVE_M: f64 = 0.4;
const CUT: f64 = 0.4;
/// Smallest side of a drawn piece.
const MIN_SIDE_M: f64 = 0.12;
/// Pieces this near a wall stand with their back to it.
const BACK_M: f64 = 0.35;

/// Returns whether a class has a symbol. Lamps stand on other pieces or hang.
fn is_drawn(class: Class) -> bool {
    class == Class::Plant || (is_furniture(class) && class != Class::Lamp)
}

/// Returns whether a class is drawn as a part of another.
fn is_set_in(class: Class, host: Class) -> bool {
    use Class::*;
    match class {
        Sink | Stove => matches!(host, Counter | Cabinet | Desk | Table),
        Television => matches!(host, Cabinet | Shelf | Table | Desk | Counter),
        _ => false,
    }
}

/// A piece along the axes, as an interval of each axis.
#[derive(Clone, Copy)]
struct Bounds {
    low: [f64; 2],
    high: [f64; 2],
}

impl Bounds {
    fn size(&self, axis: usize) -> f64 {
        self.high[axis] - self.low[axis]
    }

    fn overlap(&self, other: &Bounds, axis: usize) -> f64 {
        self.high[axis].min(other.high[axis]) - self.low[axis].max(other.low[axis])
    }

    fn meets(&self, other: &Bounds) -> bool {
        (0..2).all(|axis| self.overlap(other, axis) > 1e-6)
    }
}

/// Returns the pieces to draw: larger ones keep their place, smaller ones give way or are left out.
pub(super) fn furniture(objects: &[Object], rooms: &[PlanRoom], plan_from_map: &Pose2) -> Vec<Furniture> {
    let mut order: Vec<&Object> = objects.iter().filter(|object| is_drawn(object.class)).collect();
    let area = |object: &Object| object.size_m[0] * object.size_m[1];
    order.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.id.cmp(&b.id)));
    let mut placed: Vec<(Furniture, Bounds)> = Vec::new();
    for object in order {
        if let Some(next) = piece(object, rooms, plan_from_map).and_then(|piece| fit(piece, rooms, &placed)) {
            placed.push(next);
        }
    }
    placed.into_iter().map(|(piece, _)| piece).collect()
}

/// Returns an object's piece in the plan's frame.
fn piece(object: &Object, rooms: &[PlanRoom], plan_from_map: &Pose2) -> Option<Furniture> {
    let at = plan_from_map.apply(&Point2::new(object.centre_m[0], object.centre_m[1]));
    if rooms.is_empty() {
        return None;
    }
    let yaw = object.yaw_rad + plan_from_map.yaw_rad;
    let turns = (yaw / FRAC_PI_2).round();
    let off = yaw - turns * FRAC_PI_2;
    let [x, y] = [object.size_m[0], object.size_m[1]].map(|side| side.max(MIN_SIDE_M));
    let size_m = if turns.rem_euclid(2.0) < 0.5 { [x, y] } else { [y, x] };
    let yaw_rad = if off.abs() <= SNAP_RAD.min(FRAC_PI_4) { 0.0 } else { off };
    Some(Furniture {
        id: object.id.clone(),
        class: object.class,
        centre_m: [at.x, at.y],
        size_m,
        yaw_rad,
        back: None,
        is_set_in: false,
    })
}

fn bounds(piece: &Furniture) -> Bounds {
    let corners = piece.corners_m();
    let fold = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
        corners.iter().map(|corner| corner[axis]).fold(start, pick)
    };
    Bounds {
        low: [0, 1].map(|axis| fold(axis, f64::min, f64::INFINITY)),
        high: [0, 1].map(|axis| fold(axis, f64::max, f64::NEG_INFINITY)),
    }
}

/// Moves and cuts a piece until it is in a room and over no other; none if that is not the same piece any more.
fn fit(
    mut piece: Furniture,
    rooms: &[PlanRoom],
    placed: &[(Furniture, Bounds)],
) -> Option<(Furniture, Bounds)> {
    let original = bounds(&piece);
    let centre = Point2::from(piece.centre_m);
    let away = |room: &PlanRoom| {
        if contains(&room.outline.ring_m, &centre) { 0.0 } else { distance_m(&room.outline.ring_m, &centre) }
    };
    let room = rooms.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
    let mut now = into_room(original, room)?;
    if let Some((_, host)) =
        placed.iter().find(|(host, at)| is_set_in(piece.class, host.class) && at.meets(&now))
    {
        piece.is_set_in = true;
        for axis in 0..2 {
            now.low[axis] = now.low[axis].max(host.low[axis] + 0.02);
            now.high[axis] = now.high[axis].min(host.high[axis] - 0.02);
        }
    }
    let meets = |now: &Bounds, piece: &Furniture| {
        placed
            .iter()
            .find(|(other, at)| at.meets(now) && !(piece.is_set_in && is_set_in(piece.class, other.class)))
    };
    for _ in 0..4 {
        let Some((_, other)) = meets(&now, &piece) else { break };
        // The side with the least overlap gives way: chairs are moved, other pieces cut.
        let axis = usize::from(now.overlap(other, 1) < now.overlap(other, 0));
        let by = now.overlap(other, axis) + 0.01;
        let is_above = now.low[axis] + now.high[axis] > other.low[axis] + other.high[axis];
        let moves = piece.class == Class::Chair;
        if is_above || moves {
            now.low[axis] += if is_above { by } else { -by };
        }
        if !is_above || moves {
            now.high[axis] += if is_above { by } else { -by };
        }
        now = into_room(now, room)?;
    }
    let is_same = (0..2).all(|axis| {
        let moved = (now.low[axis] + now.high[axis] - original.low[axis] - original.high[axis]).abs() / 2.0;
        moved <= MOVE_M
            && now.size(axis) >= MIN_SIDE_M
            && now.size(axis) >= (1.0 - CUT) * original.size(axis).min(0.3)
    });
    let kept = now.size(0) * now.size(1) / (original.size(0) * original.size(1)).max(1e-9);
    if !is_same || kept < 1.0 - CUT || meets(&now, &piece).is_some() {
        return None;
    }
    let is_turned = piece.yaw_rad != 0.0;
    piece.centre_m = [0, 1].map(|axis| (now.low[axis] + now.high[axis]) / 2.0);
    let scale = [0, 1].map(|axis| now.size(axis) / original.size(axis));
    piece.size_m = if is_turned {
        piece.size_m.map(|side| side * scale[0].min(scale[1]))
    } else {
        [now.size(0), now.size(1)]
    };
    piece.back = if is_turned { None } else { back(&piece, room) };
    Some((piece, now))
}

/// Moves a box out of the walls of a room: away from the corners of the room that it reaches over.
fn into_room(mut now: Bounds, room: &PlanRoom) -> Option<Bounds> {
    let ring = &room.outline.ring_m;
    let rings = std::iter::once(ring).chain(&room.outline.holes_m);
    let edges: Vec<([f64; 2], [f64; 2])> =
        rings.flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)).map(|(a, b)| (*a, *b))).collect();
    for _ in 0..3 {
        for (a, b) in &edges {
            let axis = usize::from((a[0] - b[0]).abs() > (a[1] - b[1]).abs());
            let along = [a[1 - axis].min(b[1 - axis]), a[1 - axis].max(b[1 - axis])];
            let shared = now.high[1 - axis].min(along[1]) - now.low[1 - axis].max(along[0]);
            let line = (a[axis] + b[axis]) / 2.0;
            if shared < 0.02 || line <= now.low[axis] || line >= now.high[axis] {
                continue;
            }
            // The room is on the left of its edges.
            let inside_up = if axis == 0 { b[1] < a[1] } else { b[0] > a[0] };
            let by = if inside_up { line - now.low[axis] } else { line - now.high[axis] };
            if by.abs() > MOVE_M {
                continue;
            }
            // A piece that stands in a wall is cut by half of that, and moved by the other half.
            if inside_up {
                now.low[axis] = line;
                now.high[axis] += by / 2.0;
            } else {
                now.high[axis] = line;
                now.low[axis] += by / 2.0;
            }
        }
    }
    let middle = Point2::from([0, 1].map(|axis| (now.low[axis] + now.high[axis]) / 2.0));
    let steps = [0.02, 0.5, 0.98];
    let is_inside = steps.iter().all(|i| {
        steps.iter().all(|j| {
            let corner = Point2::new(now.low[0] + i * now.size(0), now.low[1] + j * now.size(1));
            contains(ring, &corner) && !room.outline.holes_m.iter().any(|hole| contains(hole, &corner))
        })
    });
    (contains(ring, &middle) && is_inside && now.size(0) > 0.0 && now.size(1) > 0.0).then_some(now)
}

/// Returns the side of a piece that stands at a wall. Beds and toilets have a short side there, others a long one.
fn back(piece: &Furniture, room: &PlanRoom) -> Option<u8> {
    let [x, y] = piece.size_m.map(|side| side / 2.0);
    let sides = [[0.0, -y], [x, 0.0], [0.0, y], [-x, 0.0]];
    let prefers_short = matches!(piece.class, Class::Bed | Class::Toilet);
    let cost = |side: usize| {
        let at = Point2::new(piece.centre_m[0] + sides[side][0], piece.centre_m[1] + sides[side][1]);
        let own = piece.size_m[side % 2];
        let is_short = own < piece.size_m[1 - side % 2] - 0.05;
        let is_long = own > piece.size_m[1 - side % 2] + 0.05;
        let penalty = if (prefers_short && is_long) || (!prefers_short && is_short) { 0.5 } else { 0.0 };
        (distance_m(&room.outline.ring_m, &at), penalty)
    };
    let costs: Vec<(f64, f64)> = (0..4).map(cost).collect();
    let total = |side: &usize| costs[*side].0 + costs[*side].1;
    let best = (0..4).min_by(|a, b| total(a).total_cmp(&total(b)))?;
    let is_at_wall =
        costs[best].0 < BACK_M || matches!(piece.class, Class::Bed | Class::Sofa | Class::Toilet);
    is_at_wall.then_some(best as u8)
}
