//! Splits runs of units and worktops that stand along several walls: the box around an L or a U is mostly free floor.

use super::super::cells::Cells;
use super::super::fit::{BEYOND, span};
use super::super::fragment::Fragment;
use super::super::kind::is_storage;
use rustc_hash::FxHashMap;
use viola_geometry::taxonomy::Class;

/// Side of the squares of floor that are compared.
const BIN_M: f64 = 0.12;
/// Squares without a cell inside a run: a sink, or things that hide a worktop. The legs of a U are further apart.
const GAP: i32 = 5;
/// Largest area of the boxes of all runs, as a fraction of that of the box around all.
const MAX_AREA_FRACTION: f64 = 0.75;
/// Minimum fraction of the cells in a run.
const MIN_CELL_FRACTION: f64 = 0.12;
/// A run that is less deep is a row of fronts, and looks at the others. The front and the side of one wardrobe look away
/// from each other.
const THIN_M: f64 = 0.25;

type Square = [i32; 2];

/// Returns the runs of a fragment along the walls; none if it is one.
pub(super) fn wings(fragment: &Fragment, cells: &Cells) -> Option<Vec<Fragment>> {
    if !is_storage(fragment.class) && fragment.class != Class::Counter {
        return None;
    }
    let (s, c) = cells.wall_yaw_rad?.sin_cos();
    let turned = |[x, y]: [f64; 2]| [c * x + s * y, c * y - s * x];
    let centres = cells.centres(&fragment.cells);
    let places: Vec<[f64; 2]> = centres.into_iter().map(|[x, y, _]| turned([x, y])).collect();
    let run_of = run_of_each(&places);
    let count = run_of.iter().copied().max()? + 1;
    let mut members = vec![Vec::new(); count];
    run_of.iter().enumerate().for_each(|(i, run)| members[*run].push(i));
    let least = (MIN_CELL_FRACTION * places.len() as f64) as usize;
    let is_large = |run: &usize| members[*run].len() > least;
    let large: Vec<usize> = (0..count).filter(is_large).collect();
    if large.len() < 2 {
        return None;
    }
    let whole = sides(&mut places.iter());
    let area_m2 =
        |sides: &[[f64; 2]; 2]| sides.iter().map(|[low, high]| high - low + cells.side_m).product::<f64>();
    let boxes: Vec<[[f64; 2]; 2]> =
        large.iter().map(|run| sides(&mut members[*run].iter().map(|i| &places[*i]))).collect();
    if boxes.iter().map(area_m2).sum::<f64>() > MAX_AREA_FRACTION * area_m2(&whole) {
        return None;
    }
    let middle = |sides: &[[f64; 2]; 2]| sides.map(|[low, high]| (low + high) / 2.0);
    for (run, sides) in large.iter().zip(&boxes) {
        let depth_m = sides.iter().map(|[low, high]| high - low).fold(f64::INFINITY, f64::min);
        if depth_m > THIN_M {
            continue;
        }
        let normals = members[*run].iter().filter_map(|i| cells.normal(fragment.cells[*i]));
        let [x, y] = normals.fold([0.0; 2], |sum, n| [sum[0] + f64::from(n[0]), sum[1] + f64::from(n[1])]);
        let (looks, from, to) = (turned([x, y]), middle(sides), middle(&whole));
        if looks[0] * (to[0] - from[0]) + looks[1] * (to[1] - from[1]) <= 0.0 {
            return None;
        }
    }
    // A piece that is too small for a run belongs to the nearest one.
    let off = |p: &[f64; 2], [x, y]: &[[f64; 2]; 2]| {
        let beyond = |value: f64, [low, high]: [f64; 2]| (low - value).max(value - high).max(0.0);
        beyond(p[0], *x).hypot(beyond(p[1], *y))
    };
    let mut parts = vec![Vec::new(); large.len()];
    for (run, members) in members.iter().enumerate() {
        for i in members {
            let own = large.iter().position(|large| *large == run);
            let nearest = || {
                (0..boxes.len())
                    .min_by(|a, b| off(&places[*i], &boxes[*a]).total_cmp(&off(&places[*i], &boxes[*b])))
            };
            parts[own.or_else(nearest)?].push(fragment.cells[*i]);
        }
    }
    let part = |mut cells: Vec<u32>| {
        cells.sort_unstable();
        fragment.part(cells)
    };
    Some(parts.into_iter().map(part).collect())
}

/// Returns the ranges of places along both axes, without outliers.
fn sides(places: &mut dyn Iterator<Item = &[f64; 2]>) -> [[f64; 2]; 2] {
    let places: Vec<&[f64; 2]> = places.collect();
    [0, 1].map(|axis| span(places.iter().map(|p| p[axis]), BEYOND))
}

/// Returns the number of the run that each place belongs to.
pub(in super::super) fn run_of_each(places: &[[f64; 2]]) -> Vec<usize> {
    let square = |p: &[f64; 2]| p.map(|c| (c / BIN_M).floor() as i32);
    let run_of = runs(places.iter().map(square).collect());
    places.iter().map(|place| run_of[&square(place)]).collect()
}

/// Numbers the squares by their runs: a square belongs to the direction in which more squares follow each other.
fn runs(mut squares: Vec<Square>) -> FxHashMap<Square, usize> {
    squares.sort_unstable();
    squares.dedup();
    let mut length: FxHashMap<Square, [i32; 2]> = squares.iter().map(|square| (*square, [0; 2])).collect();
    for axis in 0..2 {
        let mut sorted = squares.clone();
        sorted.sort_unstable_by_key(|square| (square[1 - axis], square[axis]));
        let follows = |a: &Square, b: &Square| a[1 - axis] == b[1 - axis] && b[axis] - a[axis] <= GAP + 1;
        for run in sorted.chunk_by(follows) {
            let extent = run[run.len() - 1][axis] - run[0][axis] + 1;
            for square in run {
                if let Some(length) = length.get_mut(square) {
                    length[axis] = extent;
                }
            }
        }
    }
    let axis_of = |square: &Square| length.get(square).map(|[x, y]| usize::from(y > x));
    let mut run_of: FxHashMap<Square, usize> = FxHashMap::default();
    let mut count = 0;
    for square in &squares {
        if run_of.contains_key(square) {
            continue;
        }
        let mut open = vec![*square];
        run_of.insert(*square, count);
        while let Some(at) = open.pop() {
            let axis = axis_of(&at).unwrap_or(0);
            for along in -(GAP + 1)..=GAP + 1 {
                for across in -1..=1 {
                    let mut next = at;
                    next[axis] += along;
                    next[1 - axis] += across;
                    if axis_of(&next) == Some(axis) && !run_of.contains_key(&next) {
                        run_of.insert(next, count);
                        open.push(next);
                    }
                }
            }
        }
        count += 1;
    }
    run_of
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the squares of rectangles of `[low, high)` along both axes.
    fn squares(rectangles: &[[[i32; 2]; 2]]) -> Vec<Square> {
        let of = |[x, y]: &[[i32; 2]; 2]| {
            let y = *y;
            (x[0]..x[1]).flat_map(move |x| (y[0]..y[1]).map(move |y| [x, y]))
        };
        rectangles.iter().flat_map(of).collect()
    }

    #[test]
    fn runs_are_the_legs_of_letters() {
        // Rectangles, and the number of their runs of at least five squares.
        let cases: [(&[[[i32; 2]; 2]], usize); 6] = [
            (&[[[0, 20], [0, 5]]], 1),
            // A sink in a worktop.
            (&[[[0, 8], [0, 5]], [[13, 20], [0, 5]]], 1),
            // An L and a U.
            (&[[[0, 20], [0, 5]], [[0, 5], [5, 16]]], 2),
            (&[[[0, 25], [0, 5]], [[0, 5], [5, 20]], [[20, 25], [5, 20]]], 3),
            // Two rows that face each other.
            (&[[[0, 20], [0, 5]], [[0, 20], [14, 19]]], 2),
            (&[[[0, 6], [0, 6]]], 1),
        ];
        for (rectangles, want) in cases {
            let run_of = runs(squares(rectangles));
            let mut sizes = vec![0; run_of.len()];
            run_of.values().for_each(|run| sizes[*run] += 1);
            assert_eq!(sizes.iter().filter(|size| **size >= 5).count(), want, "{rectangles:?}");
        }
    }
}
