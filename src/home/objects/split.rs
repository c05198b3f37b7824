//! Several things that became one.

use super::cells::Cells;
use super::fit::{BEYOND, fit_box};
use super::fragment::Fragment;
use super::join::gregarious;
use super::kind::kind;

/// Chairs side by side are taken apart where the least of them is; everything else stays as it is.
pub fn split(fragment: Fragment, cells: &Cells, wall_yaw_rad: Option<f64>) -> Vec<Fragment> {
    let mut done = Vec::new();
    let mut open = vec![fragment];
    while let Some(fragment) = open.pop() {
        match halves(&fragment, cells, wall_yaw_rad) {
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
    // One alone may be this long.
    if length_m <= kind.long_m.end {
        return None;
    }
    const BIN_M: f64 = 0.06;
    let along = |p: &[f64; 3]| bounds.local(p[0], p[1])[0] + length_m / 2.0;
    let bin = |p: &[f64; 3]| ((along(p) / BIN_M) as i64).clamp(0, (length_m / BIN_M) as i64) as usize;
    let mut counts = vec![0usize; (length_m / BIN_M) as usize + 1];
    places.iter().for_each(|p| counts[bin(p)] += 1);
    // Each side keeps the width of a thing.
    let margin = (kind.short_m.start / BIN_M) as usize;
    let cut = (margin..counts.len().saturating_sub(margin)).min_by_key(|i| {
        let around = counts[i.saturating_sub(1)..(i + 2).min(counts.len())].iter().sum::<usize>();
        (around, i.abs_diff(counts.len() / 2))
    })?;
    let (mut one, mut other) = (Vec::new(), Vec::new());
    for (cell, place) in fragment.cells.iter().zip(&places) {
        if bin(place) < cut { one.push(*cell) } else { other.push(*cell) }
    }
    let part = |part: Vec<u32>| {
        let share = part.len() as f32 / fragment.cells.len() as f32;
        Fragment { cells: part, class: fragment.class, evidence: fragment.evidence.map(|e| e * share) }
    };
    (!one.is_empty() && !other.is_empty()).then(|| [part(one), part(other)])
}
