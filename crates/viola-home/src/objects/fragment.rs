//! Connected cells of one class, and the object's class that they indicate.

use super::cells::Cells;
use super::fit::UprightBox;
use super::kind::{Kind, confusable, kind};
use viola_geometry::groups;
use viola_geometry::taxonomy::{CLASSES, Class};

/// Maximum gap between connected cells of a class: less than an inner wall with its adjacent cells.
const REACH_M: f64 = 0.13;

/// Cells of one object, or of a part of it.
#[derive(Debug, Clone)]
pub struct Fragment {
    /// Sorted.
    pub cells: Vec<u32>,
    /// Class with the most evidence.
    pub class: Class,
    /// Sum over the cells of their class's fraction of the votes, by class; names the fragment while it is joined.
    pub evidence: [f32; CLASSES],
    /// True for the units below a worktop, which other storage furniture is no part of.
    pub is_unit: bool,
}

/// Class decision for a fragment.
pub struct Decided {
    pub class: Class,
    pub kind: Kind,
    pub confidence: f64,
    /// The box of a standing object extends to the floor if its bottom is below this height.
    pub reaches_down_m: f64,
}

impl Fragment {
    pub fn new(mut cells: Vec<u32>, all: &Cells) -> Fragment {
        cells.sort_unstable();
        let mut evidence = [0.0; CLASSES];
        for (class, fraction) in cells.iter().filter_map(|cell| all.label(*cell)) {
            evidence[class as usize] += fraction;
        }
        let mut fragment = Fragment { cells, class: Class::Other, evidence, is_unit: false };
        fragment.class = fragment.most();
        fragment
    }

    fn most(&self) -> Class {
        let best = Class::ALL.iter().max_by(|a, b| {
            self.evidence[**a as usize].total_cmp(&self.evidence[**b as usize]).then(b.id().cmp(&a.id()))
        });
        best.copied().unwrap_or(Class::Other)
    }

    /// Returns a part of it with `cells` and their fraction of the evidence.
    pub fn part(&self, cells: Vec<u32>) -> Fragment {
        let fraction = cells.len() as f32 / self.cells.len().max(1) as f32;
        Fragment { cells, evidence: self.evidence.map(|said| said * fraction), ..*self }
    }

    pub fn join(&mut self, other: Fragment) {
        self.cells.extend(other.cells);
        self.cells.sort_unstable();
        for (sum, more) in self.evidence.iter_mut().zip(other.evidence) {
            *sum += more;
        }
        self.class = self.most();
    }

    /// Returns the class with the largest sum of probabilities x size fit x surface factor.
    pub fn decide(&self, bounds: &UprightBox, cells: &Cells) -> Option<Decided> {
        let (flatness, boards) = (flatness(self, cells), boards(self, bounds, cells));
        // The fraction of the votes leaves out how sure they are.
        let mut likelihoods = [0f32; CLASSES];
        for cell in &self.cells {
            let of_cell = cells.likelihoods(*cell);
            likelihoods.iter_mut().zip(of_cell).for_each(|(sum, p)| *sum += p);
        }
        let said = |class: Class| f64::from(likelihoods[class as usize]);
        // Evidence for a confusable class counts too, with less weight.
        let mistaken = |class: Class| -> f64 {
            let others = Class::ALL.iter().filter(|other| **other != class && confusable(class, **other));
            others.map(|other| said(*other)).sum()
        };
        let mut best: Option<(f64, f64, Class, Kind)> = None;
        for &class in Class::ALL {
            let Some(kind) = kind(class) else { continue };
            // A hood is named like the stove below it.
            let is_hood = class == Class::Stove && bounds.bottom_m() > HOOD_M;
            let top_m = if is_hood { kind.top_m.start } else { bounds.top_m() };
            let fit = kind.fit(bounds.size_m[0], bounds.size_m[1], top_m);
            let score = (said(class) + MISTAKEN * mistaken(class))
                * fit
                * surface(class, flatness, boards, self.cells.len());
            if score > 0.0 && best.as_ref().is_none_or(|(most, ..)| score > *most) {
                best = Some((score, fit, class, kind));
            }
        }
        let (_, fit, class, kind) = best?;
        let count = self.cells.len() as f64;
        // The existence is more certain than the class. Fewer cells lower the confidence.
        let heard = (said(class) + 0.75 * mistaken(class)) / count;
        let few = if class == Class::Lamp { FEW_OF_LAMPS } else { FEW };
        let confidence = (heard * (0.5 + 0.5 * fit) * count / (count + few)).clamp(0.0, 1.0);
        // Legs are thin: of many tables only the top is seen.
        let reaches_down_m = if matches!(class, Class::Table | Class::Desk) { 1.0 } else { 0.6 };
        Some(Decided { class, kind, confidence: (confidence * 1e3).round() / 1e3, reaches_down_m })
    }
}

/// Number of cells that halves the confidence; lamps are small.
const FEW: f64 = 30.0;
const FEW_OF_LAMPS: f64 = 12.0;
/// Lowest bottom of a hood, in metres.
const HOOD_M: f64 = 1.3;
/// Weight of evidence for a confusable class.
const MISTAKEN: f64 = 0.35;

/// Returns the likelihood factor of a surface's flatness and boards. Cabinets have closed fronts; shelves show their
/// contents and boards. Most other classes have factor 1.
fn surface(class: Class, flatness: f64, boards: Option<f64>, cells: usize) -> f64 {
    /// Fraction of boards with factor 1, without the height that has most level surface, and the scale of the factor's
    /// logarithm (docs/experiments.md, Objects).
    const BOARDS: f64 = 0.02;
    const BOARDS_STEP: f64 = 0.05;
    /// Flatness with factor 1, and the scale of the factor's logarithm.
    const EVEN: f64 = 0.62;
    const STEP: f64 = 0.2;
    /// Number of cells at which the flatness has half its weight.
    const HALF_TRUSTED: f64 = 300.0;
    let trust = cells as f64 / (cells as f64 + HALF_TRUSTED);
    let lean = trust * ((flatness - EVEN) / STEP).clamp(-0.4, 0.4);
    let open = boards.map_or(0.0, |boards| trust * ((boards - BOARDS) / BOARDS_STEP).clamp(-0.2, 0.6));
    match class {
        Class::Shelf => (open - lean).exp(),
        Class::Cabinet => (lean - open).exp(),
        // Also closed, but objects stand on them and hang at them.
        Class::Counter | Class::Refrigerator | Class::Stove | Class::WashingMachine => lean.max(0.0).exp(),
        _ => 1.0,
    }
}

/// Returns the fraction of the cells in level planes or in upright planes of the two main directions, 0..1.
fn flatness(fragment: &Fragment, cells: &Cells) -> f64 {
    /// Directions of upright surface, modulo a quarter turn.
    const BINS: usize = 18;
    let (mut level, mut all, mut bins) = (0.0, 0.0, [0.0; BINS]);
    for normal in fragment.cells.iter().filter_map(|cell| cells.normal(*cell)) {
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

/// Returns the fraction of the cells that are level and neither at the bottom nor at the top of the box nor at the height where
/// most are: boards. That height may be the top of a cabinet with things on it. None for what is too low to have any,
/// and 1 for what is as low and hangs: wall units are higher, boards with things on them are not.
fn boards(fragment: &Fragment, bounds: &UprightBox, cells: &Cells) -> Option<f64> {
    /// Distance of boards from the bottom and the top.
    const WITHIN_M: f64 = 0.12;
    const MIN_HEIGHT_M: f64 = 0.45;
    const HANGS_M: f64 = 1.0;
    if bounds.size_m[2] < MIN_HEIGHT_M {
        return (bounds.bottom_m() > HANGS_M).then_some(1.0);
    }
    let heights_m = bounds.bottom_m() + WITHIN_M..bounds.top_m() - WITHIN_M;
    let mut at_height: std::collections::BTreeMap<i64, usize> = std::collections::BTreeMap::new();
    for cell in fragment.cells.iter().copied() {
        let height_m = cells.centre(cell)[2];
        if cells.normal(cell).is_some_and(|n| n[2].abs() > 0.8) && heights_m.contains(&height_m) {
            *at_height.entry((height_m / cells.side_m).floor() as i64).or_default() += 1;
        }
    }
    let all: usize = at_height.values().sum();
    // A board may lie between two layers of cells.
    let most = at_height.iter().map(|(layer, count)| count + at_height.get(&(layer + 1)).unwrap_or(&0)).max();
    Some((all - most.unwrap_or(0)) as f64 / fragment.cells.len().max(1) as f64)
}

/// Returns the connected cells of each object class, the largest first.
pub fn fragments(cells: &Cells) -> Vec<Fragment> {
    let reach = ((REACH_M / cells.side_m) as i64).max(1);
    let class = |cell: u32| cells.class(cell).filter(|class| counts(*class));
    let mut parent: Vec<u32> = cells.all().collect();
    for cell in cells.all() {
        let Some(mine) = class(cell) else { continue };
        for other in cells.later(cell, reach).filter(|other| class(*other) == Some(mine)) {
            groups::join(&mut parent, cell, other);
        }
    }
    let mut members: std::collections::BTreeMap<u32, Vec<u32>> = std::collections::BTreeMap::new();
    for cell in cells.all().filter(|cell| class(*cell).is_some()) {
        members.entry(groups::root(&mut parent, cell)).or_default().push(cell);
    }
    let mut out: Vec<Fragment> = members.into_values().map(|own| Fragment::new(own, cells)).collect();
    out.sort_by(|a, b| b.cells.len().cmp(&a.cells.len()).then(a.cells[0].cmp(&b.cells[0])));
    out
}

/// Returns whether a class is an object or a part of one.
fn counts(class: Class) -> bool {
    kind(class).is_some() || class == Class::Pillow
}
