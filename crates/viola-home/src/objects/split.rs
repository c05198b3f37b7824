//! Splits fragments that contain several objects.

mod wings;

pub(super) use wings::run_of_each;

use super::cells::Cells;
use super::fit::span;
use super::fragment::Fragment;
use super::kind::{is_storage, kind};
use viola_geometry::taxonomy::Class;

/// Splits rows of chairs at their thinnest place, wall units from base units, and runs of units or worktops at corners.
pub fn split(fragment: Fragment, cells: &Cells) -> Vec<Fragment> {
    let mut done = Vec::new();
    let mut open = vec![fragment];
    while let Some(fragment) = open.pop() {
        let halves = halves(&fragment, cells)
            .or_else(|| storeys(&fragment, cells))
            .or_else(|| steps(&fragment, cells));
        if let Some(both) = halves {
            open.extend(both);
        } else if let Some(runs) = wings::wings(&fragment, cells) {
            done.extend(runs);
        } else {
            done.push(fragment);
        }
    }
    done
}

fn halves(fragment: &Fragment, cells: &Cells) -> Option<[Fragment; 2]> {
    // Several objects of no other class stand close together.
    let kind = kind(fragment.class).filter(|_| fragment.class == Class::Chair)?;
    let places = cells.centres(&fragment.cells);
    let bounds = cells.fit_box(&places)?;
    let length_m = bounds.size_m[0];
    // A single object may be this long if it is also wide.
    let is_row = length_m > 1.8 * bounds.size_m[1] && length_m > 2.2 * kind.short_m.start;
    if length_m <= kind.long_m.end && !is_row {
        return None;
    }
    const BIN_M: f64 = 0.06;
    let along = |p: &[f64; 3]| bounds.local(p[0], p[1])[0] + length_m / 2.0;
    let bin = |p: &[f64; 3]| ((along(p) / BIN_M) as i64).clamp(0, (length_m / BIN_M) as i64) as usize;
    let mut counts = vec![0usize; (length_m / BIN_M) as usize + 1];
    places.iter().for_each(|p| counts[bin(p)] += 1);
    // Each side keeps at least the width of one object.
    let margin = (kind.short_m.start / BIN_M) as usize;
    let cut = (margin..counts.len().saturating_sub(margin)).min_by_key(|i| {
        let around = counts[i.saturating_sub(1)..(i + 2).min(counts.len())].iter().sum::<usize>();
        (around, i.abs_diff(counts.len() / 2))
    })?;
    // A fragment of plausible length is split only at a distinct minimum.
    let least = counts[cut] as f64;
    if length_m <= kind.long_m.end && least > 0.5 * places.len() as f64 / counts.len() as f64 {
        return None;
    }
    let (mut one, mut other) = (Vec::new(), Vec::new());
    for (cell, place) in fragment.cells.iter().zip(&places) {
        if bin(place) < cut { one.push(*cell) } else { other.push(*cell) }
    }
    (!one.is_empty() && !other.is_empty()).then(|| [fragment.part(one), fragment.part(other)])
}

/// Splits a kitchen's wall units from its base units: few cells lie between them, above the worktop.
fn storeys(fragment: &Fragment, cells: &Cells) -> Option<[Fragment; 2]> {
    const BIN_M: f64 = 0.12;
    /// Worktops are 0.85 m to 0.95 m high, and wall units hang 0.4 m to 0.7 m above them.
    const GAP_M: std::ops::Range<f64> = 0.84..1.5;
    /// Minimum ratio of the cells on both sides to those between.
    const TIMES: f64 = 2.0;
    if !is_storage(fragment.class) {
        return None;
    }
    let height = |cell: u32| cells.centre(cell)[2].max(0.0);
    let mut counts = [0.0f64; 22];
    for cell in &fragment.cells {
        counts[((height(*cell) / BIN_M) as usize).min(21)] += 1.0;
    }
    let mean = |bins: &[f64]| bins.iter().sum::<f64>() / bins.len() as f64;
    let gap = (GAP_M.start / BIN_M) as usize..(GAP_M.end / BIN_M) as usize;
    // A wardrobe has thin places, too, but no gap of this height.
    let between = |cut: usize| mean(&counts[cut - 1..cut + 2]);
    let cut = gap.min_by(|a, b| between(*a).total_cmp(&between(*b)))?;
    let (below, above) = (mean(&counts[cut - 5..cut - 1]), mean(&counts[cut + 2..cut + 6]));
    if below.min(above) < TIMES * between(cut).max(1.0) {
        return None;
    }
    let middle_m = (cut as f64 + 0.5) * BIN_M;
    let (low, high): (Vec<u32>, Vec<u32>) = fragment.cells.iter().partition(|cell| height(**cell) < middle_m);
    Some([fragment.part(low), fragment.part(high)])
}

/// Splits pieces of different heights that stand side by side, and wall units from what stands beside them.
fn steps(fragment: &Fragment, cells: &Cells) -> Option<[Fragment; 2]> {
    const BIN_M: f64 = 0.12;
    /// Least length of each side.
    const SIDE_M: f64 = 0.45;
    /// Fraction of the cells beyond each end.
    const OUTLIERS: f64 = 0.05;
    /// Least difference of the tops and of the undersides.
    const STEPS_M: [f64; 2] = [0.2, 0.6];
    if !is_storage(fragment.class) {
        return None;
    }
    let places = cells.centres(&fragment.cells);
    let bounds = cells.fit_box(&places)?;
    let length_m = bounds.size_m[0];
    let count = (length_m / BIN_M).ceil() as usize;
    let least = (SIDE_M / BIN_M).ceil() as usize;
    if count < 2 * least {
        return None;
    }
    let along_m = |p: &[f64; 3]| (bounds.local(p[0], p[1])[0] + length_m / 2.0).max(0.0);
    let bin = |p: &[f64; 3]| ((along_m(p) / BIN_M) as usize).min(count - 1);
    let mut heights: Vec<Vec<f64>> = vec![Vec::new(); count];
    places.iter().for_each(|p| heights[bin(p)].push(p[2]));
    // A gap between two pieces is as high as the nearer one.
    let filled: Vec<usize> = (0..count).filter(|at| !heights[*at].is_empty()).collect();
    let nearest = |at: usize| filled.iter().copied().min_by_key(|other| other.abs_diff(at)).unwrap_or(at);
    let spans: Vec<[f64; 2]> =
        (0..count).map(|at| span(heights[nearest(at)].iter().copied(), OUTLIERS)).collect();
    let ends = [1, 0].map(|end| spans.iter().map(|span| span[end]).collect::<Vec<f64>>());
    let cut = ends.iter().zip(STEPS_M).find_map(|(ends_m, step_m)| step(ends_m, step_m, least))?;
    let (one, other): (Vec<_>, Vec<_>) =
        fragment.cells.iter().copied().zip(places).partition(|(_, p)| bin(p) < cut);
    let part = |side: Vec<(u32, [f64; 3])>| fragment.part(side.into_iter().map(|(cell, _)| cell).collect());
    Some([part(one), part(other)])
}

/// Returns where the values step by at least `step_m`, with `least` values on each side.
fn step(values_m: &[f64], step_m: f64, least: usize) -> Option<usize> {
    /// Largest mean deviation on each side, as a fraction of the step.
    const UNEVEN: f64 = 0.3;
    let side = |values_m: &[f64]| {
        let [middle_m, _] = span(values_m.iter().copied(), 0.5);
        (middle_m, values_m.iter().map(|value| (value - middle_m).abs()).sum::<f64>())
    };
    let both = |cut: usize| (side(&values_m[..cut]), side(&values_m[cut..]));
    let off_m = |cut: usize| both(cut).0.1 + both(cut).1.1;
    let cut = (least..=values_m.len() - least).min_by(|a, b| off_m(*a).total_cmp(&off_m(*b)))?;
    let ((one_m, one_off_m), (other_m, other_off_m)) = both(cut);
    let is_even = |off_m: f64, count: usize| off_m <= UNEVEN * step_m * count as f64;
    let is_step = (one_m - other_m).abs() >= step_m;
    (is_step && is_even(one_off_m, cut) && is_even(other_off_m, values_m.len() - cut)).then_some(cut)
}
