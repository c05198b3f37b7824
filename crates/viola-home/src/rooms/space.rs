//! Raster of the LiDAR map: free, wall or furniture.

use crate::map_point::MapPoint;
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::taxonomy::Class;
use viola_geometry::{DistanceField, Grid, GridFrame, Point2};

/// Side of the cells for a map without cells.
const CELL_M: f64 = 0.05;
/// Heights of the fused points that classify occupied cells.
const HEIGHTS_M: [f64; 2] = [0.05, 1.9];

/// A bound on memory and time: larger maps get larger cells.
const MAX_CELLS: usize = 2 << 20;
/// Maximum distance to a bare point's cell that counts as wall; closes gaps up to twice this.
const GAP_M: f64 = 0.06;
/// Minimum number of the eight directions that end at a wall, for an enclosed cell.
const ENCLOSED: u32 = 7;
/// Radius of the fused points that classify an occupied cell.
const NEAR_M: f64 = 0.08;

/// One of this many points of the floor is a stray one on each side, and floor is at most this far beyond the
/// LiDAR map.
const STRAY: usize = 200;
const REACH_M: f64 = 10.0;

/// The raster. `frame` follows the LiDAR map's own raster if that is fine enough.
pub struct Space {
    pub frame: GridFrame,
    pub occupied: Vec<bool>,
    /// Free cells of the robot; for bare points, the enclosed cells.
    pub free: Vec<bool>,
    /// Occupied cells with furniture and no wall in the fused map.
    pub furniture: Vec<bool>,
    /// Cells with a door's leaf or frame in the fused map.
    pub door: Vec<bool>,
}

impl Space {
    pub fn new(lidar: &LidarMap, points: &[MapPoint]) -> Space {
        Space::within(frame(lidar.info.min_m, lidar.info.max_m, lidar), lidar, points)
    }

    /// Returns the raster of the LiDAR map and of the floor that clips saw beyond it.
    pub fn reaching(lidar: &LidarMap, points: &[MapPoint]) -> Space {
        let floor = points.iter().filter(|point| point.point.label.class == Class::Floor);
        let floor: Vec<[f64; 2]> =
            floor.map(|point| [0, 1].map(|axis| f64::from(point.point.position_m[axis]))).collect();
        let (mut min_m, mut max_m) = (lidar.info.min_m, lidar.info.max_m);
        for axis in 0..2 {
            let mut places: Vec<f64> = floor.iter().map(|p| p[axis]).collect();
            places.sort_by(f64::total_cmp);
            let beyond = places.len() / STRAY;
            if let Some((low, high)) =
                places.get(beyond).zip(places.get(places.len().saturating_sub(1 + beyond)))
            {
                min_m[axis] = min_m[axis].min(low.max(min_m[axis] - REACH_M));
                max_m[axis] = max_m[axis].max(high.min(max_m[axis] + REACH_M));
            }
        }
        Space::within(frame(min_m, max_m, lidar), lidar, points)
    }

    fn within(frame: GridFrame, lidar: &LidarMap, points: &[MapPoint]) -> Space {
        let mut space = Space {
            frame,
            occupied: vec![false; frame.len()],
            free: vec![false; frame.len()],
            furniture: vec![false; frame.len()],
            door: vec![false; frame.len()],
        };
        for point in &lidar.occupied_m {
            if let Some(at) = space.index(point) {
                space.occupied[at] = true;
            }
        }
        match &lidar.cells {
            Some(cells) => {
                for (index, _) in cells.cells.iter().enumerate().filter(|(_, c)| **c == Cell::Free) {
                    let centre = cells.frame.centre(index % cells.frame.width, index / cells.frame.width);
                    if let Some(at) = space.index(&centre) {
                        space.free[at] |= !space.occupied[at];
                    }
                }
            }
            None => space.enclose(),
        }
        space.tell(points);
        space
    }

    pub fn index(&self, point: &Point2) -> Option<usize> {
        self.frame.cell(point).map(|(x, y)| y * self.frame.width + x)
    }

    pub fn centre(&self, index: usize) -> Point2 {
        self.frame.centre(index % self.frame.width, index / self.frame.width)
    }

    /// Returns whether a cell is occupied and not known to be furniture.
    pub fn is_wall(&self, x: usize, y: usize) -> bool {
        let index = y * self.frame.width + x;
        self.occupied[index] && !self.furniture[index]
    }

    /// Sets the free cells of bare points: those with walls on almost all sides.
    fn enclose(&mut self) {
        let thin = Grid { frame: self.frame, cells: self.occupied.clone() };
        let field = DistanceField::new(&thin);
        let walls: Vec<bool> = field.grid().cells.iter().map(|d| f64::from(*d) <= GAP_M).collect();
        let (width, height) = (self.frame.width as i64, self.frame.height as i64);
        let mut hits = vec![0u8; walls.len()];
        // Each sweep propagates along directions whose earlier cells are already known.
        for forward in [true, false] {
            for back in [[-1, 0], [-1, -1], [0, -1], [1, -1]] {
                let mut seen = vec![false; walls.len()];
                for step in 0..walls.len() {
                    let index = if forward { step } else { walls.len() - 1 - step };
                    let sign = if forward { 1 } else { -1 };
                    let x = index as i64 % width + sign * back[0];
                    let y = index as i64 / width + sign * back[1];
                    if x >= 0 && y >= 0 && x < width && y < height {
                        let before = (y * width + x) as usize;
                        seen[index] = seen[before] || walls[before];
                    }
                    hits[index] += u8::from(seen[index]);
                }
            }
        }
        for (index, free) in self.free.iter_mut().enumerate() {
            *free = !self.occupied[index] && u32::from(hits[index]) >= ENCLOSED;
        }
    }

    /// Classifies occupied cells and doors by the fused map.
    fn tell(&mut self, points: &[MapPoint]) {
        let mut counts = vec![[0u16; 3]; self.frame.len()];
        for point in points {
            let [x, y, z] = point.point.position_m.map(f64::from);
            if !(HEIGHTS_M[0]..HEIGHTS_M[1]).contains(&z) {
                continue;
            }
            let label = point.point.label;
            let kind = match label.class {
                Class::Floor | Class::Ceiling | Class::Rug => continue,
                Class::Wall | Class::Window | Class::Picture | Class::Mirror | Class::Radiator => 0,
                Class::Door => 1,
                // Without views the class is unknown.
                _ if label.views == 0 => continue,
                Class::Curtain | Class::Other => 0,
                _ => 2,
            };
            if let Some(at) = self.index(&Point2::new(x, y)) {
                counts[at][kind] = counts[at][kind].saturating_add(1);
            }
        }
        let reach = (NEAR_M / self.frame.cell_m).round() as usize;
        let (width, height) = (self.frame.width, self.frame.height);
        for index in 0..counts.len() {
            // A door is upright: several points per column.
            self.door[index] =
                counts[index][1] >= 5 && counts[index][1] > counts[index][0] + counts[index][2];
            if !self.occupied[index] {
                continue;
            }
            let (x, y) = (index % width, index / width);
            let mut sums = [0u32; 3];
            for y in y.saturating_sub(reach)..(y + reach + 1).min(height) {
                for x in x.saturating_sub(reach)..(x + reach + 1).min(width) {
                    let cell = counts[y * width + x];
                    (0..3).for_each(|kind| sums[kind] += u32::from(cell[kind]));
                }
            }
            self.furniture[index] = sums[2] >= 5 && sums[2] > 2 * (sums[0] + sums[1]);
        }
    }
}

/// Returns the map's own raster with a margin, or a coarser one if that has too many cells.
fn frame(min: [f64; 2], max: [f64; 2], lidar: &LidarMap) -> GridFrame {
    const MARGIN: f64 = 4.0;
    let own = lidar.cells.as_ref().map(|cells| cells.frame);
    let mut cell_m = own.map_or(CELL_M, |own| own.cell_m).max(CELL_M / 2.5);
    let count = |cell_m: f64| {
        let side = |axis: usize| (max[axis] - min[axis]) / cell_m + 2.0 * MARGIN + 1.0;
        side(0) * side(1)
    };
    let most = MAX_CELLS as f64;
    let mut same = own.is_some_and(|own| (own.cell_m - cell_m).abs() < 1e-12);
    if count(cell_m) > most {
        same = false;
        while count(cell_m) > most {
            cell_m *= 1.25;
        }
    }
    let frame = GridFrame::covering(min, max, MARGIN * cell_m, cell_m);
    match own.filter(|_| same) {
        // Align the cell borders with the map's.
        Some(own) => {
            let snap = |axis: usize| {
                let cells = ((frame.origin_m[axis] - own.origin_m[axis]) / cell_m).floor();
                own.origin_m[axis] + cells * cell_m
            };
            GridFrame {
                origin_m: [snap(0), snap(1)],
                width: frame.width + 1,
                height: frame.height + 1,
                ..frame
            }
        }
        None => frame,
    }
}
