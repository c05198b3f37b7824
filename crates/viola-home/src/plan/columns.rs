//! Columns of upright surface that faces one of four directions, in bins of the plan.

use std::ops::RangeInclusive;

/// Bins across a wall face and along it.
const ACROSS_M: f64 = 0.01;
const ALONG_M: f64 = 0.05;
/// Bins of one facing: larger homes get larger bins.
const MAX_BINS: f64 = 6e6;

/// Columns of one facing: bits of the heights with wall surface, by the places across and along.
pub(super) struct Columns {
    pub across_m: f64,
    pub along_m: f64,
    /// Coordinates of the first bins.
    pub low_m: [f64; 2],
    pub across: usize,
    pub along: usize,
    pub bits: Vec<u32>,
}

impl Columns {
    /// `across` is the axis across the faces.
    pub fn new(across: usize, low_m: [f64; 2], high_m: [f64; 2]) -> Columns {
        const MARGIN_M: f64 = 0.3;
        let side = |axis: usize| high_m[axis] - low_m[axis] + 2.0 * MARGIN_M;
        let along = 1 - across;
        let bins = side(across) / ACROSS_M * side(along) / ALONG_M;
        let scale = (bins / MAX_BINS).sqrt().max(1.0);
        let (across_m, along_m) = (ACROSS_M * scale, ALONG_M * scale);
        let (rows, columns) = ((side(across) / across_m) as usize + 1, (side(along) / along_m) as usize + 1);
        Columns {
            across_m,
            along_m,
            low_m: [low_m[across] - MARGIN_M, low_m[along] - MARGIN_M],
            across: rows,
            along: columns,
            bits: vec![0; rows * columns],
        }
    }

    /// Adds bits at a place: across, along.
    pub fn add(&mut self, [across, along]: [f64; 2], bits: u32) {
        let row = ((across - self.low_m[0]) / self.across_m).floor();
        let column = ((along - self.low_m[1]) / self.along_m).floor();
        if row >= 0.0 && column >= 0.0 && (row as usize) < self.across && (column as usize) < self.along {
            self.bits[row as usize * self.along + column as usize] |= bits;
        }
    }

    /// Returns the bits at a place along the face, between two places across it.
    pub fn between(&self, ends_m: [f64; 2], along_m: f64) -> u32 {
        let column = (((along_m - self.low_m[1]) / self.along_m).max(0.0) as usize).min(self.along - 1);
        self.band(self.rows(ends_m), column)
    }

    /// Returns the rows from one place across the face to another one, in any order; the first or the last row for those beyond.
    pub fn rows(&self, ends_m: [f64; 2]) -> RangeInclusive<usize> {
        let row =
            |metres: f64| (((metres - self.low_m[0]) / self.across_m).max(0.0) as usize).min(self.across - 1);
        row(ends_m[0].min(ends_m[1]))..=row(ends_m[0].max(ends_m[1]))
    }

    /// Returns the number of columns before a place along the face, whose nearest border counts.
    pub fn columns_before(&self, along_m: f64) -> usize {
        (((along_m - self.low_m[1]) / self.along_m).round().max(0.0) as usize).min(self.along)
    }

    /// Returns the bits of a column within rows.
    pub fn band(&self, rows: RangeInclusive<usize>, column: usize) -> u32 {
        rows.fold(0, |bits, row| bits | self.bits[row * self.along + column])
    }
}
