//! The sheet of cells on which robots draw their maps, and its cells in the map's frame.
//!
//! The origin of the sheet is its top-left corner with y down, as in Valetudo. In the map's frame y is up and
//! the origin is the sheet's lower-left corner, for every robot.

use crate::lidar::{Cell, LidarError, MAX_CELLS, RobotFrame};
use viola_geometry::{Grid, GridFrame, Point2};

/// Marks further from the sheet are damaged. Zones are drawn by hand, and may begin beside it.
pub(super) const MAX_OFF_SHEET_M: f64 = 10.0;

/// A run of cells to the right of (x, y), counted from the top-left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    pub x: u32,
    pub y: u32,
    pub count: u32,
}

/// The whole sheet of the file's `size`, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sheet {
    pub width: i64,
    pub height: i64,
    /// Width and height, which need be no multiple of a cell.
    pub size_cm: [i64; 2],
    height_cm: f64,
    height_m: f64,
    pub cell_m: f64,
}

impl Sheet {
    /// Returns a sheet from sizes in centimetres, as in Valetudo's JSON.
    pub fn new(width_cm: i64, height_cm: i64, pixel_cm: i64) -> Sheet {
        Sheet {
            width: width_cm / pixel_cm.max(1),
            height: height_cm / pixel_cm.max(1),
            size_cm: [width_cm, height_cm],
            height_cm: height_cm as f64,
            height_m: height_cm as f64 / 100.0,
            cell_m: pixel_cm as f64 / 100.0,
        }
    }

    pub fn holds(&self, x: i64, y: i64, count: i64) -> bool {
        x >= 0 && y >= 0 && count >= 1 && y < self.height && x + count <= self.width
    }

    /// Returns Valetudo's coordinates: centimetres from the top-left corner, y down.
    pub fn valetudo_frame(&self) -> RobotFrame {
        RobotFrame { units_per_m: 100.0, origin: [0.0, self.height_cm], is_y_down: true }
    }

    /// Converts a point in centimetres from the top-left corner, y down, to the map's frame.
    pub fn point(&self, x_cm: f64, y_cm: f64) -> Point2 {
        Point2::new(x_cm / 100.0, (self.height_cm - y_cm) / 100.0)
    }

    /// Returns whether a point in the map's frame is on the sheet, or at most [`MAX_OFF_SHEET_M`] beside it.
    pub fn is_near(&self, at_m: [f64; 2]) -> bool {
        let is_within = |at_m: f64, size_cm: i64| {
            (-MAX_OFF_SHEET_M..=size_cm as f64 / 100.0 + MAX_OFF_SHEET_M).contains(&at_m)
        };
        is_within(at_m[0], self.size_cm[0]) && is_within(at_m[1], self.size_cm[1])
    }

    /// Returns an empty grid around all runs, so that an almost empty sheet needs little memory.
    pub fn grid_around<'a>(&self, mut runs: impl Iterator<Item = &'a Run>) -> Result<Grid<Cell>, LidarError> {
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

    /// Returns the centre of a cell, in the map's frame.
    pub fn centre(&self, x: u32, y: u32) -> Point2 {
        Point2::new((f64::from(x) + 0.5) * self.cell_m, self.height_m - (f64::from(y) + 0.5) * self.cell_m)
    }

    /// Returns the centres of all cells of the runs, in their order.
    pub fn centres(&self, runs: &[Run]) -> Vec<Point2> {
        runs.iter().flat_map(|run| (run.x..run.x + run.count).map(|x| self.centre(x, run.y))).collect()
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

/// Collects cells into runs; the cells come row by row, from the left.
#[derive(Debug, Clone, Default)]
pub(super) struct Runs(pub Vec<Run>);

impl Runs {
    pub fn add(&mut self, x: u32, y: u32) {
        match self.0.last_mut() {
            Some(last) if last.y == y && last.x + last.count == x => last.count += 1,
            _ => self.0.push(Run { x, y, count: 1 }),
        }
    }
}
