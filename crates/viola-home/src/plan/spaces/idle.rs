//! Gaps that divide no rooms.

use super::super::cells::Cells;
use super::super::gaps::Gap;
use crate::rooms::outline::beside;
use viola_geometry::groups;

/// Removes the gaps that divide no rooms, and returns them. The widest one is open first; then others may divide some, or
/// none. Several gaps may be in one doorway. `least_m2` returns the minimum floor on both sides of a gap that divides rooms.
pub(super) fn open_idle(cells: &Cells, closed: &mut Vec<Gap>, least_m2: impl Fn(&Gap) -> f64) -> Vec<Gap> {
    let mut opened = Vec::new();
    // It does not change, and takes long: a large map has thousands of gaps.
    let mut least_m2: Vec<f64> = closed.iter().map(least_m2).collect();
    let mut pieces = Pieces::new(cells, closed);
    loop {
        let idle = (0..closed.len()).filter(|at| !pieces.are_divided(&closed[*at], least_m2[*at]));
        let widest = idle.max_by(|a, b| closed[*a].width_m().total_cmp(&closed[*b].width_m()).then(a.cmp(b)));
        let Some(widest) = widest else { return opened };
        let gap = closed.remove(widest);
        least_m2.remove(widest);
        pieces.open(&gap);
        opened.push(gap);
    }
}

/// Connected inside cells between closed gaps. Pieces only grow, so their cells are connected once, and not for each gap.
struct Pieces<'a> {
    cells: &'a Cells,
    /// A cell of each cell's piece; the first one of a piece has itself.
    parent: Vec<u32>,
    /// Area of each piece, by its first cell.
    area_m2: Vec<f64>,
    /// Number of closed gaps with each cell.
    closed: Vec<u32>,
}

impl<'a> Pieces<'a> {
    fn new(cells: &'a Cells, gaps: &[Gap]) -> Pieces<'a> {
        let count = cells.inside.len();
        let mut closed = vec![0; count];
        gaps.iter().flat_map(|gap| &gap.cells).for_each(|at| closed[*at] += 1);
        let (parent, area_m2) = ((0..count as u32).collect(), vec![0.0; count]);
        let mut pieces = Pieces { cells, parent, area_m2, closed };
        (0..count).for_each(|at| pieces.join(at));
        for at in 0..count {
            let piece = groups::root(&mut pieces.parent, at as u32);
            pieces.area_m2[piece as usize] += cells.area_m2(at);
        }
        pieces
    }

    fn is_open(&self, at: usize) -> bool {
        self.cells.inside[at] && self.closed[at] == 0
    }

    /// Joins the pieces beside a cell with its own one, if it is open.
    fn join(&mut self, at: usize) {
        if !self.is_open(at) {
            return;
        }
        for next in beside(at, self.cells.count(0), self.cells.count(1)).into_iter().flatten() {
            if self.is_open(next) {
                let [a, b] = [at, next].map(|at| groups::root(&mut self.parent, at as u32));
                if groups::join(&mut self.parent, a, b) {
                    self.area_m2[a.min(b) as usize] += self.area_m2[a.max(b) as usize];
                }
            }
        }
    }

    /// Opens a closed gap.
    fn open(&mut self, gap: &Gap) {
        for at in &gap.cells {
            self.closed[*at] -= 1;
            self.join(*at);
        }
    }

    /// Returns whether two pieces with a minimum area are on the sides of a gap.
    fn are_divided(&mut self, gap: &Gap, least_m2: f64) -> bool {
        let [a, b] = [0, 1].map(|side: usize| self.largest(&gap.beside[side]));
        let is_large = |piece: u32| self.area_m2[piece as usize] >= least_m2;
        a.zip(b).is_some_and(|(a, b)| a != b && is_large(a) && is_large(b))
    }

    /// Returns the largest piece of some cells by its first cell, of equal ones the first; none if all cells are closed.
    fn largest(&mut self, cells: &[usize]) -> Option<u32> {
        let mut largest: Option<u32> = None;
        for at in cells {
            if self.is_open(*at) {
                let piece = groups::root(&mut self.parent, *at as u32);
                let area_m2 = |piece: u32| self.area_m2[piece as usize];
                let order = |other: u32| area_m2(piece).total_cmp(&area_m2(other)).then(other.cmp(&piece));
                if largest.is_none_or(|other| order(other).is_gt()) {
                    largest = Some(piece);
                }
            }
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::super::regions::{areas, pieces};
    use super::*;
    use proptest::prelude::*;

    fn gap_of(cells: Vec<usize>, beside: [Vec<usize>; 2], width_m: f64) -> Gap {
        Gap {
            cells,
            beside,
            ends_m: [[0.0, 0.0], [0.0, width_m]],
            thickness_m: 0.1,
            has_lintel: false,
            stubs: [true; 2],
            is_passage: false,
        }
    }

    /// Connects all cells again for each gap.
    fn open_one_by_one(cells: &Cells, closed: &mut Vec<Gap>, least_m2: f64) -> Vec<Gap> {
        let mut opened = Vec::new();
        loop {
            let pieces = pieces(cells, closed);
            let area_m2 = areas(cells, &pieces);
            let largest = |beside: &[usize]| {
                let pieces = beside.iter().map(|at| pieces[*at] as usize).filter(|piece| *piece != 0);
                pieces.max_by(|a, b| area_m2[*a].total_cmp(&area_m2[*b]).then(b.cmp(a)))
            };
            let is_idle = |gap: &Gap| {
                let [a, b] = [0, 1].map(|side: usize| largest(&gap.beside[side]));
                !a.zip(b).is_some_and(|(a, b)| a != b && area_m2[a].min(area_m2[b]) >= least_m2)
            };
            let idle = (0..closed.len()).filter(|at| is_idle(&closed[*at]));
            let widest =
                idle.max_by(|a, b| closed[*a].width_m().total_cmp(&closed[*b].width_m()).then(a.cmp(b)));
            let Some(widest) = widest else { return opened };
            opened.push(closed.remove(widest));
        }
    }

    proptest! {
        #[test]
        fn gaps_are_opened_as_if_all_cells_were_connected_again(
            inside in prop::collection::vec(prop::bool::weighted(0.8), 64),
            gaps in prop::collection::vec((1usize..7, 0usize..8, 1usize..4, 1u8..9), 0..12),
            least in 0u8..24,
        ) {
            // Areas are sums of halves, so that their order does not count.
            let line = || (0..=8).map(|at| f64::from(at) / 2.0).collect();
            let cells = Cells { inside, ..Cells::of([line(), line()]) };
            let gap = |(x, y, height, width): (usize, usize, usize, u8)| {
                let column = |x: usize| (y..(y + height).min(8)).map(|y| cells.index([x, y])).collect();
                gap_of(column(x), [column(x - 1), column(x + 1)], f64::from(width) / 8.0)
            };
            let gaps: Vec<Gap> = gaps.into_iter().map(gap).collect();
            let least_m2 = f64::from(least) / 4.0;
            let (mut closed, mut expected) = (gaps.clone(), gaps);
            let opened = open_idle(&cells, &mut closed, |_| least_m2);
            prop_assert_eq!(opened, open_one_by_one(&cells, &mut expected, least_m2));
            prop_assert_eq!(closed, expected);
        }
    }

    /// Four spaces in a row with gaps of 0.1 m between them; the middle one of these is the widest.
    #[test]
    fn each_gap_is_measured_once() {
        let sides = vec![0.0, 5.0, 5.1, 5.6, 5.7, 6.2, 6.3, 12.3];
        let cells = Cells { inside: vec![true; 7], ..Cells::of([sides, vec![0.0, 1.0]]) };
        let gap = |at: usize, width_m: f64| gap_of(vec![at], [vec![at - 1], vec![at + 1]], width_m);
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
