//! Changes of a home's objects between two revisions of its map.

use super::super::objects::UprightBox;
use super::assignment::{Candidate, best_pairs};
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::taxonomy::Class;

/// Distance from which an object counts as moved: boxes shift by a few centimetres with every clip.
const MIN_MOVE_M: f64 = 0.25;
/// Tolerance of a side's length of one object in two places: as much as views from other directions differ.
const SIDE_M: f64 = 0.15;
const SIDE_FRACTION: f64 = 0.25;
/// Distance beyond which all moves are alike.
const FAR_M: f64 = 20.0;

/// An object of a revision.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedObject<'a> {
    pub id: &'a str,
    pub class: Class,
    pub bounds: UprightBox,
}

/// Changes, as indices into the objects of the two revisions.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ObjectChanges {
    /// Objects of the later revision.
    pub added: Vec<usize>,
    /// Pairs of an object of the earlier and one of the later revision.
    pub moved: Vec<(usize, usize)>,
    /// Objects of the earlier revision.
    pub gone: Vec<usize>,
}

impl ObjectChanges {
    pub fn is_empty(&self) -> bool {
        self.added.is_empty() && self.moved.is_empty() && self.gone.is_empty()
    }
}

/// Returns the changes of the objects `from` one revision `to` another, both in one frame. An object moved if
/// it has its id elsewhere, or if one of the same class and size is missing in one place and new in another.
pub fn object_changes(from: &[MovedObject], to: &[MovedObject]) -> ObjectChanges {
    let index_of: BTreeMap<&str, usize> = to.iter().enumerate().map(|(i, object)| (object.id, i)).collect();
    let mut changes = ObjectChanges::default();
    for (i, object) in from.iter().enumerate() {
        match index_of.get(object.id) {
            Some(j) if distance_m(object, &to[*j]) >= MIN_MOVE_M && unlike(object, &to[*j]).is_some() => {
                changes.moved.push((i, *j));
            }
            Some(_) => {}
            None => changes.gone.push(i),
        }
    }
    let known: BTreeSet<&str> = from.iter().map(|object| object.id).collect();
    changes.added = (0..to.len()).filter(|j| !known.contains(to[*j].id)).collect();
    let mut candidates = Vec::new();
    for (row, i) in changes.gone.iter().enumerate() {
        for (column, j) in changes.added.iter().enumerate() {
            let (a, b) = (&from[*i], &to[*j]);
            if a.class != b.class {
                continue;
            }
            if let Some(unlike) = unlike(a, b) {
                let far = (distance_m(a, b) / FAR_M).min(1.0);
                // Every pair counts more than the choice between pairs.
                let score = 10_000 - (unlike * 1000.0) as i64 - (far * 500.0) as i64;
                candidates.push(Candidate { row, column, score });
            }
        }
    }
    let pairs = best_pairs(&candidates);
    changes.moved.extend(pairs.iter().map(|(row, column)| (changes.gone[*row], changes.added[*column])));
    changes.moved.sort_unstable();
    let moved = |index: usize, of: fn(&(usize, usize)) -> usize| pairs.iter().any(|pair| of(pair) == index);
    let stay = |all: &[usize], of: fn(&(usize, usize)) -> usize| -> Vec<usize> {
        let left = all.iter().enumerate().filter(|(index, _)| !moved(*index, of));
        left.map(|(_, object)| *object).collect()
    };
    changes.gone = stay(&changes.gone, |pair| pair.0);
    changes.added = stay(&changes.added, |pair| pair.1);
    changes
}

fn distance_m(a: &MovedObject, b: &MovedObject) -> f64 {
    let sides = [0, 1, 2].map(|axis| (a.bounds.centre_m[axis] - b.bounds.centre_m[axis]).powi(2));
    sides.iter().sum::<f64>().sqrt()
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

    fn object(id: &str, class: Class, x: f64, size_m: [f64; 3]) -> MovedObject<'_> {
        let bounds = UprightBox { centre_m: [x, 1.0, size_m[2] / 2.0], size_m, yaw_rad: 0.3 };
        MovedObject { id, class, bounds }
    }

    const CHAIR: [f64; 3] = [0.5, 0.5, 0.9];

    #[test]
    fn added_moved_and_gone() {
        let chair = |id, x| object(id, Class::Chair, x, CHAIR);
        let sofa = |id, x| object(id, Class::Sofa, x, [2.0, 0.9, 0.8]);
        let cases = [
            ("nothing", vec![chair("chair-1", 0.0)], vec![chair("chair-1", 0.1)], ObjectChanges::default()),
            (
                "by id",
                vec![chair("chair-1", 0.0)],
                vec![chair("chair-1", 0.5)],
                ObjectChanges { moved: vec![(0, 0)], ..ObjectChanges::default() },
            ),
            (
                "by class and size",
                vec![sofa("sofa-1", 9.0), chair("chair-1", 0.0)],
                vec![chair("chair-2", 3.0), sofa("sofa-1", 9.0)],
                ObjectChanges { moved: vec![(1, 0)], ..ObjectChanges::default() },
            ),
            (
                "another class",
                vec![sofa("sofa-1", 0.0)],
                vec![chair("chair-1", 3.0)],
                ObjectChanges { added: vec![0], gone: vec![0], ..ObjectChanges::default() },
            ),
            (
                "another size",
                vec![object("table-1", Class::Table, 0.0, [1.6, 0.9, 0.75])],
                vec![object("table-2", Class::Table, 3.0, [0.6, 0.6, 0.5])],
                ObjectChanges { added: vec![0], gone: vec![0], ..ObjectChanges::default() },
            ),
            (
                "the nearer of two",
                vec![chair("chair-1", 0.0)],
                vec![chair("chair-2", 8.0), chair("chair-3", 2.0)],
                ObjectChanges { added: vec![0], moved: vec![(0, 1)], gone: vec![] },
            ),
            (
                "all are new",
                vec![],
                vec![chair("a", 0.0)],
                ObjectChanges { added: vec![0], ..Default::default() },
            ),
        ];
        for (name, from, to, expected) in cases {
            assert_eq!(object_changes(&from, &to), expected, "{name}");
            // In the other direction what was added is gone.
            let back = object_changes(&to, &from);
            assert_eq!((back.gone, back.added), (expected.added, expected.gone), "{name}");
        }
    }

    #[test]
    fn an_object_that_was_seen_better_has_not_moved() {
        let half = object("sofa-1", Class::Sofa, 0.5, [1.0, 0.9, 0.8]);
        let whole = object("sofa-1", Class::Sofa, 1.0, [2.0, 0.9, 0.8]);
        assert!(object_changes(&[half], &[whole]).is_empty());
    }
}
