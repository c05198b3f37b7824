//! Ids of objects that stay where they are, over the revisions of a growing map.

use super::super::matching::{MIN_IOU, Thing};
use crate::pairs::greedy;
use serde::Serialize;
use viola_home::Object;

/// Counts of true objects that stay where they are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Kept {
    /// Objects that at least two revisions have.
    pub objects: usize,
    /// Of these, those that have one id in all revisions.
    pub one_id: usize,
}

impl Kept {
    pub fn add(&mut self, other: Kept) {
        self.objects += other.objects;
        self.one_id += other.one_id;
    }
}

/// The ids that each true object had, in the order of revisions.
pub struct Ids {
    truth: Vec<Thing>,
    of_truth: Vec<Vec<String>>,
}

impl Ids {
    pub fn new(truth: Vec<Thing>) -> Ids {
        let of_truth = vec![Vec::new(); truth.len()];
        Ids { truth, of_truth }
    }

    /// Adds the ids of a revision. Boxes match greedily by IoU, whatever their classes: a table that becomes a desk is
    /// the same piece.
    pub fn add(&mut self, objects: &[Object]) {
        let mut pairs = Vec::new();
        for (t, thing) in self.truth.iter().enumerate() {
            let found = (0..objects.len()).map(|f| (thing.bounds.iou(&objects[f].bounds()), t, f));
            pairs.extend(found.filter(|(iou, ..)| *iou >= MIN_IOU));
        }
        for (_, t, f) in greedy(pairs) {
            self.of_truth[t].push(objects[f].id.clone());
        }
    }

    /// Returns the counts, and the objects with several ids in words.
    pub fn kept(&self) -> (Kept, Vec<String>) {
        let (mut kept, mut renamed) = (Kept::default(), Vec::new());
        for (thing, ids) in self.truth.iter().zip(&self.of_truth).filter(|(_, ids)| ids.len() > 1) {
            kept.objects += 1;
            if ids.iter().all(|id| *id == ids[0]) {
                kept.one_id += 1;
            } else {
                let [x, y, z] = thing.bounds.centre_m;
                renamed.push(format!("{} at {x:.2} {y:.2} {z:.2}: {}", thing.class.name(), ids.join(", ")));
            }
        }
        (kept, renamed)
    }
}
