//! Rasterises scans at their poses: walls where rays end, free floor where they pass.

use super::scan::Scan;
use crate::lidar::{Cell, LidarError};
use viola_geometry::{Grid, GridFrame, Point2, Pose2};

/// Side of a cell, as in the robots' own maps.
pub(super) const CELL_M: f64 = 0.05;
/// Maximum number of cells: 100 m by 100 m.
const MAX_CELLS: usize = 4 << 20;
/// Margin around the scans, so that a grid that grows does so seldom.
const MARGIN_M: f64 = 3.0;
/// A wall needs at least this many rays that end in it, and this fraction of the rays that reach it.
const WALL_HITS: u16 = 2;
const WALL_FRACTION: f64 = 0.2;
/// With fewer scans, a single ray is enough.
const FEW_SCANS: usize = 10;

/// Returns a frame around all hits and positions of the scans at these poses.
pub(super) fn frame_around(scans: &[Scan], poses: &[Pose2]) -> Result<GridFrame, LidarError> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (scan, pose) in scans.iter().zip(poses) {
        let from = Point2::from(pose.translation());
        for point in scan.hits_m.iter().map(|hit| pose.apply(hit)).chain([from]) {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
    }
    let low = low.map(|v| (v / CELL_M).floor() * CELL_M);
    checked(GridFrame::covering(low, high, MARGIN_M, CELL_M))
}

fn checked(frame: GridFrame) -> Result<GridFrame, LidarError> {
    let cells = frame.width.saturating_mul(frame.height);
    if cells > MAX_CELLS {
        return Err(LidarError::TooManyCells { cells: cells as u64, max: MAX_CELLS });
    }
    Ok(frame)
}

/// Returns the grid on a frame that holds these points too; its cells keep their places.
pub(super) fn grown(grid: &Grid<u8>, points: &[Point2]) -> Result<Grid<u8>, LidarError> {
    let old = grid.frame;
    let ends_m = [old.width, old.height].map(|cells| cells as f64 * CELL_M);
    let more = |outside_m: f64| {
        if outside_m >= 0.0 { ((outside_m + MARGIN_M) / CELL_M).ceil() as usize } else { 0 }
    };
    let before = [0, 1].map(|axis| {
        let outside_m = points.iter().map(|point| old.origin_m[axis] - point[axis]);
        more(outside_m.fold(f64::NEG_INFINITY, f64::max))
    });
    let after = [0, 1].map(|axis| {
        let outside_m = points.iter().map(|point| point[axis] - old.origin_m[axis] - ends_m[axis]);
        more(outside_m.fold(f64::NEG_INFINITY, f64::max))
    });
    let frame = checked(GridFrame {
        origin_m: [0, 1].map(|axis| old.origin_m[axis] - before[axis] as f64 * CELL_M),
        cell_m: CELL_M,
        width: before[0] + old.width + after[0],
        height: before[1] + old.height + after[1],
    })?;
    let mut larger = Grid::filled(frame, 0);
    for (y, row) in grid.cells.chunks_exact(old.width).enumerate() {
        let first = (y + before[1]) * frame.width + before[0];
        larger.cells[first..first + old.width].copy_from_slice(row);
    }
    Ok(larger)
}

pub(super) fn raster(scans: &[Scan], poses: &[Pose2]) -> Result<Grid<Cell>, LidarError> {
    let frame = frame_around(scans, poses)?;
    // Numbers of rays that end in a cell, and of rays that pass it.
    let mut counts = Grid::filled(frame, [0u16; 2]);
    for (scan, pose) in scans.iter().zip(poses) {
        let Some(from) = frame.cell(&Point2::from(pose.translation())) else { continue };
        for hit in &scan.hits_m {
            let Some(to) = frame.cell(&pose.apply(hit)) else { continue };
            for (x, y) in between(from, to) {
                let cell = &mut counts.cells[y * frame.width + x][1];
                *cell = cell.saturating_add(1);
            }
            let cell = &mut counts.cells[to.1 * frame.width + to.0][0];
            *cell = cell.saturating_add(1);
        }
    }
    let wall_hits = if scans.len() < FEW_SCANS { 1 } else { WALL_HITS };
    let decide = |[hits, passes]: [u16; 2]| {
        let fraction = f64::from(hits) / (f64::from(hits) + f64::from(passes)).max(1.0);
        if hits >= wall_hits && fraction > WALL_FRACTION {
            Cell::Occupied
        } else if passes > 0 {
            Cell::Free
        } else {
            Cell::Unknown
        }
    };
    Ok(Grid { frame, cells: counts.cells.into_iter().map(decide).collect() })
}

/// Returns the cells on the straight line between two cells, without the last.
fn between(from: (usize, usize), to: (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    let (dx, dy) = (to.0 as i64 - from.0 as i64, to.1 as i64 - from.1 as i64);
    let steps = dx.abs().max(dy.abs());
    // Rounded division; `steps` is not zero when used.
    let part = move |d: i64, index: i64| (2 * d * index + steps).div_euclid(2 * steps);
    (0..steps).map(move |index| {
        ((from.0 as i64 + part(dx, index)) as usize, (from.1 as i64 + part(dy, index)) as usize)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrected_poses_far_from_the_odometry_keep_their_hits() {
        let hits_m = vec![Point2::new(2.0, 0.5), Point2::new(0.5, 1.0)];
        let scans = [Scan { by_odometry: Pose2::new(0.0, 0.0, 0.0), hits_m }];
        for pose in [Pose2::new(10.0, 0.0, 0.0), Pose2::new(-20.0, 7.0, 1.0)] {
            let grid = raster(&scans, &[pose]).unwrap();
            for hit in &scans[0].hits_m {
                assert_eq!(grid.at(&pose.apply(hit)), Some(Cell::Occupied), "{pose:?}");
            }
        }
    }

    #[test]
    fn a_grown_grid_keeps_its_cells() {
        let frame = GridFrame { origin_m: [1.0, 2.0], cell_m: CELL_M, width: 20, height: 30 };
        let mut grid = Grid::filled(frame, 0u8);
        grid.set(3, 7, 200);
        let marked = frame.centre(3, 7);
        for [x, y] in
            [[1.5, 3.0], [-4.0, 3.0], [9.0, 3.0], [1.5, -6.0], [1.5, 12.0], [-4.0, 12.0], [2.0, 3.5]]
        {
            let point = Point2::new(x, y);
            let larger = grown(&grid, &[point]).unwrap();
            assert_eq!((larger.at(&marked), larger.at(&point)), (Some(200), Some(0)), "{point}");
            assert_eq!(larger.cells.iter().filter(|value| **value > 0).count(), 1, "{point}");
        }
        let too_far = grown(&grid, &[Point2::new(500.0, 500.0)]);
        assert!(matches!(too_far, Err(LidarError::TooManyCells { .. })));
    }
}
