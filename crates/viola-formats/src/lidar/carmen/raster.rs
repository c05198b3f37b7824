//! Rasterises scans at their poses: walls where rays end, free floor where they pass.

use super::scan::Scan;
use crate::lidar::{Cell, LidarError};
use viola_geometry::{Grid, GridFrame, Point2, Pose2};

/// Side of a cell, as in the robots' own maps.
pub(super) const CELL_M: f64 = 0.05;
/// Maximum number of cells: 100 m by 100 m.
const MAX_CELLS: usize = 4 << 20;
/// Margin around the odometry's extent, for the corrected poses.
const MARGIN_M: f64 = 3.0;
/// A wall needs at least this many rays that end in it, and this fraction of the rays that reach it.
const WALL_HITS: u16 = 2;
const WALL_SHARE: f64 = 0.2;
/// With fewer scans, a single ray is enough.
const FEW_SCANS: usize = 10;

/// Returns a frame around all hits and poses of the scans.
pub(super) fn frame_around(scans: &[Scan]) -> Result<GridFrame, LidarError> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for scan in scans {
        let from = Point2::from(scan.by_odometry.translation());
        for point in scan.hits_m.iter().map(|hit| scan.by_odometry.apply(hit)).chain([from]) {
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
    }
    let low = low.map(|v| (v / CELL_M).floor() * CELL_M);
    let frame = GridFrame::covering(low, high, MARGIN_M, CELL_M);
    let cells = frame.width.saturating_mul(frame.height);
    if cells > MAX_CELLS {
        return Err(LidarError::TooManyCells { cells: cells as u64, max: MAX_CELLS });
    }
    Ok(frame)
}

pub(super) fn raster(scans: &[Scan], poses: &[Pose2]) -> Result<Grid<Cell>, LidarError> {
    let frame = frame_around(scans)?;
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
        let share = f64::from(hits) / (f64::from(hits) + f64::from(passes)).max(1.0);
        if hits >= wall_hits && share > WALL_SHARE {
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
