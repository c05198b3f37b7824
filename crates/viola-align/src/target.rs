//! The LiDAR map for registration: points, and the distance field to the nearest one.

mod pieces;

use super::rooms::NamedRooms;
use pieces::Pieces;
use rustc_hash::FxHashSet;
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::{DistanceField, Grid, GridFrame, LevelName, Point2, cell_of};

/// The map that a virtual scan is registered to.
#[derive(Debug, Clone)]
pub struct Target {
    pub level: LevelName,
    pub points_m: Vec<Point2>,
    /// One of the points in each cell of 5 cm.
    pub thinned_m: Vec<Point2>,
    /// Of each of `thinned_m`: how much it counts as a wall, 0..1.
    pub thinned_fractions: Vec<f64>,
    /// State of each cell, for maps that have cells.
    pub cells: Option<Grid<Cell>>,
    pub field: DistanceField,
    /// `None` if no room's name states its purpose.
    pub rooms: Option<NamedRooms>,
    pieces: Pieces,
}

/// Side of the cells that have one thinned point.
pub(crate) const THINNED_CELL_M: f64 = 0.05;
/// Cell size of the distance field for maps that are bare points: finer than their noise.
const POINT_CELL_M: f64 = 0.02;
/// Distance beyond the map within which the field is exact.
const MARGIN_M: f64 = 1.0;
/// Maximum number of the field's cells (4 bytes each); larger maps get coarser cells.
const MAX_CELLS: f64 = 16e6;

impl Target {
    /// Returns the target of a home's only map; `None` if the map has no occupied point.
    pub fn new(lidar: &LidarMap) -> Option<Target> {
        Target::of_level(LevelName::MAIN, lidar)
    }

    /// Returns the target of a level's map; `None` if the map has no occupied point.
    pub fn of_level(level: LevelName, lidar: &LidarMap) -> Option<Target> {
        let target = Target::from_points(lidar.occupied_m.clone(), lidar.info.cell_m, lidar.cells.clone())?;
        Some(Target { level, rooms: NamedRooms::new(lidar), ..target })
    }

    /// Returns the target of bare points; `cell_m` is their raster, if they have one.
    pub fn from_points(
        points_m: Vec<Point2>,
        cell_m: Option<f64>,
        cells: Option<Grid<Cell>>,
    ) -> Option<Target> {
        let frame = field_frame(&points_m, cell_m)?;
        let mut occupied = Grid::filled(frame, false);
        for point in &points_m {
            if let Some((x, y)) = frame.cell(point) {
                occupied.set(x, y, true);
            }
        }
        let mut taken = FxHashSet::default();
        let thinned_m: Vec<Point2> =
            points_m.iter().filter(|p| taken.insert(cell_of(p, THINNED_CELL_M))).copied().collect();
        let pieces = Pieces::new(&points_m, cell_m);
        Some(Target {
            level: LevelName::MAIN,
            thinned_fractions: thinned_m.iter().map(|point| pieces.fraction(point)).collect(),
            points_m,
            thinned_m,
            cells,
            field: DistanceField::new(&occupied),
            rooms: None,
            pieces,
        })
    }

    /// Returns how much the map's points beside `point` count as a wall, 0..1: little if they are a short piece.
    pub fn wall_fraction(&self, point: &Point2) -> f64 {
        self.pieces.fraction(point)
    }

    /// Returns the state of the cell at a point.
    pub fn cell_at(&self, point: &Point2) -> Cell {
        self.cells.as_ref().and_then(|cells| cells.at(point)).unwrap_or(Cell::Unknown)
    }
}

/// Returns cells whose centres are those of the map's own cells, if it has any: then the field's zeros lie on
/// the middle of the walls.
fn field_frame(points_m: &[Point2], map_cell_m: Option<f64>) -> Option<GridFrame> {
    let first = points_m.first()?;
    let (mut min, mut max) = ([first.x, first.y], [first.x, first.y]);
    for point in points_m {
        for (axis, value) in [point.x, point.y].into_iter().enumerate() {
            min[axis] = min[axis].min(value);
            max[axis] = max[axis].max(value);
        }
    }
    let area = |cell_m: f64| {
        (max[0] - min[0] + 2.0 * MARGIN_M) * (max[1] - min[1] + 2.0 * MARGIN_M) / (cell_m * cell_m)
    };
    let mut cell_m = map_cell_m.unwrap_or(POINT_CELL_M);
    while area(cell_m) > MAX_CELLS {
        cell_m *= 2.0;
    }
    // A whole number of cells of margin, then half a cell, puts centres on the lower-left point.
    let margin_m = ((MARGIN_M / cell_m).ceil() + 0.5) * cell_m;
    Some(GridFrame::covering(min, max, margin_m, cell_m))
}

/// Returns points on the walls of an L-shaped room: a rectangle fits itself mirrored.
#[cfg(test)]
pub(crate) fn l_shaped_room() -> Vec<Point2> {
    let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (2.0, 3.0), (2.0, 5.0), (0.0, 5.0), (0.0, 0.0)];
    let side = |pair: &[(f64, f64)]| {
        let ((ax, ay), (bx, by)) = (pair[0], pair[1]);
        (0..100)
            .map(move |i| f64::from(i) / 100.0)
            .map(move |t| Point2::new(ax + (bx - ax) * t, ay + (by - ay) * t))
    };
    corners.windows(2).flat_map(side).collect()
}
