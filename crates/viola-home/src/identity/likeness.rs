//! Likeness of two finds: the evidence that they are the same object, or the same room.

use super::super::objects::{Object, UprightBox};
use super::super::rooms::Room;
use super::super::rooms::outline::{contains, signed_area_m2};
use super::{KnownObject, KnownRoom};
use viola_geometry::Point2;
use viola_geometry::taxonomy::Class;

/// Boxes are grown by this on each side: poses move by centimetres between revisions, and a picture on a
/// wall is thinner than that.
const MARGIN_M: f64 = 0.05;
/// Minimum overlap, intersection over union, of two boxes of one family.
const MIN_IOU: f64 = 0.1;
/// Minimum fraction of the smaller box in the larger: a sofa was first seen by one half.
const MIN_SHARE: f64 = 0.5;
/// Maximum distance of the centres if the boxes do not overlap: a chair that was pushed aside a little.
const NEAR_M: f64 = 0.25;
/// Minimum overlap of two boxes of different families: labels change, but the thing fills the same space.
const MIN_IOU_OF_OTHERS: f64 = 0.4;

/// Classes that labels take for each other.
const FAMILIES: [&[Class]; 5] = [
    &[Class::Bed, Class::Sofa, Class::Chair],
    &[
        Class::Table,
        Class::Desk,
        Class::Counter,
        Class::Cabinet,
        Class::Shelf,
        Class::Refrigerator,
        Class::Stove,
        Class::WashingMachine,
        Class::Box,
    ],
    &[Class::Toilet, Class::Sink, Class::Bathtub, Class::Shower],
    &[Class::Curtain, Class::Window, Class::Door],
    &[Class::Picture, Class::Mirror, Class::Television],
];

pub fn is_family(a: Class, b: Class) -> bool {
    a == b || FAMILIES.iter().any(|family| family.contains(&a) && family.contains(&b))
}

/// Returns the score of an object as a known one, found where it was or `put` by people; none if it is not.
pub fn of_objects(known: &KnownObject, put: Option<&UprightBox>, object: &Object) -> Option<i64> {
    let bounds = known.bounds();
    let places = [Some(&bounds), put].into_iter().flatten();
    let place = places.filter_map(|place| of_boxes(place, known.class, object)).max()?;
    // Of two known objects alike, the one that was there more recently.
    Some((place - 20 * i64::from(known.missing.min(10))).max(1))
}

fn of_boxes(known: &UprightBox, class: Class, object: &Object) -> Option<i64> {
    let bounds = object.bounds();
    let between_m = [0, 1, 2].map(|axis| known.centre_m[axis] - bounds.centre_m[axis]);
    let between_m = between_m.iter().map(|side| side * side).sum::<f64>().sqrt();
    let reach_m = |one: &UprightBox| one.size_m.iter().map(|side| side * side).sum::<f64>().sqrt() / 2.0;
    let most_m = reach_m(known) + reach_m(&bounds) + 4.0 * MARGIN_M;
    if between_m.is_nan() || between_m > most_m {
        return None;
    }
    let (a, b) = (grown(known), grown(&bounds));
    let high = a.top_m().min(b.top_m()) - a.bottom_m().max(b.bottom_m());
    let shared_m3 = a.shared_m2(&b) * high.max(0.0);
    let iou = shared_m3 / (a.volume_m3() + b.volume_m3() - shared_m3);
    let share = shared_m3 / a.volume_m3().min(b.volume_m3());
    let is_same = if is_family(class, object.class) {
        iou >= MIN_IOU || share >= MIN_SHARE || between_m <= NEAR_M
    } else {
        iou >= MIN_IOU_OF_OTHERS
    };
    let near = (1.0 - between_m / 2.0).max(0.0);
    let kind = match () {
        () if class == object.class => 0.3,
        () if is_family(class, object.class) => 0.15,
        () => 0.0,
    };
    is_same.then_some(((iou + 0.5 * share + 0.5 * near + kind) * 1000.0) as i64)
}

fn grown(bounds: &UprightBox) -> UprightBox {
    UprightBox { size_m: bounds.size_m.map(|side| side + 2.0 * MARGIN_M), ..*bounds }
}

/// Number of places at which two rooms are compared.
const SAMPLES: f64 = 4000.0;
/// Minimum intersection over union of the areas of one room in two revisions.
const MIN_ROOM_IOU: f64 = 0.3;
/// Minimum fraction of the smaller area in the larger: rooms grow as they are seen.
const MIN_ROOM_SHARE: f64 = 0.7;

/// Returns the score of a room as a known one; none if it is another.
pub fn of_rooms(known: &KnownRoom, room: &Room) -> Option<i64> {
    let (low, high) = bounds(&known.polygon_m)?;
    let (other_low, other_high) = bounds(&room.polygon_m)?;
    let from = [low[0].max(other_low[0]), low[1].max(other_low[1])];
    let to = [high[0].min(other_high[0]), high[1].min(other_high[1])];
    let (width_m, height_m) = (to[0] - from[0], to[1] - from[1]);
    if !(width_m > 0.0 && height_m > 0.0) {
        return None;
    }
    let step_m = (width_m * height_m / SAMPLES).sqrt();
    let count = |length_m: f64| ((length_m / step_m).ceil() as usize).clamp(1, SAMPLES as usize);
    let (columns, rows) = (count(width_m), count(height_m));
    let mut common = 0;
    for i in 0..columns {
        for j in 0..rows {
            let x = from[0] + (i as f64 + 0.5) * width_m / columns as f64;
            let y = from[1] + (j as f64 + 0.5) * height_m / rows as f64;
            let at = Point2::new(x, y);
            common += usize::from(contains(&known.polygon_m, &at) && room.contains(&at));
        }
    }
    let shared_m2 = common as f64 / (columns * rows) as f64 * width_m * height_m;
    let (a_m2, b_m2) = (signed_area_m2(&known.polygon_m), room.area_m2);
    let iou = shared_m2 / (a_m2 + b_m2 - shared_m2).max(shared_m2).max(1e-9);
    let share = shared_m2 / a_m2.min(b_m2).max(1e-9);
    let is_same = iou >= MIN_ROOM_IOU || share >= MIN_ROOM_SHARE;
    is_same.then(|| (iou * 1000.0) as i64 + 1 - i64::from(known.missing.min(10))).map(|score| score.max(1))
}

fn bounds(ring: &[[f64; 2]]) -> Option<([f64; 2], [f64; 2])> {
    let first = *ring.first()?;
    Some(ring.iter().fold((first, first), |(low, high), corner| {
        let pick =
            |known: [f64; 2], pick: fn(f64, f64) -> f64| [0, 1].map(|axis| pick(known[axis], corner[axis]));
        (pick(low, f64::min), pick(high, f64::max))
    }))
}
