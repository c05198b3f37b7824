//! Evidence of the clips about an object's place: that it was empty before, or that it is empty since.
//!
//! An object that is found for the first time is new only if an earlier clip looked through its place. An object
//! that is not found any more is gone only if a later clip looked through its place. Otherwise nobody had filmed
//! there, or the detection failed.

use super::super::assemble::LookedThrough;
use super::super::objects::{Object, UprightBox};
use serde::{Deserialize, Serialize};

/// Minimum fraction of an object's points whose place was empty. Points at walls are never seen through.
const MIN_EMPTY: f64 = 0.4;
/// The same if its inside was empty too. Views that pass close to a surface count for nothing, so thin and crooked
/// things lose most of their points.
const MIN_EMPTY_AT_SURFACE: f64 = 0.15;
/// Minimum fraction of the inside that views looked through only while the object was not there, of all that none looked
/// through while it was.
const MIN_EMPTY_INSIDE: f64 = 0.5;
/// Minimum number of places inside an object by which it is judged.
const MIN_PLACES: usize = 12;
/// Distance between these places, two cells of the looked-through space.
const PLACE_M: f64 = 0.08;
/// Distance of these places from the box's sides: the object's surface is there, and the floor and walls are beyond.
const INSET_M: f64 = 0.06;
/// The same of an object that is still found there, but in a slightly different place.
const MIN_EMPTIED: f64 = 0.25;
/// Minimum fraction of the points in an object's place that later clips see, if it is not gone.
const MIN_SEEN_LATER: f64 = 0.3;
/// Minimum fraction of an object's points in the changed tiles: the others are not judged.
const MIN_JUDGED: f64 = 0.3;

/// A point of an object's surface, and the recording time of the clip that saw it best, if it is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KnownPoint(pub [f32; 3], pub Option<i64>);

/// Returns points of an object's surface, in centimetres.
pub fn points_of(object: &Object, looked: &LookedThrough) -> Vec<KnownPoint> {
    let rounded = |c: f32| (c * 100.0).round() / 100.0;
    let point = |sample: &super::super::objects::Sample| {
        KnownPoint(sample.at_m.map(rounded), looked.time_ms(sample.clip))
    };
    object.samples.iter().map(point).collect()
}

/// Returns whether clips looked through an object's place before it was seen there.
pub fn was_empty(bounds: &UprightBox, points: &[KnownPoint], looked: &LookedThrough) -> bool {
    let at_surface = fraction(points, |at_m, time_ms| looked.before(at_m, time_ms));
    let first_ms = points.iter().filter_map(|point| point.1).min();
    let inside = || {
        let first_ms = first_ms?;
        empty_inside(bounds, |at_m| {
            let is_seen_through = looked.after(at_m, first_ms.saturating_sub(1))?;
            Some((!is_seen_through, looked.before(at_m, first_ms)?))
        })
    };
    at_surface.is_some_and(|at_surface| is_enough(at_surface, inside))
}

/// Returns whether clips looked through an object's place after it was seen there; `None` if too little of the place
/// changed to tell.
pub fn is_empty(bounds: &UprightBox, points: &[KnownPoint], looked: &LookedThrough) -> Option<bool> {
    let at_surface = fraction(points, |at_m, time_ms| looked.after(at_m, time_ms))?;
    let last_ms = points.iter().filter_map(|point| point.1).max();
    let inside = || {
        let last_ms = last_ms?;
        empty_inside(bounds, |at_m| {
            let is_seen_through = looked.before(at_m, last_ms.saturating_add(1))?;
            Some((!is_seen_through, looked.after(at_m, last_ms)?))
        })
    };
    Some(is_enough(at_surface, inside))
}

fn is_enough(at_surface: f64, inside: impl Fn() -> Option<f64>) -> bool {
    at_surface >= MIN_EMPTY
        || at_surface >= MIN_EMPTY_AT_SURFACE && inside().is_some_and(|inside| inside >= MIN_EMPTY_INSIDE)
}

/// Returns the fraction of the places inside a box that were empty without the object, of those that views of it left
/// dark; `None` if they are few. `judge` returns both of a place; none of a place that did not change.
fn empty_inside(bounds: &UprightBox, judge: impl Fn([f32; 3]) -> Option<(bool, bool)>) -> Option<f64> {
    let (mut dark, mut empty) = (0, 0);
    for at_m in bounds.places_inside(PLACE_M, INSET_M) {
        if let Some((true, is_empty)) = judge(at_m.map(|c| c as f32)) {
            dark += 1;
            empty += usize::from(is_empty);
        }
    }
    (dark >= MIN_PLACES).then(|| empty as f64 / dark as f64)
}

/// Returns whether clips after those of an object's points see enough of `now`; a clip of unknown time may be one.
pub fn is_seen_later(then: &[KnownPoint], now: &[KnownPoint]) -> bool {
    let last_ms = then.iter().filter_map(|point| point.1).max();
    last_ms.is_none_or(|last_ms| is_seen_after(now, last_ms))
}

/// Returns whether clips after `time_ms` see enough of `points`; a clip of unknown time may be one.
pub fn is_seen_after(points: &[KnownPoint], time_ms: i64) -> bool {
    let later = points.iter().filter(|point| point.1.is_none_or(|seen_ms| seen_ms > time_ms)).count();
    later as f64 >= MIN_SEEN_LATER * points.len() as f64
}

/// Returns whether all points are of clips that are in the map, and of known time; false without points.
pub fn is_of_map(points: &[KnownPoint], looked: &LookedThrough) -> bool {
    let is_known = |point: &KnownPoint| point.1.is_some_and(|time_ms| looked.has_clip_of(time_ms));
    !points.is_empty() && points.iter().all(is_known)
}

/// Returns whether an object was pushed aside: clips looked through a part of its earlier place after it was seen there,
/// and later clips see it. No later clip sees the rest of an object that was taken away.
pub fn is_pushed(then: &[KnownPoint], now: &[KnownPoint], looked: &LookedThrough) -> bool {
    let last_ms = then.iter().filter_map(|point| point.1).max();
    let later = now.iter().filter(|point| point.1 > last_ms).count();
    let emptied = fraction(then, |at_m, time_ms| looked.after(at_m, time_ms));
    2 * later >= now.len() && emptied.is_some_and(|fraction| fraction >= MIN_EMPTIED)
}

/// Returns the fraction of the points for which `is_empty` holds, of those that can be judged; `None` if they are few.
fn fraction(points: &[KnownPoint], is_empty: impl Fn([f32; 3], i64) -> Option<bool>) -> Option<f64> {
    // A point of unknown time is judged: nothing is known to be earlier or later.
    let judge = |point: &KnownPoint| match point.1 {
        Some(time_ms) => is_empty(point.0, time_ms),
        None => Some(false),
    };
    let judged: Vec<bool> = points.iter().filter_map(judge).collect();
    if (judged.len() as f64) < MIN_JUDGED * points.len().max(1) as f64 {
        return None;
    }
    Some(judged.iter().filter(|empty| **empty).count() as f64 / judged.len() as f64)
}
