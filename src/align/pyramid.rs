//! A pyramid of maxima: what a square of the map can offer at best.

use rayon::prelude::*;

/// Maxima of the likelihood over the squares that begin at each cell; also at cells left of and below the
/// map, whose squares reach into it.
pub(super) struct Maxima {
    width: i32,
    height: i32,
    /// Cells before the map's first one.
    pub(super) before: i32,
    values: Vec<u8>,
}

impl Maxima {
    /// The lowest level: squares of one cell.
    pub(super) fn of_cells(width: usize, height: usize, values: Vec<u8>) -> Maxima {
        Maxima { width: width as i32, height: height as i32, before: 0, values }
    }

    pub(super) fn at(&self, x: i32, y: i32) -> u8 {
        // A negative place wraps to a huge one.
        if (x as u32) < self.width as u32 && (y as u32) < self.height as u32 {
            self.values[(y * self.width + x) as usize]
        } else {
            0
        }
    }

    /// The maxima over squares of twice the side, which is `side` now.
    pub(super) fn doubled(&self, side: i32) -> Maxima {
        let before = self.before + side;
        let (width, height) = (self.width + side, self.height + side);
        let mut values = vec![0u8; (width * height) as usize];
        values.par_chunks_mut(width as usize).enumerate().for_each(|(y, row)| {
            let y = y as i32 - side;
            for (x, value) in row.iter_mut().enumerate() {
                let x = x as i32 - side;
                *value = self
                    .at(x, y)
                    .max(self.at(x + side, y))
                    .max(self.at(x, y + side))
                    .max(self.at(x + side, y + side));
            }
        });
        Maxima { width, height, before, values }
    }
}
