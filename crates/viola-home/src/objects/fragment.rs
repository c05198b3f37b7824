//! Connected cells of one class, and the object's class that they indicate.

use super::cells::Cells;
use super::fit::UprightBox;
use super::kind::{confusable, kind};
use super::place::contact_likelihood;
use super::prior::{frequency, size_likelihood};
use viola_geometry::taxonomy::{CLASSES, Class};

/// Cells of one object, or of a part of it.
#[derive(Debug, Clone)]
pub struct Fragment {
    /// Sorted.
    pub cells: Vec<u32>,
    /// Class with the most evidence.
    pub class: Class,
    /// Sum over the cells of each class's fraction of the votes.
    pub evidence: [f32; CLASSES],
}

impl Fragment {
    pub fn new(mut cells: Vec<u32>, all: &Cells) -> Fragment {
        cells.sort_unstable();
        let mut evidence = [0.0; CLASSES];
        for cell in &cells {
            evidence.iter_mut().zip(all.shares(*cell as usize)).for_each(|(sum, share)| *sum += share);
        }
        let mut fragment = Fragment { cells, class: Class::Other, evidence };
        fragment.class = fragment.most();
        fragment
    }

    fn most(&self) -> Class {
        let best = Class::ALL.iter().filter(|class| counts(**class)).max_by(|a, b| {
            self.evidence[**a as usize].total_cmp(&self.evidence[**b as usize]).then(b.id().cmp(&a.id()))
        });
        best.copied().unwrap_or(Class::Other)
    }

    /// Returns a part of it, of the same class.
    pub fn part(&self, cells: Vec<u32>, all: &Cells) -> Fragment {
        Fragment { class: self.class, ..Fragment::new(cells, all) }
    }

    pub fn join(&mut self, other: Fragment) {
        self.cells.extend(other.cells);
        self.cells.sort_unstable();
        for (sum, more) in self.evidence.iter_mut().zip(other.evidence) {
            *sum += more;
        }
        self.class = self.most();
    }

    /// Returns the class with the largest product of votes and likelihoods of size, place and surface. `contact` is
    /// how much of a side has a wall behind it, `flatness` the fraction of even surface; both in 0..1.
    pub fn decide(&self, bounds: &UprightBox, contact: f64, flatness: f64) -> Option<Decided> {
        let count: f64 = self.evidence.iter().map(|said| f64::from(*said)).sum();
        let said = |class: Class| f64::from(self.evidence[class as usize]) / count.max(1e-9);
        let objects = || Class::ALL.iter().copied().filter(|class| counts(*class));
        let named: f64 = objects().map(said).sum();
        let frequent =
            |of: &dyn Fn(Class) -> bool| -> f64 { objects().filter(|class| of(*class)).map(frequency).sum() };
        // Labels are wrong now and then, mostly within a family; the more frequent classes are likelier instead.
        let anything = frequent(&|_| true);
        let by_family: Vec<(Class, f64)> = objects()
            .filter(|label| said(*label) > 0.0)
            .map(|label| (label, said(label) / frequent(&|class| confusable(class, label))))
            .collect();
        let votes = |class: Class| {
            let family: f64 =
                by_family.iter().filter(|(label, _)| confusable(class, *label)).map(|(_, share)| share).sum();
            (1.0 - BY_FAMILY - BY_ANY) * said(class)
                + frequency(class) * (BY_FAMILY * family + BY_ANY * named / anything)
        };
        let score = |class: Class| {
            let size = SIZE_WEIGHT * size_likelihood(class, bounds)?;
            let place = contact_likelihood(class, contact);
            let surface = surface(class, flatness, self.cells.len()).ln();
            Some((class, votes(class).max(1e-9).ln() + size + place + surface))
        };
        let scores: Vec<(Class, f64)> = Class::ALL.iter().filter_map(|class| score(*class)).collect();
        let (class, most) = scores.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
        let all: f64 = scores.iter().map(|(_, score)| (score - most).exp()).sum();
        Some(Decided { class, posterior: 1.0 / all, heard: votes(class).min(1.0), named })
    }
}

/// A fragment's class.
pub struct Decided {
    pub class: Class,
    /// Its posterior among all classes of objects.
    pub posterior: f64,
    /// Fraction of the labels that speak for it.
    pub heard: f64,
    /// Fraction of the labels that name any object.
    pub named: f64,
}

/// Fractions of the labels that are wrong within a family of confusable classes, and beyond it.
const BY_FAMILY: f64 = 0.2;
const BY_ANY: f64 = 0.05;
/// Exponent of the size's likelihood: the three sides of a box are seen from the same few places.
const SIZE_WEIGHT: f64 = 0.7;

/// Returns the likelihood factor of a surface's flatness. Cabinets have closed fronts; shelves show their
/// contents. Most other classes have factor 1.
fn surface(class: Class, flatness: f64, cells: usize) -> f64 {
    /// Flatness with factor 1, and the scale of the factor's logarithm.
    const EVEN: f64 = 0.62;
    const STEP: f64 = 0.2;
    /// Number of cells at which the flatness has half its weight.
    const FEW: f64 = 300.0;
    let trust = cells as f64 / (cells as f64 + FEW);
    let lean = trust * ((flatness - EVEN) / STEP).clamp(-0.75, 0.75);
    match class {
        Class::Shelf => (-lean).exp(),
        Class::Cabinet => lean.exp(),
        // Also closed, but objects stand on them and hang at them.
        Class::Counter | Class::Refrigerator | Class::Stove | Class::WashingMachine => lean.max(0.0).exp(),
        _ => 1.0,
    }
}

/// Returns the fraction of the cells in level planes or in upright planes of the two main directions, 0..1.
pub fn flatness(fragment: &Fragment, cells: &Cells) -> f64 {
    /// Directions of upright surface, modulo a quarter turn.
    const BINS: usize = 18;
    let (mut level, mut all, mut bins) = (0.0, 0.0, [0.0; BINS]);
    for normal in fragment.cells.iter().filter_map(|cell| cells.normal(*cell as usize)) {
        all += 1.0;
        if normal[2].abs() > 0.9 {
            level += 1.0;
        } else if normal[2].abs() < 0.35 {
            let turn = f64::from(normal[1].atan2(normal[0])).rem_euclid(std::f64::consts::FRAC_PI_2);
            let bin = (turn / std::f64::consts::FRAC_PI_2 * BINS as f64) as usize;
            bins[bin.min(BINS - 1)] += 1.0;
        }
    }
    // A window of 25 degrees around each bin.
    let around = |i: usize| (0..5).map(|k| bins[(i + k + BINS - 2) % BINS]).sum::<f64>();
    let upright = (0..BINS).map(around).fold(0.0, f64::max);
    if all > 0.0 { (level + upright) / all } else { 0.0 }
}

/// Returns the connected cells of each object class, the largest first.
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
    let mut out: Vec<Fragment> = members.into_values().map(|of| Fragment::new(of, cells)).collect();
    out.sort_by(|a, b| b.cells.len().cmp(&a.cells.len()).then(a.cells[0].cmp(&b.cells[0])));
    out
}

/// Returns whether a class is an object or a part of one.
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
