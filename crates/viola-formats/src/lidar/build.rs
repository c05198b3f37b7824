//! Builds a checked [`LidarMap`] with its [`LidarInfo`] from the result of a format's reader.

use super::strays::drop_strays;
use super::{
    Cell, LidarError, LidarInfo, LidarMap, MAX_POINTS, MAX_SIDE_M, MapMarks, RobotFrames, Room, RoomInfo,
    UnknownYaw,
};
use std::collections::HashSet;
use viola_geometry::{Grid, GridFrame, Point2, Pose2};

/// A map of the greatest side is still readable where another origin rounds its corners otherwise.
const ROUNDING_M: f64 = 1e-6;

/// A map with a greater coordinate, in metres, is refused: files of points and meshes have 32-bit numbers, whose steps are
/// 8 mm there, and half a metre at the northing of a UTM zone.
pub const MAX_DISTANCE_M: f64 = 1e5;

/// The result of one format's reader.
#[derive(Default)]
pub(super) struct Parts {
    pub format: &'static str,
    pub frame: &'static str,
    pub occupied_m: Vec<Point2>,
    pub cells: Option<Grid<Cell>>,
    pub rooms: Vec<Room>,
    pub charger: Option<Pose2>,
    pub marks: MapMarks,
    pub carpet_m: Vec<Point2>,
    pub notes: Vec<String>,
}

/// Drops duplicate and stray points, refuses a map without points, larger than a home or far from its origin, and builds
/// its summary.
pub(super) fn build(mut parts: Parts) -> Result<LidarMap, LidarError> {
    if parts.occupied_m.len() > MAX_POINTS {
        return Err(LidarError::TooManyPoints { max: MAX_POINTS });
    }
    let all = parts.occupied_m.len();
    let mut seen = HashSet::with_capacity(all);
    // Adding zero makes -0 and 0 equal.
    parts.occupied_m.retain(|p| seen.insert(((p.x + 0.0).to_bits(), (p.y + 0.0).to_bits())));
    if parts.occupied_m.len() < all {
        parts
            .notes
            .push(format!("{} points that are there twice were dropped", all - parts.occupied_m.len()));
    }

    let strays = drop_strays(&mut parts.occupied_m, parts.cells.as_mut());
    if strays > 0 {
        parts.notes.push(format!("{strays} points far away from all others were dropped"));
    }
    if parts.occupied_m.is_empty() {
        return Err(LidarError::NoWalls);
    }
    parts.cells = parts.cells.map(crop);
    let mut bounds = Bounds::default();
    for point in &parts.occupied_m {
        bounds.add(point);
    }
    let mut free_cells = 0;
    if let Some(grid) = &parts.cells {
        let half_m = grid.frame.cell_m / 2.0;
        for y in 0..grid.frame.height {
            for x in 0..grid.frame.width {
                let cell = grid.get(x, y);
                if cell != Cell::Unknown {
                    let centre = grid.frame.centre(x, y);
                    bounds.add(&Point2::new(centre.x - half_m, centre.y - half_m));
                    bounds.add(&Point2::new(centre.x + half_m, centre.y + half_m));
                }
                free_cells += usize::from(cell == Cell::Free);
            }
        }
    }
    check_sides([0, 1].map(|axis| bounds.max_m[axis] - bounds.min_m[axis]))?;
    let Bounds { min_m, max_m } = bounds;
    if [min_m, max_m].iter().flatten().any(|coordinate| coordinate.abs() >= MAX_DISTANCE_M) {
        return Err(LidarError::FarFromOrigin { x_m: min_m[0], y_m: min_m[1], max_m: MAX_DISTANCE_M });
    }
    let cell_m = parts.cells.as_ref().map(|grid| grid.frame.cell_m);
    let cell_area_m2 = cell_m.map_or(0.0, |side| side * side);
    parts.marks.carpet_m2 = parts.carpet_m.len() as f64 * cell_area_m2;
    parts.marks.settle(&mut parts.notes);
    let info = LidarInfo {
        format: parts.format.to_string(),
        frame: parts.frame.to_string(),
        cell_m,
        occupied_points: parts.occupied_m.len(),
        free_cells,
        free_area_m2: free_cells as f64 * cell_area_m2,
        min_m,
        max_m,
        rooms: parts.rooms.iter().map(|room| describe(room, cell_area_m2)).collect(),
        charger: parts.charger,
        marks: parts.marks,
        notes: parts.notes,
    };
    let Parts { occupied_m, cells, rooms, charger, carpet_m, .. } = parts;
    Ok(LidarMap {
        info,
        occupied_m,
        cells,
        rooms,
        charger,
        carpet_m,
        frames: RobotFrames::default(),
        sheet_cm: None,
        unknown_yaw: UnknownYaw::default(),
    })
}

/// Refuses a map with a side longer than [`MAX_SIDE_M`].
pub(super) fn check_sides(sides_m: [f64; 2]) -> Result<(), LidarError> {
    let [width_m, height_m] = sides_m;
    if width_m.max(height_m) > MAX_SIDE_M + ROUNDING_M {
        return Err(LidarError::TooLarge { width_m, height_m, max_m: MAX_SIDE_M });
    }
    Ok(())
}

/// Returns the known part of a grid. A home fills about a tenth of a robot's sheet.
fn crop(grid: Grid<Cell>) -> Grid<Cell> {
    let GridFrame { origin_m, cell_m, width, height } = grid.frame;
    let (mut left, mut right, mut bottom, mut top) = (width, 0, height, 0);
    for (y, row) in grid.cells.chunks_exact(width.max(1)).enumerate() {
        let mut known = row.iter().enumerate().filter(|(_, cell)| **cell != Cell::Unknown).map(|(x, _)| x);
        if let Some(first) = known.next() {
            left = left.min(first);
            right = right.max(known.next_back().unwrap_or(first) + 1);
            bottom = bottom.min(y);
            top = y + 1;
        }
    }
    if left >= right || (right - left, top - bottom) == (width, height) {
        return grid;
    }
    let origin_m = [origin_m[0] + left as f64 * cell_m, origin_m[1] + bottom as f64 * cell_m];
    let frame = GridFrame { origin_m, cell_m, width: right - left, height: top - bottom };
    let rows = grid.cells.chunks_exact(width).skip(bottom).take(frame.height);
    Grid { frame, cells: rows.flat_map(|row| &row[left..right]).copied().collect() }
}

/// Returns the centres of the occupied cells, row by row from the bottom.
pub(super) fn occupied_centres(grid: &Grid<Cell>) -> Result<Vec<Point2>, LidarError> {
    let width = grid.frame.width;
    let occupied = || grid.cells.iter().enumerate().filter(|(_, cell)| **cell == Cell::Occupied);
    if occupied().count() > MAX_POINTS {
        return Err(LidarError::TooManyPoints { max: MAX_POINTS });
    }
    Ok(occupied().map(|(index, _)| grid.frame.centre(index % width, index / width)).collect())
}

fn describe(room: &Room, cell_area_m2: f64) -> RoomInfo {
    let count = room.cells_m.len().max(1) as f64;
    let sum = room.cells_m.iter().fold([0.0, 0.0], |sum, p| [sum[0] + p.x, sum[1] + p.y]);
    RoomInfo {
        id: room.id.clone(),
        name: room.name.clone(),
        material: room.material.clone(),
        area_m2: room.cells_m.len() as f64 * cell_area_m2,
        centre_m: [sum[0] / count, sum[1] / count],
    }
}

struct Bounds {
    min_m: [f64; 2],
    max_m: [f64; 2],
}

impl Default for Bounds {
    fn default() -> Self {
        Bounds { min_m: [f64::INFINITY; 2], max_m: [f64::NEG_INFINITY; 2] }
    }
}

impl Bounds {
    fn add(&mut self, point: &Point2) {
        for axis in 0..2 {
            self.min_m[axis] = self.min_m[axis].min(point[axis]);
            self.max_m[axis] = self.max_m[axis].max(point[axis]);
        }
    }
}
