//! Connectivity of a room while it is furnished.

use crate::simulate::piece::Footprint;
use crate::simulate::plan::Rect;
use viola_geometry::Point2;

const CELL_M: f64 = 0.1;
/// Half of the narrowest gap that a person passes.
const BODY_M: f64 = 0.24;

/// Raster of the positions where a person can stand.
pub(super) struct Passage {
    inner: Rect,
    blocked: Vec<bool>,
    columns: usize,
    rows: usize,
    /// Cells just inside each of the room's ways.
    ways: Vec<usize>,
}

impl Passage {
    pub fn new(inner: Rect) -> Passage {
        let columns = (inner.size(0) / CELL_M) as usize + 1;
        let rows = (inner.size(1) / CELL_M) as usize + 1;
        Passage { inner, blocked: vec![false; columns * rows], columns, rows, ways: vec![] }
    }

    /// Adds an opening in the room's wall that must stay reachable.
    pub fn lead_to(&mut self, opening: &Point2) {
        let inside = |axis: usize| {
            let margin = 0.3f64.min(self.inner.size(axis) / 2.0);
            let at = opening[axis].clamp(self.inner.min[axis] + margin, self.inner.max[axis] - margin);
            ((at - self.inner.min[axis]) / CELL_M) as usize
        };
        self.ways.push(inside(1).min(self.rows - 1) * self.columns + inside(0).min(self.columns - 1));
    }

    pub fn block(&mut self, footprint: &Footprint) {
        let wide = footprint.grown(BODY_M);
        for index in 0..self.blocked.len() {
            if !self.blocked[index] && wide.contains(&self.centre(index)) {
                self.blocked[index] = true;
            }
        }
    }

    fn centre(&self, index: usize) -> Point2 {
        let (x, y) = ((index % self.columns) as f64, (index / self.columns) as f64);
        Point2::new(self.inner.min[0] + (x + 0.5) * CELL_M, self.inner.min[1] + (y + 0.5) * CELL_M)
    }

    /// Returns whether all ways stay connected, with enough free floor, after one more piece is placed at
    /// `spot`.
    pub fn stays_open_with(&self, spot: &Footprint) -> bool {
        let wide = spot.grown(BODY_M);
        let open: Vec<bool> = (0..self.blocked.len())
            .map(|index| !self.blocked[index] && !wide.contains(&self.centre(index)))
            .collect();
        let first = self.ways.first().copied().or_else(|| open.iter().position(|&open| open));
        let Some(start) = first.filter(|&start| open[start]) else { return false };
        let mut seen = vec![false; open.len()];
        let mut queue = vec![start];
        seen[start] = true;
        let mut reached = 0;
        while let Some(index) = queue.pop() {
            reached += 1;
            let (x, y) = (index % self.columns, index / self.columns);
            let neighbours = [
                (x > 0).then(|| index - 1),
                (x + 1 < self.columns).then_some(index + 1),
                (y > 0).then(|| index - self.columns),
                (y + 1 < self.rows).then_some(index + self.columns),
            ];
            for next in neighbours.into_iter().flatten() {
                if open[next] && !seen[next] {
                    seen[next] = true;
                    queue.push(next);
                }
            }
        }
        let enough = (0.12 * self.inner.area_m2()).clamp(0.25, 4.0) / (CELL_M * CELL_M);
        f64::from(reached) >= enough && self.ways.iter().all(|&way| seen[way])
    }
}
