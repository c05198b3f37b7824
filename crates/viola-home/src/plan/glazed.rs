//! Faces of walls that are windows for the most part: their wall is too little for a face.

use super::columns::Columns;
use super::evidence::{Facing, is_window};
use super::faces::{BAND_M, BEFORE_M, BEHIND_M, Face, GAP_LOSS, best_run};

/// Minimum length. The wall beside shorter windows has a face.
const MIN_M: f64 = 1.0;
/// A bound on work.
const MAX_FACES: usize = 100;

/// Returns the faces of one facing where windows stand in none of `faces`, the longest first.
pub(super) fn faces(facing: Facing, seen: &Columns, faces: &[Face]) -> Vec<Face> {
    let mut left: Vec<bool> = seen.bits.iter().map(|bits| is_window(*bits)).collect();
    if !left.contains(&true) {
        return Vec::new();
    }
    // Windows in a face are part of its wall.
    let take = |left: &mut Vec<bool>, line_m: f64, [from, to]: [usize; 2]| {
        for row in seen.rows([-BEHIND_M, BEFORE_M].map(|metres| line_m + facing.sign() * metres)) {
            left[row * seen.along + from..row * seen.along + to.max(from)].fill(false);
        }
    };
    for face in faces {
        take(&mut left, face.line_m, [face.from_m, face.to_m].map(|metres| seen.columns_before(metres)));
    }
    let half = ((BAND_M / seen.across_m).round() as usize).max(1);
    let mut found = Vec::new();
    while found.len() < MAX_FACES {
        let run_of = |across: usize| {
            let rows = across.saturating_sub(half)..=(across + half).min(seen.across - 1);
            let has = |column: usize| rows.clone().any(|row| left[row * seen.along + column]);
            best_run((0..seen.along).map(|column| if has(column) { 1.0 - GAP_LOSS } else { -GAP_LOSS }))
        };
        // Other rows have no run.
        let has_window =
            |across: &usize| left[across * seen.along..(across + 1) * seen.along].contains(&true);
        let rows: Vec<bool> = (0..seen.across).map(|across| has_window(&across)).collect();
        let is_near = |across: &usize| {
            rows[across.saturating_sub(half)..(across + half + 1).min(seen.across)].contains(&true)
        };
        let runs = (0..seen.across).filter(is_near).map(|across| (across, run_of(across)));
        let best = runs.max_by(|a, b| a.1.gain.total_cmp(&b.1.gain).then(b.0.cmp(&a.0)));
        let Some((across, run)) =
            best.filter(|(_, run)| f64::from(run.gain) * seen.along_m >= MIN_M * f64::from(1.0 - GAP_LOSS))
        else {
            break;
        };
        let line_m = seen.low_m[0] + (across as f64 + 0.5) * seen.across_m;
        take(&mut left, line_m, [run.from, run.to]);
        // Walls beside it place it better.
        found.push(Face::new(facing, line_m, seen, &run, 0.0));
    }
    found
}
