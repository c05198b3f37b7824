//! Resamples a grid that is rotated in the map frame on an upright grid.

use crate::lidar::build::occupied_centres;
use crate::lidar::{Cell, LidarError, MAX_CELLS};
use viola_geometry::{Grid, GridFrame, Point2, Pose2};

/// Rotates `grid` about its own lower-left corner, which is at `origin`. Returns the upright grid and the
/// exact centres of the occupied cells.
pub(super) fn turn(grid: &Grid<Cell>, origin: &Pose2) -> Result<(Grid<Cell>, Vec<Point2>), LidarError> {
    let image_frame = GridFrame { origin_m: [0.0, 0.0], ..grid.frame };
    let image = Grid { frame: image_frame, cells: grid.cells.clone() };
    let occupied_m: Vec<Point2> = occupied_centres(&image)?.iter().map(|p| origin.apply(p)).collect();

    let (w, h) =
        (image_frame.width as f64 * image_frame.cell_m, image_frame.height as f64 * image_frame.cell_m);
    let corners = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| origin.apply(&Point2::new(x, y)));
    let least = |axis: usize| corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
    let most = |axis: usize| corners.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
    let frame = GridFrame::covering([least(0), least(1)], [most(0), most(1)], 0.0, image_frame.cell_m);
    if frame.width.saturating_mul(frame.height) > MAX_CELLS {
        return Err(LidarError::TooManyCells { cells: (frame.width * frame.height) as u64, max: MAX_CELLS });
    }
    let mut turned = Grid::filled(frame, Cell::Unknown);
    let image_from_map = origin.inverse();
    for y in 0..frame.height {
        for x in 0..frame.width {
            let value = image.at(&image_from_map.apply(&frame.centre(x, y)));
            turned.set(x, y, value.unwrap_or(Cell::Unknown));
        }
    }
    // Sampling alone would tear holes into walls one cell thick.
    for point in &occupied_m {
        if let Some((x, y)) = frame.cell(point) {
            turned.set(x, y, Cell::Occupied);
        }
    }
    Ok((turned, occupied_m))
}
