//! Matches found objects with true ones.

use super::instances::MIN_EXTENT_M;
use crate::pairs::greedy;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use viola_geometry::taxonomy::Class;
use viola_home::{Object, UprightBox};

/// Minimum IoU of a match (the usual threshold for detection in scans).
pub const MIN_IOU: f64 = 0.25;

/// A true or found object.
#[derive(Debug, Clone, Copy)]
pub struct Thing {
    pub class: Class,
    pub bounds: UprightBox,
}

impl Thing {
    pub fn of(object: &Object) -> Thing {
        Thing { class: object.class, bounds: object.bounds() }
    }

    /// Returns whether it is longer than [`MIN_EXTENT_M`] along some axis.
    pub fn is_large(&self) -> bool {
        self.bounds.size_m.iter().any(|side| *side > MIN_EXTENT_M)
    }
}

/// Counts of one class.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ClassRow {
    pub truth: usize,
    pub found: usize,
    pub matched: usize,
}

/// Counts of matches by class.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Matches {
    pub classes: BTreeMap<String, ClassRow>,
    pub total: ClassRow,
    /// For each true object, the index of its match and their IoU.
    pub of_truth: Vec<Option<(usize, f64)>>,
}

impl ClassRow {
    pub fn recall(&self) -> f64 {
        self.matched as f64 / self.truth as f64
    }

    pub fn precision(&self) -> f64 {
        self.matched as f64 / self.found as f64
    }
}

/// Matches objects of the same class greedily by IoU, each at most once. Found objects that match `small` true objects do
/// not count, nor do unmatched objects that are not large.
pub fn matches(truth: &[Thing], small: &[Thing], found: &[Thing]) -> Matches {
    let mut pairs = Vec::new();
    for (t, thing) in truth.iter().chain(small).enumerate() {
        for (f, other) in found.iter().enumerate().filter(|(_, other)| other.class == thing.class) {
            let iou = thing.bounds.iou(&other.bounds);
            if iou >= MIN_IOU {
                pairs.push((iou, t, f));
            }
        }
    }
    let mut of_true: Vec<Option<(usize, f64)>> = vec![None; truth.len() + small.len()];
    // True if the true object that a found one matches counts.
    let mut counts: Vec<Option<bool>> = vec![None; found.len()];
    for (iou, t, f) in greedy(pairs) {
        of_true[t] = Some((f, iou));
        counts[f] = Some(t < truth.len());
    }
    of_true.truncate(truth.len());
    let mut matches = Matches { of_truth: of_true, ..Matches::default() };
    let mut count = |class: Class, add: fn(&mut ClassRow)| {
        add(matches.classes.entry(class.name().to_owned()).or_default());
        add(&mut matches.total);
    };
    truth.iter().for_each(|thing| count(thing.class, |row| row.truth += 1));
    let counted =
        found.iter().zip(counts).filter(|(thing, counts)| counts.unwrap_or_else(|| thing.is_large()));
    counted.for_each(|(thing, _)| count(thing.class, |row| row.found += 1));
    let matched: Vec<Class> =
        truth.iter().zip(&matches.of_truth).filter(|(_, m)| m.is_some()).map(|(t, _)| t.class).collect();
    for class in matched {
        matches.classes.entry(class.name().to_owned()).or_default().matched += 1;
        matches.total.matched += 1;
    }
    matches
}

impl Matches {
    /// Adds another home's counts and clears the pairs.
    pub fn add(&mut self, other: &Matches) {
        let sum = |a: &mut ClassRow, b: &ClassRow| {
            (a.truth, a.found, a.matched) = (a.truth + b.truth, a.found + b.found, a.matched + b.matched);
        };
        sum(&mut self.total, &other.total);
        for (class, row) in &other.classes {
            sum(self.classes.entry(class.clone()).or_default(), row);
        }
        self.of_truth.clear();
    }

    pub fn markdown(&self) -> String {
        let mut out = "| class | truth | found | matched | recall | precision |\n|---|---|---|---|---|---|\n"
            .to_owned();
        let fraction =
            |value: f64| if value.is_finite() { format!("{:.0} %", value * 100.0) } else { "-".into() };
        let rows = self.classes.iter().map(|(name, row)| (name.as_str(), row));
        for (name, row) in rows.chain([("all", &self.total)]) {
            // Writing into a string cannot fail.
            let _ = writeln!(
                out,
                "| {name} | {} | {} | {} | {} | {} |",
                row.truth,
                row.found,
                row.matched,
                fraction(row.recall()),
                fraction(row.precision())
            );
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thing(class: Class, x: f64, side: f64) -> Thing {
        Thing {
            class,
            bounds: UprightBox { centre_m: [x, 0.0, 0.5], size_m: [side, side, 1.0], yaw_rad: 0.0 },
        }
    }

    #[test]
    fn each_thing_is_matched_once_and_small_mistakes_do_not_count() {
        let low = |class: Class, x: f64, side: f64| Thing {
            bounds: UprightBox { size_m: [side; 3], ..thing(class, x, side).bounds },
            class,
        };
        let truth =
            [thing(Class::Chair, 0.0, 1.0), thing(Class::Chair, 5.0, 1.0), thing(Class::Bed, 9.0, 1.0)];
        // A nightstand that does not count, nor does what was found of it.
        let small = [low(Class::Cabinet, 20.0, 0.49)];
        let found = [
            thing(Class::Chair, 0.1, 1.0),
            thing(Class::Chair, 0.2, 1.0),
            thing(Class::Sofa, 9.0, 1.0),
            // Unmatched, but only 0.3 m high and wide.
            low(Class::Lamp, 2.0, 0.3),
            low(Class::Cabinet, 20.0, 0.52),
        ];
        let m = matches(&truth, &small, &found);
        assert_eq!(m.total, ClassRow { truth: 3, found: 3, matched: 1 });
        assert_eq!(m.of_truth[0].map(|(f, _)| f), Some(0));
        assert_eq!(m.classes["chair"], ClassRow { truth: 2, found: 2, matched: 1 });
        let mut sum = m.clone();
        sum.add(&m);
        assert_eq!(sum.total, ClassRow { truth: 6, found: 6, matched: 2 });
        assert!(m.markdown().contains("| all | 3 | 3 | 1 | 33 % | 33 % |"));
    }
}
