//! Scores of the changes that a map tells.

use super::super::matching::{MIN_IOU, Thing};
use super::Told;
use super::truth::TrueChanges;
use crate::pairs::greedy;
use serde::Serialize;
use viola_home::is_furniture;

/// Distance of the centres of one object: the success threshold of poses.
const NEAR_M: f64 = 0.3;

/// Counts of one kind of change.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Score {
    pub truth: usize,
    /// Told changes of furniture that are right or wrong.
    pub told: usize,
    pub right: usize,
    /// Of the right ones, those of the true class.
    pub right_class: usize,
}

/// Counts of all kinds.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Scores {
    pub added: Score,
    pub moved: Score,
    pub gone: Score,
    /// Objects that one of the revisions lacks without a change.
    pub discovered: usize,
    pub lost: usize,
    /// Changes that were not told, and told ones that are wrong, in words.
    pub missed: Vec<String>,
    pub wrong: Vec<String>,
}

impl Scores {
    /// Adds the counts of another home, or of other revisions.
    pub fn add(&mut self, other: &Scores) {
        for (sum, more) in
            [(&mut self.added, other.added), (&mut self.moved, other.moved), (&mut self.gone, other.gone)]
        {
            *sum = Score {
                truth: sum.truth + more.truth,
                told: sum.told + more.told,
                right: sum.right + more.right,
                right_class: sum.right_class + more.right_class,
            };
        }
        self.discovered += other.discovered;
        self.lost += other.lost;
        self.missed.extend_from_slice(&other.missed);
        self.wrong.extend_from_slice(&other.wrong);
    }
}

/// Compares told changes with the true ones by their places. Boxes match from an IoU of [`MIN_IOU`], or if their
/// centres are near each other in the plane: a visit often shows less than half of a small object.
pub fn score(truth: &TrueChanges, told: &Told) -> Scores {
    let mut scores = Scores { discovered: told.discovered, lost: told.lost, ..Scores::default() };
    let one = |things: &[Thing]| things.iter().map(|thing| vec![*thing]).collect::<Vec<_>>();
    let two = |pairs: &[[Thing; 2]]| pairs.iter().map(|pair| pair.to_vec()).collect::<Vec<_>>();
    scores.added = scores.of_kind("added", &one(&truth.added), &one(&told.added), &truth.open);
    scores.gone = scores.of_kind("gone", &one(&truth.gone), &one(&told.gone), &truth.open);
    scores.moved = scores.of_kind("moved", &two(&truth.moved), &two(&told.moved), &truth.open);
    scores
}

impl Scores {
    /// Scores changes of one kind, each of which has one or two places.
    fn of_kind(&mut self, kind: &str, truth: &[Vec<Thing>], told: &[Vec<Thing>], open: &[Thing]) -> Score {
        let likeness = |a: &[Thing], b: &[Thing]| {
            let each: Option<Vec<f64>> = a.iter().zip(b).map(|(a, b)| same_place(a, b)).collect();
            each.map(|each| each.into_iter().fold(1.0, f64::min))
        };
        let mut pairs = Vec::new();
        for (t, thing) in truth.iter().enumerate() {
            let all = told.iter().enumerate();
            pairs.extend(all.filter_map(|(f, found)| Some((likeness(thing, found)?, t, f))));
        }
        let (mut of_truth, mut of_told) = (vec![false; truth.len()], vec![false; told.len()]);
        let mut score = Score { truth: truth.len(), ..Score::default() };
        for (_, t, f) in greedy(pairs) {
            (of_truth[t], of_told[f]) = (true, true);
            score.right += 1;
            score.right_class += usize::from(truth[t][0].class == told[f][0].class);
        }
        let counts = |places: &[Thing]| {
            let is_open = |thing: &Thing| open.iter().any(|open| same_place(open, thing).is_some());
            places.iter().all(|thing| is_furniture(thing.class) && thing.is_large())
                && !places.iter().any(is_open)
        };
        for (places, _) in
            told.iter().zip(&of_told).filter(|(places, is_right)| !**is_right && counts(places))
        {
            score.told += 1;
            self.wrong.push(words(kind, places));
        }
        score.told += score.right;
        let missed = truth.iter().zip(&of_truth).filter(|(_, is_told)| !**is_told);
        self.missed.extend(missed.map(|(places, _)| words(kind, places)));
        score
    }
}

/// Returns the IoU of two things, if they are in the same place.
fn same_place(a: &Thing, b: &Thing) -> Option<f64> {
    let (iou, [p, q]) = (a.bounds.iou(&b.bounds), [a, b].map(|thing| thing.bounds.centre_m));
    (iou >= MIN_IOU || (p[0] - q[0]).hypot(p[1] - q[1]) < NEAR_M).then_some(iou)
}

fn words(kind: &str, places: &[Thing]) -> String {
    let place = |thing: &Thing| {
        let ([x, y, z], [a, b, c]) = (thing.bounds.centre_m, thing.bounds.size_m);
        format!("{} at {x:.2} {y:.2} {z:.2}, {a:.2} x {b:.2} x {c:.2} m", thing.class.name())
    };
    format!("{kind}: {}", places.iter().map(place).collect::<Vec<_>>().join(" to "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::taxonomy::Class;
    use viola_home::UprightBox;

    fn thing(class: Class, x: f64, side_m: f64) -> Thing {
        Thing {
            class,
            bounds: UprightBox { centre_m: [x, 0.0, 0.5], size_m: [side_m, side_m, 1.0], yaw_rad: 0.0 },
        }
    }

    #[test]
    fn a_change_is_right_by_its_kind_and_place() {
        use Class::{Chair, Sofa, Table, Wall};
        let truth = TrueChanges {
            added: vec![thing(Chair, 0.0, 0.6), thing(Chair, 3.0, 0.6)],
            moved: vec![[thing(Table, 6.0, 0.9), thing(Table, 9.0, 0.9)]],
            gone: vec![thing(Sofa, 20.0, 1.0)],
            open: vec![thing(Table, 30.0, 1.0)],
        };
        let told = Told {
            // The second one is there, but has another class; the others are nothing, open and no furniture.
            added: vec![
                thing(Chair, 0.1, 0.6),
                thing(Sofa, 3.0, 0.6),
                thing(Chair, 40.0, 0.6),
                thing(Chair, 30.1, 0.9),
                thing(Wall, 50.0, 0.9),
            ],
            // Only one end is right.
            moved: vec![[thing(Table, 6.0, 0.9), thing(Table, 12.0, 0.9)]],
            gone: vec![thing(Sofa, 20.2, 1.0)],
            discovered: 3,
            lost: 1,
        };
        let scores = score(&truth, &told);
        assert_eq!(scores.added, Score { truth: 2, told: 3, right: 2, right_class: 1 });
        assert_eq!(scores.moved, Score { truth: 1, told: 1, right: 0, right_class: 0 });
        assert_eq!(scores.gone, Score { truth: 1, told: 1, right: 1, right_class: 1 });
        assert_eq!((scores.missed.len(), scores.wrong.len(), scores.discovered), (1, 2, 3));
        let mut sum = scores.clone();
        sum.add(&scores);
        assert_eq!((sum.added.right, sum.lost), (4, 2));
    }
}
