//! The sheet of cells that a Valetudo map is drawn on, and its cells in the map's frame.

use super::file::Layer;
use crate::geometry::{Grid, GridFrame, Point2};
use crate::lidar::{Cell, LidarError, MAX_CELLS};

/// A run of cells to the right of (x, y), counted from the top-left corner.
#[derive(Clone, Copy)]
pub(super) struct Run {
    pub x: u32,
    pub y: u32,
    pub count: u32,
}

/// The whole sheet that `size` spans, in cells.
pub(super) struct Sheet {
    pub width: i64,
    pub height: i64,
    pub height_m: f64,
    pub cell_m: f64,
}

impl Sheet {
    /// A layer's cells as checked runs. Where a layer has both encodings they say the same.
    pub fn runs(&self, layer: &Layer, index: usize) -> Result<Vec<Run>, LidarError> {
        let (values, group, name) = if layer.compressed_pixels.0.is_empty() {
            (&layer.pixels.0, 2, "pixels")
        } else {
            (&layer.compressed_pixels.0, 3, "compressedPixels")
        };
        let mut runs = Vec::with_capacity(values.len() / group);
        for values in values.chunks(group) {
            let bad = |expected: String| LidarError::BadField {
                field: format!("layers[{index}].{name}"),
                value: values.iter().map(|v| v.0.to_string()).collect::<Vec<_>>().join(", "),
                expected,
            };
            if values.len() != group {
                return Err(bad(format!("groups of {group} numbers")));
            }
            let (x, y, count) = (values[0].0, values[1].0, values.get(2).map_or(1, |count| count.0));
            let fits = x >= 0
                && y >= 0
                && count >= 1
                && i64::from(y) < self.height
                && i64::from(x) + i64::from(count) <= self.width;
            if !fits {
                return Err(bad(format!("inside the map's {}x{} pixels", self.width, self.height)));
            }
            runs.push(Run { x: x as u32, y: y as u32, count: count as u32 });
        }
        Ok(runs)
    }

    /// An empty grid around all runs, so that an almost empty sheet costs nothing.
    pub fn grid_around(&self, layers: &[Vec<Run>]) -> Result<Grid<Cell>, LidarError> {
        let mut runs = layers.iter().flatten();
        let first = runs.next().ok_or(LidarError::NoWalls)?;
        let (mut left, mut right, mut top, mut bottom) =
            (first.x, first.x + first.count, first.y, first.y + 1);
        for run in runs {
            left = left.min(run.x);
            right = right.max(run.x + run.count);
            top = top.min(run.y);
            bottom = bottom.max(run.y + 1);
        }
        // One unknown cell on each side, for the border of a floor that has no walls.
        let (width, height) = ((right - left) as usize + 2, (bottom - top) as usize + 2);
        if width * height > MAX_CELLS {
            return Err(LidarError::TooManyCells { cells: (width * height) as u64, max: MAX_CELLS });
        }
        let origin_m =
            [(f64::from(left) - 1.0) * self.cell_m, self.height_m - (f64::from(bottom) + 1.0) * self.cell_m];
        Ok(Grid::filled(GridFrame { origin_m, cell_m: self.cell_m, width, height }, Cell::Unknown))
    }

    /// The centre of a cell, in the map's frame.
    pub fn centre(&self, x: u32, y: u32) -> Point2 {
        Point2::new((f64::from(x) + 0.5) * self.cell_m, self.height_m - (f64::from(y) + 0.5) * self.cell_m)
    }

    pub fn fill(&self, grid: &mut Grid<Cell>, runs: &[Run], value: Cell) {
        for run in runs {
            if let Some((x, y)) = grid.frame.cell(&self.centre(run.x, run.y)) {
                let from = y * grid.frame.width + x;
                grid.cells[from..from + run.count as usize].fill(value);
            }
        }
    }
}
