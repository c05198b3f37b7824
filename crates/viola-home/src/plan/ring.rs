//! Outlines of the inside along the lines of cells.

use super::cells::Cells;
use crate::rooms::outline::trace;
use viola_geometry::Grid;

/// Corners of an outline, as indices of lines; the inside is on the left.
pub(super) struct Ring(Vec<[usize; 2]>);

/// Returns the outlines of the inside and of its holes.
pub(super) fn rings(cells: &Cells) -> Vec<Ring> {
    let outlines = trace(&Grid { frame: cells.frame(), cells: cells.inside.clone() });
    let rings = outlines.iter().flat_map(|outline| std::iter::once(&outline.ring_m).chain(&outline.holes_m));
    rings.map(|ring| Ring(ring.iter().map(|corner| corner.map(|c| c.round() as usize)).collect())).collect()
}

impl Ring {
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns a corner; the ring is endless.
    pub fn corner(&self, at: usize) -> [usize; 2] {
        self.0[at % self.len()]
    }

    /// Returns the turn at the corner after this one: positive to the left.
    pub fn turn(&self, at: usize) -> i64 {
        let [a, b, c] = [at, at + 1, at + 2].map(|at| self.corner(at).map(|c| c as i64));
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    }
}
