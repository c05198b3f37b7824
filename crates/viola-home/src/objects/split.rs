//! Splits fragments that contain several objects.

mod wings;

use super::cells::Cells;
use super::fit::{BEYOND, fit_box};
use super::fragment::Fragment;
use super::join::gregarious;
use super::kind::{is_storage, kind};

/// Splits rows of chairs at their thinnest place, wall units from base units, and runs of units or worktops at corners.
pub fn split(fragment: Fragment, cells: &Cells, wall_yaw_rad: Option<f64>) -> Vec<Fragment> {
    let mut done = Vec::new();
    let mut open = vec![fragment];
    while let Some(fragment) = open.pop() {
        let halves = halves(&fragment, cells, wall_yaw_rad).or_else(|| storeys(&fragment, cells));
        if let Some(both) = halves {
            open.extend(both);
        } else if let Some(runs) = wings::wings(&fragment, cells, wall_yaw_rad) {
            done.extend(runs);
        } else {
            done.push(fragment);
        }
    }
    done
}

fn halves(fragment: &Fragment, cells: &Cells, wall_yaw_rad: Option<f64>) -> Option<[Fragment; 2]> {
    let kind = kind(fragment.class).filter(|_| gregarious(fragment.class))?;
    let places: Vec<[f64; 3]> = fragment.cells.iter().map(|cell| cells.centre(*cell as usize)).collect();
    let bounds = fit_box(&places, wall_yaw_rad, BEYOND)?;
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
    let height = |cell: u32| cells.centre(cell as usize)[2].max(0.0);
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
