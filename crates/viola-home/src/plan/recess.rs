//! Recesses of windows: a room ends at the face of its wall, and the window lies in the wall.

use super::axes;
use super::cells::Cells;
use super::evidence::{Evidence, Facing};
use super::ring::{Ring, rings};

/// Depths of recesses are those of walls.
const DEEPEST_M: f64 = 0.55;
const WIDTH_M: [f64; 2] = [0.35, 6.0];
/// The wall on both sides of a recess is in one line within this.
const SAME_LINE_M: f64 = 0.07;
/// Minimum fraction of the back of a recess with a window.
const WINDOW_FRACTION: f64 = 0.5;

/// Takes the recesses of windows out of the inside.
pub(super) fn close(cells: &mut Cells, evidence: &Evidence) {
    let rings = rings(cells);
    let places = rings.iter().flat_map(|ring| (0..ring.len()).map(move |at| (ring, at)));
    let closed: Vec<[[usize; 2]; 2]> =
        places.filter_map(|(ring, at)| recess(cells, evidence, ring, at)).collect();
    for [low, high] in closed {
        for (i, j) in (low[0]..high[0]).flat_map(|i| (low[1]..high[1]).map(move |j| (i, j))) {
            let at = cells.index([i, j]);
            cells.inside[at] = false;
        }
    }
}

/// Returns the lines around the recess whose first corner is at a place of a ring.
fn recess(cells: &Cells, evidence: &Evidence, ring: &Ring, at: usize) -> Option<[[usize; 2]; 2]> {
    if ring.len() < 8 {
        return None;
    }
    let corner = |i: usize| ring.corner(at + i);
    let turn = |i: usize| ring.turn(at + i);
    // Corners 1 and 4 are at the wall's face, 2 and 3 at the back of the recess.
    if turn(0) >= 0 || turn(1) <= 0 || turn(2) <= 0 || turn(3) >= 0 {
        return None;
    }
    let along = if corner(2)[1] == corner(3)[1] { 0 } else { 1 };
    let across = 1 - along;
    let place = |i: usize, axis: usize| cells.lines[axis][corner(i)[axis]];
    let (back_m, faces_m) = (place(2, across), [place(1, across), place(4, across)]);
    let depth_m = faces_m.iter().map(|face| (face - back_m).abs()).fold(f64::INFINITY, f64::min);
    let span = [corner(2)[along].min(corner(3)[along]), corner(2)[along].max(corner(3)[along])];
    let span_m = span.map(|line| cells.lines[along][line]);
    if depth_m > DEEPEST_M
        || (faces_m[0] - faces_m[1]).abs() > SAME_LINE_M
        || !(WIDTH_M[0]..WIDTH_M[1]).contains(&(span_m[1] - span_m[0]))
    {
        return None;
    }
    let up = faces_m[0] > back_m;
    if evidence.window_fraction(Facing { axis: across, up }, back_m, span_m) < WINDOW_FRACTION {
        return None;
    }
    let back = corner(2)[across];
    let face =
        if up { corner(1)[across].min(corner(4)[across]) } else { corner(1)[across].max(corner(4)[across]) };
    Some([axes::place(across, back.min(face), span[0]), axes::place(across, back.max(face), span[1])])
}
