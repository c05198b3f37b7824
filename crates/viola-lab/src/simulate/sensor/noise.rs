//! Noise that varies slowly over a picture.

use crate::simulate::rng::{bell, hash};

/// Bilinear interpolation of normal values on a grid of `size` pixels.
pub(super) struct SlowNoise {
    size: usize,
    columns: usize,
    corners: Vec<f32>,
}

impl SlowNoise {
    pub fn over(width: usize, height: usize, size: usize, salt: u64) -> SlowNoise {
        let (columns, rows) = (width / size + 2, height / size + 2);
        let corners = (0..columns * rows).map(|k| bell(hash(salt ^ hash(k as u64)))).collect();
        SlowNoise { size, columns, corners }
    }

    pub fn at(&self, x: usize, y: usize) -> f32 {
        let first = y / self.size * self.columns + x / self.size;
        let part = |value: usize| (value % self.size) as f32 / self.size as f32;
        let (fx, fy) = (part(x), part(y));
        let row = |k: usize| self.corners[k] * (1.0 - fx) + self.corners[k + 1] * fx;
        row(first) * (1.0 - fy) + row(first + self.columns) * fy
    }
}
