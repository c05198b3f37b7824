//! A pyramid of maxima: upper bounds over squares of the map.

use rayon::prelude::*;

/// Maxima of a picture over the squares that begin at each cell, for sides of 1, 2, 4 ... cells. The picture
/// has a border of zeros, within which no bounds check is needed.
pub(super) struct Pyramid {
    /// Cells left and right of the picture, and below and above it.
    pub(super) border: [usize; 2],
    pub(super) stride: usize,
    /// `levels[l]` holds squares of `2^l` cells.
    pub(super) levels: Vec<Vec<u8>>,
}

impl Pyramid {
    /// Builds `levels + 1` levels of a picture.
    pub(super) fn new(
        width: usize,
        height: usize,
        border: [usize; 2],
        levels: u32,
        value: impl Fn(usize, usize) -> u8 + Sync,
    ) -> Pyramid {
        let (stride, rows) = (width + 2 * border[0], height + 2 * border[1]);
        let mut cells = vec![0u8; stride * rows];
        cells.par_chunks_mut(stride).skip(border[1]).take(height).enumerate().for_each(|(y, row)| {
            for (x, cell) in row[border[0]..border[0] + width].iter_mut().enumerate() {
                *cell = value(x, y);
            }
        });
        let mut pyramid = Pyramid { border, stride, levels: vec![cells] };
        for level in 0..levels {
            let doubled = pyramid.doubled(1 << level);
            pyramid.levels.push(doubled);
        }
        pyramid
    }

    /// Returns the index of a cell of the picture in each level.
    pub(super) fn place(&self, x: i32, y: i32) -> usize {
        let [beside, below] = self.border.map(|border| border as i32);
        (y + below) as usize * self.stride + (x + beside) as usize
    }

    /// Returns the squares of twice the side, from the last level's squares of `side`.
    fn doubled(&self, side: usize) -> Vec<u8> {
        let last = &self.levels[self.levels.len() - 1];
        let mut cells = vec![0u8; last.len()];
        let rows = last.len() / self.stride;
        cells.par_chunks_mut(self.stride).enumerate().for_each(|(y, row)| {
            let above = &last[y * self.stride..(y + 1) * self.stride];
            let beyond = (y + side).min(rows - 1);
            let below = &last[beyond * self.stride..(beyond + 1) * self.stride];
            for (x, cell) in row.iter_mut().enumerate() {
                let right = (x + side).min(self.stride - 1);
                *cell = above[x].max(above[right]).max(below[x]).max(below[right]);
            }
        });
        cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holds_the_maximum_of_each_square() {
        let value = |x: usize, y: usize| ((x * 31 + y * 17) % 101) as u8;
        let pyramid = Pyramid::new(13, 9, [9, 8], 3, value);
        for level in 0..=3usize {
            let side = 1i32 << level;
            for y in -8..9i32 {
                for x in -8..13i32 {
                    let inside = |x: i32, y: i32| (0..13).contains(&x) && (0..9).contains(&y);
                    let want = (0..side * side)
                        .map(|i| (x + i % side, y + i / side))
                        .filter(|&(x, y)| inside(x, y))
                        .map(|(x, y)| value(x as usize, y as usize))
                        .max()
                        .unwrap_or(0);
                    assert_eq!(pyramid.levels[level][pyramid.place(x, y)], want, "{level} {x} {y}");
                }
            }
        }
    }
}
