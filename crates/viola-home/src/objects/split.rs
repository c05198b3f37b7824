//! Splits fragments that contain several objects.

use super::cells::Cells;
use super::fit::{BEYOND, UprightBox, around, fit_box};
use super::fragment::Fragment;
use super::join::gregarious;
use super::kind::{is_storage, kind};

/// Splits rows of chairs at their thinnest place, wall units from base units, and the runs of a corner.
pub fn split(fragment: Fragment, cells: &Cells, wall_yaw_rad: Option<f64>) -> Vec<Fragment> {
    let mut done = Vec::new();
    let mut open = vec![fragment];
    while let Some(fragment) = open.pop() {
        let parts = halves(&fragment, cells, wall_yaw_rad).or_else(|| storeys(&fragment, cells));
        match parts.or_else(|| legs(&fragment, cells, wall_yaw_rad)) {
            Some(both) => open.extend(both),
            None => done.push(fragment),
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
    (!one.is_empty() && !other.is_empty()).then(|| [fragment.part(one, cells), fragment.part(other, cells)])
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
    let cut = gap.min_by(|a, b| counts[*a].total_cmp(&counts[*b]))?;
    let (below, above) = (mean(&counts[cut - 4..cut]), mean(&counts[cut + 1..cut + 5]));
    if below.min(above) < TIMES * counts[cut].max(1.0) {
        return None;
    }
    let middle_m = (cut as f64 + 0.5) * BIN_M;
    let (low, high): (Vec<u32>, Vec<u32>) = fragment.cells.iter().partition(|cell| height(**cell) < middle_m);
    Some([fragment.part(low, cells), fragment.part(high, cells)])
}

/// Splits storage around a corner of a room into its two runs.
fn legs(fragment: &Fragment, cells: &Cells, wall_yaw_rad: Option<f64>) -> Option<[Fragment; 2]> {
    /// Minimum width of a corner's box: one run is at most 0.8 m deep.
    const LEAST_M: f64 = 0.95;
    /// Depth of a run.
    const DEPTH_M: f64 = 0.66;
    /// Maximum area of both boxes as a fraction of the one around them.
    const MOST_AREA: f64 = 0.75;
    if !is_storage(fragment.class) {
        return None;
    }
    let places: Vec<[f64; 3]> = fragment.cells.iter().map(|cell| cells.centre(*cell as usize)).collect();
    let bounds = around(&places.iter().collect::<Vec<_>>(), wall_yaw_rad?, BEYOND);
    if bounds.size_m[1] < LEAST_M {
        return None;
    }
    let area = |of: &UprightBox| of.size_m[0] * of.size_m[1];
    let cuts = (0..4).filter_map(|side| {
        let (axis, sign) = (side / 2, if side % 2 == 0 { 1.0 } else { -1.0 });
        let is_in_run =
            |at: &[f64; 3]| sign * bounds.local(at[0], at[1])[axis] > bounds.size_m[axis] / 2.0 - DEPTH_M;
        let boxed = |wanted: bool| {
            let part: Vec<&[f64; 3]> = places.iter().filter(|at| is_in_run(at) == wanted).collect();
            (part.len() >= 4).then(|| area(&around(&part, bounds.yaw_rad, BEYOND)))
        };
        Some((boxed(true)? + boxed(false)?, axis, sign))
    });
    let (both_m2, axis, sign) = cuts.min_by(|a, b| a.0.total_cmp(&b.0))?;
    if both_m2 > MOST_AREA * area(&bounds) {
        return None;
    }
    let is_in_run = |cell: &u32| {
        let at = cells.centre(*cell as usize);
        sign * bounds.local(at[0], at[1])[axis] > bounds.size_m[axis] / 2.0 - DEPTH_M
    };
    let (run, rest): (Vec<u32>, Vec<u32>) = fragment.cells.iter().partition(|cell| is_in_run(cell));
    Some([fragment.part(run, cells), fragment.part(rest, cells)])
}
