//! Gaps in oblique walls.

use super::{Gap, THICKNESS_M};
use crate::plan::cells::Cells;
use crate::plan::oblique::Oblique;
use crate::rooms::outline::beside;
use viola_geometry::Point2;

/// Step along a wall.
const STEP_M: f64 = 0.05;
/// Minimum evidence of wall in a step.
const WALL: f64 = 0.25;
/// Sine of the largest angle between the two faces.
const PARALLEL: f64 = 0.2;
/// Cells this near the wall are in its gap, so that no way leads past them.
const NEAR_M: f64 = 0.03;

/// Returns the gaps between the two faces of each oblique wall.
pub(super) fn gaps(cells: &Cells, faces: &[Oblique]) -> Vec<Gap> {
    let mut gaps = Vec::new();
    for (at, face) in faces.iter().enumerate() {
        for back in &faces[at + 1..] {
            let is_opposite = face.normal.dot(&back.normal) < 0.0;
            if is_opposite && face.normal.perp(&back.normal).abs() <= PARALLEL {
                gaps.extend(of_wall(cells, face, back));
            }
        }
    }
    gaps
}

/// Returns how far behind a face another one is, at a place along the face.
fn thickness_m(face: &Oblique, back: &Oblique, along_m: f64) -> f64 {
    let [_, before_m] = back.within(&face.at(along_m));
    before_m / face.normal.dot(&back.normal)
}

fn of_wall(cells: &Cells, face: &Oblique, back: &Oblique) -> Vec<Gap> {
    let ends = [0.0, back.length_m].map(|along_m| face.within(&back.at(along_m))[0]);
    let (low_m, high_m) = (ends[0].min(ends[1]).max(0.0), ends[0].max(ends[1]).min(face.length_m));
    let count = ((high_m - low_m) / STEP_M).max(0.0) as usize;
    let along = |step: usize| low_m + (step as f64 + 0.5) * STEP_M;
    let is_wall = |step: usize| {
        let behind = back.within(&face.at(along(step)))[0];
        face.fraction(along(step)) >= WALL || back.fraction(behind) >= WALL
    };
    let mut gaps = Vec::new();
    let mut last: Option<usize> = None;
    for step in (0..count).filter(|step| is_wall(*step)) {
        if let Some(last) = last.filter(|last| step - last > 1) {
            let span = [along(last) + STEP_M / 2.0, along(step) - STEP_M / 2.0];
            gaps.extend(gap(cells, face, back, span));
        }
        last = Some(step);
    }
    gaps
}

/// Returns the gap of an interval along a wall, if it leads from one side to the other.
fn gap(cells: &Cells, face: &Oblique, back: &Oblique, span: [f64; 2]) -> Option<Gap> {
    let middle_m = (span[0] + span[1]) / 2.0;
    let thickness_m = thickness_m(face, back, middle_m);
    if !(THICKNESS_M[0]..THICKNESS_M[1]).contains(&thickness_m) {
        return None;
    }
    let centre = |at: usize| Point2::from(cells.centre(at));
    let (along_m, before_m) = ([span[0] - NEAR_M, span[1] + NEAR_M], [-thickness_m - NEAR_M, NEAR_M]);
    let is_in = |at: usize| {
        let within = face.within(&centre(at));
        (along_m[0]..=along_m[1]).contains(&within[0]) && (before_m[0]..=before_m[1]).contains(&within[1])
    };
    // A large map has very many cells, and an oblique wall may have very many gaps.
    let corners = along_m.map(|along_m| before_m.map(|before_m| face.at(along_m) + face.normal * before_m));
    let [columns, rows] =
        [0, 1].map(|axis| cells.between(axis, corners.as_flattened().iter().map(|p| p[axis])));
    let own: Vec<usize> = rows
        .flat_map(|y| columns.clone().map(move |x| cells.index([x, y])))
        .filter(|at| cells.inside[*at] && is_in(*at))
        .collect();
    let mut sides = [Vec::new(), Vec::new()];
    for at in &own {
        for next in beside(*at, cells.count(0), cells.count(1)).into_iter().flatten() {
            if cells.inside[next] && !is_in(next) {
                let is_before = face.within(&centre(next))[1] > -thickness_m / 2.0;
                sides[usize::from(is_before)].push(next);
            }
        }
    }
    for side in &mut sides {
        side.sort_unstable();
        side.dedup();
    }
    let end = |along_m: f64| {
        let end = face.at(along_m) - face.normal * (thickness_m / 2.0);
        [end.x, end.y]
    };
    let gap = Gap {
        cells: own,
        beside: sides,
        ends_m: span.map(end),
        thickness_m,
        has_lintel: false,
        stubs: [true; 2],
        is_passage: false,
    };
    (gap.is_plausible() && gap.beside.iter().all(|side| !side.is_empty())).then_some(gap)
}
