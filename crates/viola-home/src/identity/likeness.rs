//! Likeness of two finds: the evidence that they are the same object, or the same room.

use super::super::assemble::LookedThrough;
use super::super::objects::{Object, UprightBox};
use super::super::rooms::Room;
use super::super::rooms::bands::Bands;
use super::super::rooms::outline::{bounds_m, signed_area_m2};
use super::{KnownObject, KnownRoom, Statement};
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

/// Boxes are grown by this on each side: poses move by centimetres between revisions, and a picture on a
/// wall is thinner than that.
const MARGIN_M: f64 = 0.05;
/// Minimum overlap, intersection over union, of two boxes of one family.
const MIN_IOU: f64 = 0.1;
/// Minimum fraction of the smaller box in the larger: a sofa was first seen by one half.
const MIN_FRACTION: f64 = 0.5;
/// Maximum distance of the centres if the boxes do not overlap: a chair that was pushed aside a little.
const NEAR_M: f64 = 0.25;
/// Minimum overlap of two boxes of different families: labels change, but the thing fills the same space. Also of an
/// object with one that a person hid or moved away.
const MIN_IOU_OF_OTHERS: f64 = 0.4;

/// Returns whether labels take two classes for each other.
pub fn is_family(a: Class, b: Class) -> bool {
    use Class::*;
    const FAMILIES: [&[Class]; 5] = [
        &[Bed, Sofa, Chair],
        &[Table, Desk, Counter, Cabinet, Shelf, Refrigerator, Stove, WashingMachine, Box],
        &[Toilet, Sink, Bathtub, Shower],
        &[Curtain, Window, Door],
        &[Picture, Mirror, Television],
    ];
    a == b || FAMILIES.iter().any(|family| family.contains(&a) && family.contains(&b))
}

/// Returns the numbers of the objects that a known one may be, with their scores. An object is where a person put it; if
/// nothing is found there, it is where it was.
pub fn of_objects(
    known: &KnownObject,
    statement: Option<&Statement>,
    objects: &[Object],
    looked: &LookedThrough,
) -> Vec<(usize, i64)> {
    let is_hidden = statement.is_some_and(|statement| statement.is_hidden);
    let at = |places: &[UprightBox]| -> Vec<(usize, i64)> {
        let score = |object: &Object| {
            // An object that a person hid hides no other one that came into its place.
            if is_hidden && known.is_replaced_by(object, looked) {
                return None;
            }
            let scores = places.iter().filter_map(|place| of_boxes(place, known.class, object, is_hidden));
            // Of two known objects alike, the one that was there more recently.
            Some((scores.max()? - 20 * i64::from(known.missing.min(10))).max(1))
        };
        objects.iter().enumerate().filter_map(|(number, object)| Some((number, score(object)?))).collect()
    };
    let Some(statement) = statement else { return at(&[known.bounds()]) };
    let put = if statement.put_from.is_some() { at(&[statement.bounds]) } else { Vec::new() };
    if put.is_empty() { at(&[known.bounds(), statement.bounds]) } else { put }
}

/// Returns whether an object fills the space of a box.
pub fn fills(bounds: &UprightBox, object: &Object) -> bool {
    Shared::of(bounds, &object.bounds()).iou >= MIN_IOU_OF_OTHERS
}

/// The common space of two boxes.
struct Shared {
    /// Intersection over union.
    iou: f64,
    /// Fraction of the smaller box.
    fraction: f64,
}

impl Shared {
    fn of(a: &UprightBox, b: &UprightBox) -> Shared {
        let (a, b) = (grown(a), grown(b));
        let shared_m3 = a.shared_m3(&b);
        Shared {
            iou: shared_m3 / (a.volume_m3() + b.volume_m3() - shared_m3),
            fraction: shared_m3 / a.volume_m3().min(b.volume_m3()),
        }
    }
}

/// Returns the score of an object as one of a class in a box; none if it is another. `fills` demands that the object fills
/// the box.
fn of_boxes(known: &UprightBox, class: Class, object: &Object, fills: bool) -> Option<i64> {
    let bounds = object.bounds();
    let between_m = [0, 1, 2].map(|axis| known.centre_m[axis] - bounds.centre_m[axis]);
    let between_m = between_m.iter().map(|side| side * side).sum::<f64>().sqrt();
    let reach_m = |one: &UprightBox| one.size_m.iter().map(|side| side * side).sum::<f64>().sqrt() / 2.0;
    let most_m = reach_m(known) + reach_m(&bounds) + 4.0 * MARGIN_M;
    if between_m.is_nan() || between_m > most_m {
        return None;
    }
    let Shared { iou, fraction } = Shared::of(known, &bounds);
    let is_same = if is_family(class, object.class) && !fills {
        iou >= MIN_IOU || fraction >= MIN_FRACTION || between_m <= NEAR_M
    } else {
        iou >= MIN_IOU_OF_OTHERS
    };
    let near = (1.0 - between_m / 2.0).max(0.0);
    let kind = if class == object.class {
        0.3
    } else if is_family(class, object.class) {
        0.15
    } else {
        0.0
    };
    is_same.then_some(((iou + 0.5 * fraction + 0.5 * near + kind) * 1000.0) as i64)
}

fn grown(bounds: &UprightBox) -> UprightBox {
    UprightBox { size_m: bounds.size_m.map(|side| side + 2.0 * MARGIN_M), ..*bounds }
}

/// Number of places at which two rooms are compared.
const SAMPLES: f64 = 4000.0;
/// Minimum intersection over union of the areas of one room in two revisions.
const MIN_ROOM_IOU: f64 = 0.3;
/// Minimum fraction of the smaller area in the larger: rooms grow as they are seen.
const MIN_ROOM_FRACTION: f64 = 0.7;

/// Returns the score of a room as a known one; none if it is another.
pub fn of_rooms(known: &KnownRoom, room: &Room) -> Option<i64> {
    let [low, high] = bounds_m(&known.polygon_m);
    let [other_low, other_high] = bounds_m(&room.polygon_m);
    let from = [low[0].max(other_low[0]), low[1].max(other_low[1])];
    let to = [high[0].min(other_high[0]), high[1].min(other_high[1])];
    let (width_m, height_m) = (to[0] - from[0], to[1] - from[1]);
    // Also false for a room without corners.
    if !(width_m > 0.0 && height_m > 0.0) {
        return None;
    }
    let step_m = (width_m * height_m / SAMPLES).sqrt();
    let count = |length_m: f64| ((length_m / step_m).ceil() as usize).clamp(1, SAMPLES as usize);
    let (columns, rows) = (count(width_m), count(height_m));
    // Noisy maps have rooms of very many sides.
    let (then, now) =
        (Bands::new(&known.polygon_m, &known.holes_m), Bands::new(&room.polygon_m, &room.holes_m));
    let mut common = 0;
    for i in 0..columns {
        for j in 0..rows {
            let x = from[0] + (i as f64 + 0.5) * width_m / columns as f64;
            let y = from[1] + (j as f64 + 0.5) * height_m / rows as f64;
            let at = Point2::new(x, y);
            common += usize::from(then.contains(&at) && now.contains(&at));
        }
    }
    let shared_m2 = common as f64 / (columns * rows) as f64 * width_m * height_m;
    let holes_m2: f64 = known.holes_m.iter().map(|hole| signed_area_m2(hole)).sum();
    let (a_m2, b_m2) = (signed_area_m2(&known.polygon_m) + holes_m2, room.area_m2);
    let iou = shared_m2 / (a_m2 + b_m2 - shared_m2).max(shared_m2).max(1e-9);
    let fraction = shared_m2 / a_m2.min(b_m2).max(1e-9);
    let is_same = iou >= MIN_ROOM_IOU || fraction >= MIN_ROOM_FRACTION;
    is_same.then(|| (iou * 1000.0) as i64 + 1 - i64::from(known.missing.min(10))).map(|score| score.max(1))
}
