//! Connected cells of one class, and what the thing is that they show.

use super::cells::Cells;
use super::fit::UprightBox;
use super::kind::{Kind, confusable, kind};
use crate::taxonomy::{CLASSES, Class};

/// Cells that show one thing, or a part of it.
#[derive(Debug, Clone)]
pub struct Fragment {
    /// In rising order.
    pub cells: Vec<u32>,
    /// What most of them are called.
    pub class: Class,
    /// What is said of the cells, by class: surface in cells, times its share of the votes.
    pub evidence: [f32; CLASSES],
}

/// What a fragment was taken for.
pub struct Decided {
    pub class: Class,
    pub kind: Kind,
    pub confidence: f64,
    /// A standing thing whose lowest point is below this goes on down to the floor.
    pub reaches_down_m: f64,
}

impl Fragment {
    pub fn new(mut cells: Vec<u32>, labels: &[Option<(Class, f32)>]) -> Fragment {
        cells.sort_unstable();
        let mut evidence = [0.0; CLASSES];
        for (class, share) in cells.iter().filter_map(|cell| labels[*cell as usize]) {
            evidence[class as usize] += share;
        }
        let mut fragment = Fragment { cells, class: Class::Other, evidence };
        fragment.class = fragment.most();
        fragment
    }

    fn most(&self) -> Class {
        let best = Class::ALL.iter().max_by(|a, b| {
            self.evidence[**a as usize].total_cmp(&self.evidence[**b as usize]).then(b.id().cmp(&a.id()))
        });
        best.copied().unwrap_or(Class::Other)
    }

    pub fn join(&mut self, other: Fragment) {
        self.cells.extend(other.cells);
        self.cells.sort_unstable();
        for (sum, more) in self.evidence.iter_mut().zip(other.evidence) {
            *sum += more;
        }
        self.class = self.most();
    }

    /// The class with the most evidence that its size allows.
    pub fn decide(&self, bounds: &UprightBox) -> Option<Decided> {
        let mut best: Option<(f64, Class, Kind)> = None;
        for &class in Class::ALL {
            let said = f64::from(self.evidence[class as usize]);
            let Some(kind) = kind(class).filter(|_| said > 0.0) else { continue };
            let fit = kind.fit(bounds.size_m[0], bounds.size_m[1], bounds.top_m());
            // Fit tells between what is said about as often; it does not make a thing of a whisper.
            let score = said * fit;
            if best.as_ref().is_none_or(|(most, ..)| score > *most) {
                best = Some((score, class, kind));
            }
        }
        let (_, class, kind) = best?;
        let fit = kind.fit(bounds.size_m[0], bounds.size_m[1], bounds.top_m());
        // What it could be mistaken for speaks for it by half.
        let said = |class: Class| f64::from(self.evidence[class as usize]);
        let mistaken: f64 =
            Class::ALL.iter().filter(|c| **c != class && confusable(class, **c)).map(|c| said(*c)).sum();
        let share = (said(class) + 0.5 * mistaken) / (self.cells.len() as f64).max(1.0);
        let seen = self.cells.len() as f64 / (self.cells.len() as f64 + 30.0);
        let confidence = (share * fit.sqrt() * seen).clamp(0.0, 1.0);
        Some(Decided { class, kind, confidence: (confidence * 1e3).round() / 1e3, reaches_down_m: 0.6 })
    }
}

/// The connected cells of each class that objects have, the largest first.
pub fn fragments(cells: &Cells, labels: &[Option<(Class, f32)>], reach: i64) -> Vec<Fragment> {
    let class = |cell: usize| labels[cell].map(|(class, _)| class).filter(|c| counts(*c));
    let mut parent: Vec<u32> = (0..cells.len() as u32).collect();
    for cell in 0..cells.len() {
        let Some(mine) = class(cell) else { continue };
        for other in cells.later(cell, reach) {
            if class(other as usize) == Some(mine) {
                let (a, b) = (root(&mut parent, cell as u32), root(&mut parent, other));
                let (low, high) = (a.min(b), a.max(b));
                parent[high as usize] = low;
            }
        }
    }
    let mut members: std::collections::BTreeMap<u32, Vec<u32>> = std::collections::BTreeMap::new();
    for cell in 0..cells.len() as u32 {
        if class(cell as usize).is_some() {
            members.entry(root(&mut parent, cell)).or_default().push(cell);
        }
    }
    let mut out: Vec<Fragment> = members.into_values().map(|cells| Fragment::new(cells, labels)).collect();
    out.sort_by(|a, b| b.cells.len().cmp(&a.cells.len()).then(a.cells[0].cmp(&b.cells[0])));
    out
}

/// Objects, and what lies on them and is part of them.
fn counts(class: Class) -> bool {
    kind(class).is_some() || class == Class::Pillow
}

fn root(parent: &mut [u32], mut cell: u32) -> u32 {
    while parent[cell as usize] != cell {
        let up = parent[parent[cell as usize] as usize];
        parent[cell as usize] = up;
        cell = up;
    }
    cell
}
