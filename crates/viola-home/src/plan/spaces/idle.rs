//! Gaps that divide no rooms.

use super::super::cells::Cells;
use super::super::gaps::Gap;
use super::regions::{areas, pieces};

/// Removes the gaps that divide no rooms, and returns them. The widest one is open first; then others may divide some, or
/// none. Several gaps may be in one doorway. `least_m2` returns the minimum floor on both sides of a gap that divides rooms.
pub(super) fn open_idle(cells: &Cells, closed: &mut Vec<Gap>, least_m2: impl Fn(&Gap) -> f64) -> Vec<Gap> {
    let mut opened = Vec::new();
    // It does not change, and takes long: a large map has thousands of gaps.
    let mut least_m2: Vec<f64> = closed.iter().map(least_m2).collect();
    loop {
        let pieces = pieces(cells, closed);
        let area_m2 = areas(cells, &pieces);
        let side = |gap: &Gap, up: bool| {
            let beside = gap.beside[usize::from(up)].iter().map(|at| pieces[*at]);
            beside
                .filter(|piece| *piece != 0)
                .max_by(|a, b| area_m2[*a as usize].total_cmp(&area_m2[*b as usize]).then(b.cmp(a)))
        };
        let divides = |at: usize| match (side(&closed[at], false), side(&closed[at], true)) {
            (Some(a), Some(b)) => {
                a != b && [a, b].iter().all(|piece| area_m2[*piece as usize] >= least_m2[at])
            }
            _ => false,
        };
        let idle = (0..closed.len()).filter(|at| !divides(*at));
        let widest = idle.max_by(|a, b| closed[*a].width_m().total_cmp(&closed[*b].width_m()).then(a.cmp(b)));
        let Some(widest) = widest else { return opened };
        opened.push(closed.remove(widest));
        least_m2.remove(widest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four spaces in a row with gaps of 0.1 m between them; the middle one of these is the widest.
    #[test]
    fn each_gap_is_measured_once() {
        let sides = vec![0.0, 5.0, 5.1, 5.6, 5.7, 6.2, 6.3, 12.3];
        let cells = Cells {
            lines: [sides, vec![0.0, 1.0]],
            inside: vec![true; 7],
            pillars: vec![false; 7],
            owners: vec![Vec::new(); 7],
        };
        let gap = |at: usize, width_m: f64| Gap {
            cells: vec![at],
            beside: [vec![at - 1], vec![at + 1]],
            ends_m: [[0.0, 0.0], [0.0, width_m]],
            thickness_m: 0.1,
            has_lintel: false,
            stubs: [true; 2],
            is_passage: false,
        };
        for (least_m2, want) in [(0.4, vec![]), (1.0, vec![3]), (2.0, vec![3, 5]), (10.0, vec![3, 5, 1])] {
            let mut closed = vec![gap(1, 0.8), gap(3, 1.0), gap(5, 0.9)];
            let measured = std::cell::Cell::new(0);
            let count = |_: &Gap| {
                measured.set(measured.get() + 1);
                least_m2
            };
            let opened = open_idle(&cells, &mut closed, count);
            let places: Vec<usize> = opened.iter().map(|gap| gap.cells[0]).collect();
            assert_eq!((places, measured.get()), (want, 3), "{least_m2}");
            assert_eq!(opened.len() + closed.len(), 3);
        }
    }
}
