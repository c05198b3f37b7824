//! Regular grids in the plane.

use super::Point2;

/// Position and size of a grid's cells. Cell `(0, 0)` is the lower-left one; x runs right, y runs up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridFrame {
    /// The lower-left corner of cell `(0, 0)`, in metres.
    pub origin_m: [f64; 2],
    /// Side of a cell, in metres.
    pub cell_m: f64,
    pub width: usize,
    pub height: usize,
}

impl GridFrame {
    /// Returns the smallest frame of `cell_m` cells that holds the box `min..max` with `margin_m` around it.
    pub fn covering(min_m: [f64; 2], max_m: [f64; 2], margin_m: f64, cell_m: f64) -> GridFrame {
        let origin_m = [min_m[0] - margin_m, min_m[1] - margin_m];
        let cells = |axis: usize| (((max_m[axis] + margin_m - origin_m[axis]) / cell_m).floor() as usize) + 1;
        GridFrame { origin_m, cell_m, width: cells(0), height: cells(1) }
    }

    /// Returns the cell that holds a point, or `None` outside the grid.
    pub fn cell(&self, point: &Point2) -> Option<(usize, usize)> {
        let x = ((point.x - self.origin_m[0]) / self.cell_m).floor();
        let y = ((point.y - self.origin_m[1]) / self.cell_m).floor();
        // NaN fails both comparisons.
        if x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64 {
            Some((x as usize, y as usize))
        } else {
            None
        }
    }

    /// Returns the centre of a cell, in metres.
    pub fn centre(&self, x: usize, y: usize) -> Point2 {
        Point2::new(
            self.origin_m[0] + (x as f64 + 0.5) * self.cell_m,
            self.origin_m[1] + (y as f64 + 0.5) * self.cell_m,
        )
    }

    /// Returns the origin for people and other programs, rounded to a micrometre: sums of decimal numbers have noise.
    pub fn written_origin_m(&self) -> [f64; 2] {
        // Adding zero makes -0 and 0 equal.
        self.origin_m.map(|c| (c * 1e6).round() / 1e6 + 0.0)
    }

    pub fn len(&self) -> usize {
        self.width * self.height
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// One value per cell, row by row from the bottom.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid<T> {
    pub frame: GridFrame,
    pub cells: Vec<T>,
}

impl<T: Copy> Grid<T> {
    pub fn filled(frame: GridFrame, value: T) -> Grid<T> {
        Grid { frame, cells: vec![value; frame.len()] }
    }

    pub fn get(&self, x: usize, y: usize) -> T {
        self.cells[y * self.frame.width + x]
    }

    pub fn set(&mut self, x: usize, y: usize, value: T) {
        self.cells[y * self.frame.width + x] = value;
    }

    /// Returns the value at a point, or `None` outside the grid.
    pub fn at(&self, point: &Point2) -> Option<T> {
        self.frame.cell(point).map(|(x, y)| self.get(x, y))
    }
}

/// Returns the cell of a grid without bounds that holds a point. The origin is a corner of cell `[0, 0]`.
pub fn cell_of(point: &Point2, side_m: f64) -> [i32; 2] {
    [point.x, point.y].map(|c| (c / side_m).floor() as i32)
}

/// Returns a cell and the eight around it.
pub fn cells_around([x, y]: [i32; 2]) -> impl Iterator<Item = [i32; 2]> {
    (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| [x + dx, y + dy]))
}

/// Returns a voxel and the 26 around it.
pub fn voxels_around([x, y, z]: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    (-1..=1).flat_map(move |dz| cells_around([x, y]).map(move |[x, y]| [x, y, z + dz]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_cell_holds_its_centre(x0 in -9.0..9.0f64, y0 in -9.0..9.0f64, cell in 0.01..0.5f64, x in 0usize..40, y in 0usize..30) {
            let frame = GridFrame { origin_m: [x0, y0], cell_m: cell, width: 40, height: 30 };
            prop_assert_eq!(frame.cell(&frame.centre(x, y)), Some((x, y)));
        }

        #[test]
        fn covering_covers(x0 in -9.0..9.0f64, w in 0.0..9.0f64, h in 0.0..9.0f64, cell in 0.01..0.5f64) {
            let frame = GridFrame::covering([x0, x0], [x0 + w, x0 + h], 0.3, cell);
            prop_assert!(frame.cell(&Point2::new(x0, x0)).is_some());
            prop_assert!(frame.cell(&Point2::new(x0 + w, x0 + h)).is_some());
        }
    }

    #[test]
    fn a_written_origin_has_no_noise() {
        for (c, want) in
            [(0.499_999_999_999_999_3, "0.5"), (-6.899_999_999_999_999_5, "-6.9"), (-1e-9, "0.0")]
        {
            let frame = GridFrame { origin_m: [c, 1.25], cell_m: 0.05, width: 1, height: 1 };
            assert_eq!(format!("{:?}", frame.written_origin_m()), format!("[{want}, 1.25]"));
        }
    }

    #[test]
    fn outside_and_nan_are_no_cell() {
        let grid = Grid::filled(GridFrame { origin_m: [0.0, 0.0], cell_m: 1.0, width: 2, height: 2 }, 7u8);
        for (x, y) in [(-0.1, 0.0), (0.0, 2.0), (f64::NAN, 0.0), (0.0, f64::INFINITY)] {
            assert_eq!(grid.at(&Point2::new(x, y)), None);
        }
        assert_eq!(grid.at(&Point2::new(1.9, 0.1)), Some(7));
    }
}
