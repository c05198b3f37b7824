//! Changes of a home's objects between two revisions of its map.

#[cfg(test)]
mod tests;

use super::super::objects::UprightBox;
use super::assignment::{Candidate, best_pairs};
use super::likeness::is_family;
use super::{History, KnownObject, MIN_MOVE_M};
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::taxonomy::Class;

/// Tolerance of a side's length of one object in two places: as much as views from other directions differ.
const SIDE_M: f64 = 0.15;
const SIDE_FRACTION: f64 = 0.25;
/// Maximum ratio of the longest sides of one object, if a visit shows only a part of it.
const LONGEST_RATIO: f64 = 1.5;
/// Least difference of the sizes of such an object, as of [`unlike`], and most of what is added by its sides.
const OF_PART: f64 = 3.0;
const MOST_OF_SIDES: f64 = 2.0;
/// Maximum that a side counts, in tolerances.
const MOST_OFF: f64 = 3.0;
/// Lower score of a pair whose classes differ: more than all differences of two objects of one class, which are up to
/// [`OF_PART`] and [`MOST_OF_SIDES`] in thousandths, and [`MOST_OF_DISTANCE`].
const OTHER_CLASS: i64 = 6000;
const MOST_OF_DISTANCE: f64 = 500.0;
/// Score of a pair without differences: more than all differences, so that no pair is worse than none.
const BEST: i64 = 12_000;
/// Distance beyond which all moves are alike.
const FAR_M: f64 = 20.0;

/// An object of a revision.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedObject<'a> {
    pub id: &'a str,
    pub class: Class,
    pub bounds: UprightBox,
    /// True if a person put it there.
    pub is_put: bool,
    /// False for an object that the revision remembers, but that is not found in it.
    pub is_found: bool,
}

/// The objects of a revision, and what is known of all that had an id.
#[derive(Debug, Clone)]
pub struct RevisionObjects<'a> {
    pub objects: Vec<MovedObject<'a>>,
    pub ids: &'a History,
}

/// Changes, as indices into the objects of the two revisions.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ObjectChanges {
    /// Objects of the later revision whose place was empty before.
    pub added: Vec<usize>,
    /// Objects of the later revision that no earlier one knew, in places that nobody had filmed or looked through.
    pub discovered: Vec<usize>,
    /// Objects of the later revision that the earlier one knew and did not have: they were missed or hidden.
    pub found_again: Vec<usize>,
    /// Pairs of an object of the earlier and one of the later revision.
    pub moved: Vec<(usize, usize)>,
    /// Objects of the earlier revision whose place is empty since.
    pub gone: Vec<usize>,
    /// Other objects of the earlier revision only: their clips are gone, or the detection misses them.
    pub lost: Vec<usize>,
}

impl ObjectChanges {
    pub fn is_empty(&self) -> bool {
        *self == ObjectChanges::default()
    }
}

/// Returns the changes of the objects `from` one revision `to` another, both in one frame. An object moved if it
/// has its id elsewhere, or if one is gone from one place, and one of its class or
/// family and of its size is new in another, which was empty before.
pub fn object_changes(from: &RevisionObjects, to: &RevisionObjects) -> ObjectChanges {
    let mut changes = ObjectChanges::default();
    let (known_then, known_now) = (by_id(from.ids), by_id(to.ids));
    let place: BTreeMap<&str, usize> =
        to.objects.iter().enumerate().map(|(j, object)| (object.id, j)).collect();
    for (i, object) in from.objects.iter().enumerate() {
        let now = known_now.get(object.id);
        match place.get(object.id) {
            // It is found again.
            Some(_) if !object.is_found => {}
            Some(j) => {
                let moves = |known: Option<&&KnownObject>| known.map_or(0, |known| known.moves);
                let count = moves(now).saturating_sub(moves(known_then.get(object.id)));
                let later = &to.objects[*j];
                let is_put = object.is_put || later.is_put;
                let is_far = distance_m(object, later) >= MIN_MOVE_M;
                // One move may be the sum of small steps, of which the last one is between the revisions. After several
                // moves an object may be back.
                if is_far && (is_put || count > 0) || count == 1 && !is_put {
                    changes.moved.push((i, *j));
                }
            }
            None if now.is_some_and(|known| known.is_gone) => changes.gone.push(i),
            None if object.is_found => changes.lost.push(i),
            None => {}
        }
    }
    let then = from.objects.iter().filter(|object| object.is_found);
    let then: BTreeSet<&str> = then.map(|object| object.id).collect();
    for (j, object) in to.objects.iter().enumerate().filter(|(_, object)| !then.contains(object.id)) {
        let is_new = known_now.get(object.id).is_some_and(|known| known.is_new);
        match known_then.get(object.id) {
            // An object that was gone came back.
            Some(known) if known.is_gone && is_new => changes.added.push(j),
            Some(_) => changes.found_again.push(j),
            None if is_new => changes.added.push(j),
            None => changes.discovered.push(j),
        }
    }
    pair_moved(from, to, &mut changes);
    changes
}

fn by_id(ids: &History) -> BTreeMap<&str, &KnownObject> {
    ids.objects.iter().map(|known| (known.id.as_str(), known)).collect()
}

/// Makes pairs of gone and new objects that are one object in another place. An object in a place that nobody had filmed
/// before may have been there all the time.
fn pair_moved(from: &RevisionObjects, to: &RevisionObjects, changes: &mut ObjectChanges) {
    let mut candidates = Vec::new();
    for (row, i) in changes.gone.iter().enumerate() {
        for (column, j) in changes.added.iter().enumerate() {
            let (a, b) = (&from.objects[*i], &to.objects[*j]);
            let is_same_class = a.class == b.class;
            if !is_same_class && !is_family(a.class, b.class) {
                continue;
            }
            // A place that was emptied and one that was filled are evidence enough: visits show parts of an object. An
            // object with the label of another class of its family must be as high.
            let may_be_part = || is_as_long(a, b) && (is_same_class || is_as_high(a, b));
            let of_part = || may_be_part().then(|| OF_PART + MOST_OF_SIDES * unlike_sides(a, b));
            if let Some(unlike) = unlike(a, b).or_else(of_part) {
                let far = (distance_m(a, b) / FAR_M).min(1.0);
                let kind = if is_same_class { 0 } else { OTHER_CLASS };
                let score = BEST - kind - (unlike * 1000.0) as i64 - (far * MOST_OF_DISTANCE) as i64;
                candidates.push(Candidate { row, column, score });
            }
        }
    }
    let pairs = best_pairs(&candidates);
    let pairs: Vec<(usize, usize)> =
        pairs.into_iter().map(|(row, column)| (changes.gone[row], changes.added[column])).collect();
    changes.gone.retain(|i| !pairs.iter().any(|pair| pair.0 == *i));
    changes.added.retain(|j| !pairs.iter().any(|pair| pair.1 == *j));
    changes.moved.extend(pairs);
    changes.moved.sort_unstable();
}

fn distance_m(a: &MovedObject, b: &MovedObject) -> f64 {
    let sides = [0, 1, 2].map(|axis| (a.bounds.centre_m[axis] - b.bounds.centre_m[axis]).powi(2));
    sides.iter().sum::<f64>().sqrt()
}

/// Returns whether the longest sides are alike.
fn is_as_long(a: &MovedObject, b: &MovedObject) -> bool {
    let [a_m, b_m] = [a, b].map(|object| object.bounds.size_m.iter().copied().fold(0.0, f64::max));
    a_m.max(b_m) < LONGEST_RATIO * a_m.min(b_m)
}

fn is_as_high(a: &MovedObject, b: &MovedObject) -> bool {
    (a.bounds.top_m() - b.bounds.top_m()).abs() < SIDE_M
}

/// Returns the differences of the sides, in tolerances.
fn offs(a: &MovedObject, b: &MovedObject) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let (a_m, b_m) = (a.bounds.size_m[axis], b.bounds.size_m[axis]);
        (a_m - b_m).abs() / SIDE_M.max(SIDE_FRACTION * a_m.max(b_m))
    })
}

/// Returns the difference of the sizes, 0 to 3; none if it is more than one object's views differ by.
fn unlike(a: &MovedObject, b: &MovedObject) -> Option<f64> {
    let offs = offs(a, b);
    offs.iter().all(|off| *off <= 1.0).then(|| offs.iter().sum())
}

/// Returns the difference of any sizes, 0 to 1.
fn unlike_sides(a: &MovedObject, b: &MovedObject) -> f64 {
    // The minimum with NaN is the other number.
    offs(a, b).iter().map(|off| off.min(MOST_OFF)).sum::<f64>() / (3.0 * MOST_OFF)
}
