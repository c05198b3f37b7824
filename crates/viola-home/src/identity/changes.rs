//! Changes of a home's objects between two revisions of its map.

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
/// Difference of the sizes of such an object, as of [`unlike`].
const MAX_UNLIKE: f64 = 3.0;
/// Lower score of a pair whose classes differ: more than all differences of two objects of one class.
const OTHER_CLASS: i64 = 4000;
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
    /// Other objects of the later revision only: nobody had filmed there, or the detection had missed them.
    pub discovered: Vec<usize>,
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
        // An object that is only missed is found again.
        let is_missed = known_then.get(object.id).is_some_and(|known| !known.is_gone);
        let is_new = known_now.get(object.id).is_some_and(|known| known.is_new);
        if is_new && !is_missed { changes.added.push(j) } else { changes.discovered.push(j) }
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
            let of_part = || (is_as_long(a, b) && (is_same_class || is_as_high(a, b))).then_some(MAX_UNLIKE);
            if let Some(unlike) = unlike(a, b).or_else(of_part) {
                let far = (distance_m(a, b) / FAR_M).min(1.0);
                let kind = if is_same_class { 0 } else { OTHER_CLASS };
                // Every pair counts more than the choice between pairs.
                let score = 10_000 - kind - (unlike * 1000.0) as i64 - (far * 500.0) as i64;
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

/// Returns the difference of the sizes, 0 to 3; none if it is more than one object's views differ by.
fn unlike(a: &MovedObject, b: &MovedObject) -> Option<f64> {
    let mut sum = 0.0;
    for axis in 0..3 {
        let (a_m, b_m) = (a.bounds.size_m[axis], b.bounds.size_m[axis]);
        let off = (a_m - b_m).abs() / SIDE_M.max(SIDE_FRACTION * a_m.max(b_m));
        if off.is_nan() || off > 1.0 {
            return None;
        }
        sum += off;
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAIR: [f64; 3] = [0.5, 0.5, 0.9];
    const SOFA: [f64; 3] = [2.0, 0.9, 0.8];

    /// An object in a revision, and what is known of it.
    fn known(id: &str, class: Class, x: f64, size_m: [f64; 3]) -> KnownObject {
        let bounds = UprightBox { centre_m: [x, 1.0, size_m[2] / 2.0], size_m, yaw_rad: 0.3 };
        KnownObject::found(id.to_owned(), class, &bounds)
    }

    fn chair(id: &str, x: f64) -> KnownObject {
        known(id, Class::Chair, x, CHAIR)
    }

    fn new(object: KnownObject) -> KnownObject {
        KnownObject { is_new: true, ..object }
    }

    /// Missing since the last revision.
    fn missed(object: KnownObject, is_gone: bool) -> KnownObject {
        KnownObject { missing: 1, is_gone, ..object }
    }

    /// Indices are those of `from` and `to`.
    fn told(from: &[KnownObject], to: &[KnownObject]) -> ObjectChanges {
        let history = |known: &[KnownObject]| History { objects: known.to_vec(), ..History::default() };
        let (then, now) = (history(from), history(to));
        let mut later = revision(&now);
        later.objects.retain(|object| object.is_found);
        object_changes(&revision(&then), &later)
    }

    fn revision(ids: &History) -> RevisionObjects<'_> {
        let objects = ids.objects.iter().filter(|known| !known.is_gone).map(|known| MovedObject {
            id: &known.id,
            class: known.class,
            bounds: known.bounds(),
            is_put: false,
            is_found: known.missing == 0,
        });
        RevisionObjects { objects: objects.collect(), ids }
    }

    /// Each case is its name, the objects of both revisions, and their changes.
    fn check<const N: usize>(cases: [(&str, Vec<KnownObject>, Vec<KnownObject>, ObjectChanges); N]) {
        for (name, from, to, expected) in cases {
            assert_eq!(told(&from, &to), expected, "{name}");
        }
    }

    #[test]
    fn added_moved_and_gone() {
        let none = ObjectChanges::default;
        let sofa = || known("sofa-1", Class::Sofa, 9.0, SOFA);
        let cases = [
            ("nothing", vec![chair("chair-1", 0.0)], vec![chair("chair-1", 0.1)], none()),
            (
                "by id",
                vec![chair("chair-1", 0.0)],
                vec![KnownObject { moves: 1, ..chair("chair-1", 0.5) }],
                ObjectChanges { moved: vec![(0, 0)], ..none() },
            ),
            ("seen better", vec![chair("chair-1", 0.0)], vec![chair("chair-1", 0.5)], none()),
            (
                "by class and size",
                vec![sofa(), chair("chair-1", 0.0)],
                vec![new(chair("chair-2", 3.0)), sofa(), missed(chair("chair-1", 0.0), true)],
                ObjectChanges { moved: vec![(1, 0)], ..none() },
            ),
            (
                "from a place that nobody looked at again",
                vec![chair("chair-1", 0.0)],
                vec![new(chair("chair-2", 3.0)), missed(chair("chair-1", 0.0), false)],
                ObjectChanges { added: vec![0], lost: vec![0], ..none() },
            ),
            (
                "into a place that nobody had looked at",
                vec![chair("chair-1", 0.0)],
                vec![chair("chair-2", 3.0), missed(chair("chair-1", 0.0), true)],
                ObjectChanges { discovered: vec![0], gone: vec![0], ..none() },
            ),
            (
                "another class",
                vec![sofa()],
                vec![new(chair("chair-1", 3.0)), missed(sofa(), true)],
                ObjectChanges { added: vec![0], gone: vec![0], ..none() },
            ),
            (
                "another size",
                vec![known("table-1", Class::Table, 0.0, [1.6, 0.9, 0.75])],
                vec![
                    new(known("table-2", Class::Table, 3.0, [0.6, 0.6, 0.5])),
                    missed(known("table-1", Class::Table, 0.0, [1.6, 0.9, 0.75]), true),
                ],
                ObjectChanges { added: vec![0], gone: vec![0], ..none() },
            ),
            (
                "a part of it was seen",
                vec![known("chair-1", Class::Chair, 0.0, [0.6, 0.2, 0.2])],
                vec![
                    new(known("chair-2", Class::Chair, 3.0, [0.5, 0.4, 0.6])),
                    missed(known("chair-1", Class::Chair, 0.0, [0.6, 0.2, 0.2]), true),
                ],
                ObjectChanges { moved: vec![(0, 0)], ..none() },
            ),
            (
                "the nearer of two",
                vec![chair("chair-1", 0.0)],
                vec![
                    new(chair("chair-2", 8.0)),
                    new(chair("chair-3", 2.0)),
                    missed(chair("chair-1", 0.0), true),
                ],
                ObjectChanges { added: vec![0], moved: vec![(0, 1)], ..none() },
            ),
            (
                "the first clips of a place",
                vec![],
                vec![chair("chair-1", 0.0)],
                ObjectChanges { discovered: vec![0], ..none() },
            ),
        ];
        check(cases);
    }

    #[test]
    fn small_steps_and_to_and_fro() {
        let none = ObjectChanges::default;
        let cases = [
            (
                "by the last of many small steps",
                vec![chair("chair-1", 0.0)],
                vec![KnownObject { moves: 1, ..chair("chair-1", 0.1) }],
                ObjectChanges { moved: vec![(0, 0)], ..none() },
            ),
            (
                "to and fro",
                vec![chair("chair-1", 0.0)],
                vec![KnownObject { moves: 2, ..chair("chair-1", 0.1) }],
                none(),
            ),
        ];
        check(cases);
    }

    #[test]
    fn labels_may_take_a_moved_object_for_another_of_its_family() {
        let none = ObjectChanges::default;
        let cases = [
            (
                "of the same height",
                vec![known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6])],
                vec![
                    new(known("cabinet-1", Class::Cabinet, 3.0, [1.7, 0.7, 0.6])),
                    missed(known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6]), true),
                ],
                ObjectChanges { moved: vec![(0, 0)], ..none() },
            ),
            (
                "of another height",
                vec![known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6])],
                vec![
                    new(known("cabinet-1", Class::Cabinet, 3.0, [1.7, 0.7, 0.9])),
                    missed(known("shelf-1", Class::Shelf, 0.0, [1.6, 0.4, 0.6]), true),
                ],
                ObjectChanges { added: vec![0], gone: vec![0], ..none() },
            ),
        ];
        check(cases);
    }

    #[test]
    fn an_object_that_is_missed_for_a_while() {
        let none = ObjectChanges::default;
        let cases = [
            (
                "missed in between",
                vec![missed(chair("chair-1", 0.0), false)],
                vec![new(chair("chair-1", 0.0))],
                ObjectChanges { discovered: vec![0], ..none() },
            ),
            (
                "missed, and gone since",
                vec![missed(chair("chair-1", 0.0), false)],
                vec![missed(chair("chair-1", 0.0), true)],
                ObjectChanges { gone: vec![0], ..none() },
            ),
            (
                "missed for longer",
                vec![missed(chair("chair-1", 0.0), false)],
                vec![missed(chair("chair-1", 0.0), false)],
                none(),
            ),
            (
                "it came back",
                vec![missed(chair("chair-1", 0.0), true)],
                vec![new(chair("chair-1", 0.0))],
                ObjectChanges { added: vec![0], ..none() },
            ),
        ];
        check(cases);
    }

    #[test]
    fn a_person_moves_an_object() {
        let (then, now) = (chair("chair-1", 0.0), chair("chair-1", 2.0));
        let history = |known: &KnownObject| History { objects: vec![known.clone()], ..History::default() };
        let (then, now) = (history(&then), history(&now));
        let mut later = revision(&now);
        later.objects[0].is_put = true;
        let expected = ObjectChanges { moved: vec![(0, 0)], ..ObjectChanges::default() };
        assert_eq!(object_changes(&revision(&then), &later), expected);
        assert!(object_changes(&revision(&now), &later).is_empty());
    }
}
