//! Furniture of the plan: objects along its axes, within their rooms. None is over another, except where objects may share their
//! place.

mod corner;

use super::axes::span;
use super::model::{Furniture, PlanRoom};
use crate::map_point::MapPoint;
use crate::objects::{Nesting, Object, UprightBox, is_furniture, nesting, surrounds};
use crate::rooms::outline::{distance_m, off_m};
use corner::corner;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2};

/// Objects within this of the plan's axes are drawn along them.
const SNAP_RAD: f64 = 0.35;
/// An object is moved and cut by at most this.
const MOVE_M: f64 = 0.4;
const CUT: f64 = 0.4;
/// Thinner sides become this thick, before walls and other pieces cut them.
const MIN_SIDE_M: f64 = 0.12;
/// Pieces this near a wall stand with their back to it.
const BACK_M: f64 = 0.35;
/// Objects of at least the first confidence are placed first, then those of at least the second, then the others.
const CONFIDENCE_BANDS: [f64; 2] = [0.7, 0.55];
/// Pieces with a higher underside hang: other pieces may stand below them.
const HUNG_M: f64 = 0.9;
/// The backrest of a seat is above this fraction of its height.
const BACKREST: f64 = 2.0 / 3.0;
/// Minimum points of a seat above that height, and below it.
const MIN_POINTS: usize = 15;
/// Minimum displacement of the backrest from the middle, as a fraction of the side: stools have none.
const MIN_DISPLACEMENT: f64 = 0.15;
/// Points of an object lie at most this far outside its box.
const POINT_OFF_M: f64 = 0.02;
/// A part of another piece is drawn this far within its edges.
const RIM_M: f64 = 0.02;

/// Returns whether a class has a symbol. Lamps stand on other pieces or hang.
fn is_drawn(class: Class) -> bool {
    class == Class::Plant || (is_furniture(class) && class != Class::Lamp)
}

/// Returns how one object may be in the footprint of another one.
fn nested(inner: &Object, outer: &Object) -> Option<Nesting> {
    nesting((inner.class, &inner.bounds()), (outer.class, &outer.bounds()))
}

/// Returns whether an object is drawn within the edges of another one. An appliance that stands on the floor has its own place.
fn is_part(inner: &Object, outer: &Object) -> bool {
    !inner.bounds().stands() && matches!(nested(inner, outer), Some(Nesting::BuiltIn | Nesting::On))
}

fn is_hung(object: &Object) -> bool {
    object.bounds().bottom_m() > HUNG_M
}

/// Returns the place of an object's confidence in the order, from 0. A part comes no earlier than its host, whose edges
/// bound it.
fn band(object: &Object, objects: &[Object]) -> usize {
    let of = |object: &Object| CONFIDENCE_BANDS.iter().filter(|least| object.confidence < **least).count();
    let is_host = |host: &&Object| {
        is_part(object, host) && !is_hung(host) && object.bounds().shared_m2(&host.bounds()) > 0.0
    };
    objects.iter().filter(is_host).map(of).fold(of(object), usize::max)
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

    /// Returns whether these bounds, a part of the original ones, have enough of their area.
    fn is_rest_of(&self, original: &Bounds) -> bool {
        let area = |bounds: &Bounds| bounds.size(0).max(0.0) * bounds.size(1).max(0.0);
        area(self) >= (1.0 - CUT) * area(original)
    }
}

/// An object that is drawn.
struct Placed<'a> {
    object: &'a Object,
    piece: Furniture,
    bounds: Bounds,
}

/// Points of all chairs and sofas.
struct Seats<'a> {
    points: Vec<&'a MapPoint>,
}

impl Seats<'_> {
    /// Returns the places of the points of an object.
    fn of(&self, object: &Object) -> Vec<[f64; 3]> {
        let bounds = object.bounds();
        let own = self.points.iter().filter(|seat| seat.point.label.class == object.class);
        let at = own.map(|seat| seat.point.position_m.map(f64::from));
        at.filter(|at| bounds.holds(at, POINT_OFF_M)).collect()
    }

    /// Returns whether an object stands in the recess of a corner sofa.
    fn surround(&self, inner: &Object, sofa: &Object) -> bool {
        let (own, within) = (sofa.bounds(), inner.bounds());
        sofa.class == Class::Sofa && own.shared_m2(&within) > 0.0 && surrounds(&self.of(sofa), &own, &within)
    }

    /// Returns whether two objects may be drawn over each other.
    fn may_overlap(&self, a: &Object, b: &Object) -> bool {
        nested(a, b).is_some() || nested(b, a).is_some() || self.surround(a, b) || self.surround(b, a)
    }
}

/// Returns the pieces to draw, in that order. Standing pieces are placed before hung ones, then surer ones before
/// others, then larger ones. Each gives way to those placed before it, or is left out. `points` is the fused map.
pub(super) fn furniture(
    objects: &[Object],
    points: &[MapPoint],
    rooms: &[PlanRoom],
    plan_from_map: &Pose2,
) -> Vec<Furniture> {
    let is_seat = |point: &&MapPoint| matches!(point.point.label.class, Class::Chair | Class::Sofa);
    let seats = Seats { points: points.iter().filter(is_seat).collect() };
    let drawn = objects.iter().filter(|object| is_drawn(object.class));
    let mut order: Vec<((bool, usize), &Object)> =
        drawn.map(|object| ((is_hung(object), band(object, objects)), object)).collect();
    let area = |object: &Object| object.size_m[0] * object.size_m[1];
    order.sort_by(|(stage, a), (other, b)| {
        stage.cmp(other).then(area(b).total_cmp(&area(a))).then(a.id.cmp(&b.id))
    });
    let mut placed: Vec<Placed> = Vec::new();
    for (_, object) in order {
        let piece = piece(object, &seats, rooms, plan_from_map);
        if let Some(next) = piece.and_then(|piece| fit(object, piece, rooms, &placed, &seats)) {
            placed.push(next);
        }
    }
    let mut pieces: Vec<(u8, &Placed)> =
        placed.iter().map(|piece| (layer(piece, &placed, &seats), piece)).collect();
    pieces.sort_by_key(|(layer, _)| *layer);
    pieces.into_iter().map(|(_, placed)| placed.piece.clone()).collect()
}

/// Layers of the drawing, from below: chairs and what is below the filled top of another piece, other standing pieces, worktops
/// on them, and parts.
const BELOW: u8 = 0;
const STANDING: u8 = 1;
const TOP: u8 = 2;
const PART: u8 = 3;

/// Returns the layer of a piece.
fn layer(piece: &Placed, placed: &[Placed], seats: &Seats) -> u8 {
    let others = placed.iter().filter(|other| other.bounds.meets(&piece.bounds));
    let layer = |other: &Placed| match nested(piece.object, other.object) {
        Some(Nesting::Below) => BELOW,
        Some(Nesting::Top) => TOP,
        Some(Nesting::BuiltIn | Nesting::On) => PART,
        None if other.object.id != piece.object.id && seats.surround(piece.object, other.object) => PART,
        None => STANDING,
    };
    let layers: Vec<u8> = others.map(layer).collect();
    if piece.object.class == Class::Chair || layers.contains(&BELOW) {
        return BELOW;
    }
    layers.into_iter().max().unwrap_or(STANDING)
}

/// Returns an object's piece in the plan's frame.
fn piece(object: &Object, seats: &Seats, rooms: &[PlanRoom], plan_from_map: &Pose2) -> Option<Furniture> {
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
    let (bounds, places) = (object.bounds(), seats.of(object));
    let corner = if object.class == Class::Sofa { corner(&places, &bounds) } else { None };
    let back = corner.map(|corner| corner.back).or_else(|| seen_back(&bounds, places));
    Some(Furniture {
        id: object.id.clone(),
        class: object.class,
        centre_m: [at.x, at.y],
        size_m,
        yaw_rad,
        back: back.map(|side| (side + turns.rem_euclid(4.0) as u8) % 4),
        recess: corner.map(|corner| corner.recess),
    })
}

/// Returns the side of a seat's backrest, in quarter turns of the object's own frame from -y: the side to which
/// the highest points are displaced. None without enough points, and for a stool.
fn seen_back(bounds: &UprightBox, places: Vec<[f64; 3]>) -> Option<u8> {
    let backrest_m = BACKREST * bounds.top_m();
    let (high, low): (Vec<[f64; 3]>, Vec<[f64; 3]>) = places.into_iter().partition(|at| at[2] > backrest_m);
    if high.len().min(low.len()) < MIN_POINTS {
        return None;
    }
    let local = high.iter().map(|[x, y, _]| bounds.local(*x, *y));
    let sum = local.fold([0.0; 2], |sum, at| [sum[0] + at[0], sum[1] + at[1]]);
    // A displacement counts relative to its side, as seats are seldom square.
    let [x, y] = [0, 1].map(|axis| sum[axis] / high.len() as f64 / bounds.size_m[axis]);
    if x.abs().max(y.abs()) < MIN_DISPLACEMENT {
        return None;
    }
    Some(match (x.abs() > y.abs(), x > 0.0, y > 0.0) {
        (true, true, _) => 1,
        (true, false, _) => 3,
        (false, _, true) => 2,
        (false, _, false) => 0,
    })
}

fn bounds(piece: &Furniture) -> Bounds {
    let [x, y] = span(piece.corners_m());
    Bounds { low: [x[0], y[0]], high: [x[1], y[1]] }
}

/// Moves and cuts a piece until it is in a room and over no other, except those with which it may share its place; none if that
/// is not the same piece any more.
fn fit<'a>(
    object: &'a Object,
    mut piece: Furniture,
    rooms: &[PlanRoom],
    placed: &[Placed],
    seats: &Seats,
) -> Option<Placed<'a>> {
    let original = bounds(&piece);
    let centre = Point2::from(piece.centre_m);
    let away = |room: &PlanRoom| off_m(&room.outline.ring_m, &room.outline.holes_m, &centre);
    let room = rooms.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
    let mut now = into_room(original, room)?;
    let is_host = |other: &&Placed| is_part(object, other.object) && other.bounds.meets(&now);
    if let Some(host) = placed.iter().find(is_host).map(|host| host.bounds) {
        let within = Bounds {
            low: [0, 1].map(|axis| now.low[axis].max(host.low[axis] + RIM_M)),
            high: [0, 1].map(|axis| now.high[axis].min(host.high[axis] - RIM_M)),
        };
        // A television may be wider than its cabinet.
        if within.is_rest_of(&original) {
            now = within;
        }
    }
    let others: Vec<&Bounds> = placed
        .iter()
        .filter(|other| !seats.may_overlap(object, other.object))
        .map(|other| &other.bounds)
        .collect();
    let meets = |now: &Bounds| others.iter().find(|other| other.meets(now)).copied();
    for _ in 0..4 {
        let Some(other) = meets(&now) else { break };
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
        moved <= MOVE_M && now.size(axis) >= (1.0 - CUT) * original.size(axis).min(0.3)
    });
    if !is_same || !now.is_rest_of(&original) || meets(&now).is_some() {
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
    // Chairs face their tables, whatever wall is near, and corner sofas their recess.
    if !is_turned && piece.class != Class::Chair && piece.recess.is_none() {
        piece.back = back(&piece, room);
    }
    Some(Placed { object, piece, bounds: now })
}

/// Moves a box out of the walls of a room: away from the corners of the room that it reaches over.
fn into_room(mut now: Bounds, room: &PlanRoom) -> Option<Bounds> {
    let rings = std::iter::once(&room.outline.ring_m).chain(&room.outline.holes_m);
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
    let steps = [0.02, 0.5, 0.98];
    let is_inside = steps.iter().all(|i| {
        steps.iter().all(|j| room.contains([now.low[0] + i * now.size(0), now.low[1] + j * now.size(1)]))
    });
    (is_inside && now.size(0) > 0.0 && now.size(1) > 0.0).then_some(now)
}

/// Returns the side of a piece that stands at a wall, else the one that was seen. Beds and toilets have a short side
/// at the wall, others a long one.
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
    if costs[best].0 < BACK_M {
        return Some(best as u8);
    }
    let has_back = matches!(piece.class, Class::Bed | Class::Sofa | Class::Toilet);
    piece.back.or(has_back.then_some(best as u8))
}

#[cfg(test)]
mod tests;
