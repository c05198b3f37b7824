//! Raster of the LiDAR map: free, wall or furniture.

use crate::map_point::MapPoint;
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::taxonomy::Class;
use viola_geometry::{DistanceField, Grid, GridFrame, Point2};
use viola_reconstruct::Label;

/// Side of the cells for a map without cells.
const CELL_M: f64 = 0.05;
/// Heights of the fused points that tell furniture from walls.
const HEIGHTS_M: [f64; 2] = [0.05, 1.9];

/// A bound on memory and time: larger maps get larger cells.
const MAX_CELLS: usize = 2 << 20;
/// Maximum distance to a bare point's cell that counts as wall; closes gaps up to twice this.
const GAP_M: f64 = 0.06;
/// Minimum number of the eight directions that end at a wall, for an enclosed cell.
const ENCLOSED: u32 = 7;
/// Radius of the fused points that count for a cell.
const NEAR_M: f64 = 0.08;

/// Minimum probability of a class that no picture showed.
const SURE_BY_SURFACE: f32 = 0.5;
/// Maximum height of low furniture: sofas, beds and worktops.
const LOW_M: f64 = 1.3;
/// Minimum number of points.
const FEW: u32 = 5;
/// Low furniture has at most one point above [`LOW_M`] for this many below.
const MUCH: u32 = 10;

/// One of this many points of the floor is a stray one on each side, and floor is at most this far beyond the
/// LiDAR map.
const STRAY: usize = 200;
const REACH_M: f64 = 10.0;

/// The raster. `frame` follows the LiDAR map's own raster if that is fine enough.
pub struct Space {
    pub frame: GridFrame,
    /// False for a map of bare points.
    pub has_cells: bool,
    pub occupied: Vec<bool>,
    /// Free cells of the robot; for bare points, the enclosed cells.
    pub free: Vec<bool>,
    /// Occupied cells with furniture and no wall in the fused map, by pictures.
    pub furniture: Vec<bool>,
    /// Cells that the robot does not know free, with furniture that is too low to hide a wall.
    pub low_furniture: Vec<bool>,
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
            has_cells: lidar.cells.is_some(),
            occupied: vec![false; frame.len()],
            free: vec![false; frame.len()],
            furniture: vec![false; frame.len()],
            low_furniture: vec![false; frame.len()],
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
        space.find_furniture_and_doors(points);
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

    /// Finds furniture and doors in the fused map.
    fn find_furniture_and_doors(&mut self, points: &[MapPoint]) {
        let mut counts = vec![Column::default(); self.frame.len()];
        for point in points {
            let [x, y, z] = point.point.position_m.map(f64::from);
            if let Some(at) =
                self.index(&Point2::new(x, y)).filter(|_| (HEIGHTS_M[0]..HEIGHTS_M[1]).contains(&z))
            {
                counts[at].add(point.point.label, z > LOW_M);
            }
        }
        let reach = (NEAR_M / self.frame.cell_m).round() as usize;
        let (width, height) = (self.frame.width, self.frame.height);
        for index in 0..counts.len() {
            self.door[index] = counts[index].is_door();
            if self.free[index] {
                continue;
            }
            let (x, y) = (index % width, index / width);
            let mut around = Column::default();
            for y in y.saturating_sub(reach)..(y + reach + 1).min(height) {
                for x in x.saturating_sub(reach)..(x + reach + 1).min(width) {
                    around.merge(&counts[y * width + x]);
                }
            }
            self.furniture[index] = self.occupied[index] && around.is_furniture();
            self.low_furniture[index] = around.is_low_furniture();
        }
    }
}

/// Numbers of fused points above a cell.
#[derive(Debug, Clone, Copy, Default)]
struct Column {
    wall: u32,
    door: u32,
    /// Of furniture in pictures, below and above [`LOW_M`].
    low: u32,
    tall: u32,
    /// Of furniture that no picture shows, and of what may be some: a wall may look like a wardrobe, but not like a sofa.
    low_unseen: u32,
    tall_unseen: u32,
}

impl Column {
    fn add(&mut self, label: Label, is_tall: bool) {
        let count = match label.class {
            Class::Floor | Class::Ceiling | Class::Rug => return,
            Class::Wall | Class::Window | Class::Picture | Class::Mirror | Class::Radiator => &mut self.wall,
            Class::Door => &mut self.door,
            _ if label.views == 0 && is_tall => &mut self.tall_unseen,
            _ if label.views == 0 && label.probability() < SURE_BY_SURFACE => return,
            Class::Curtain | Class::Other if label.views == 0 => return,
            Class::Curtain | Class::Other => &mut self.wall,
            _ if label.views == 0 => &mut self.low_unseen,
            _ if is_tall => &mut self.tall,
            _ => &mut self.low,
        };
        *count += 1;
    }

    fn merge(&mut self, other: &Column) {
        self.wall += other.wall;
        self.door += other.door;
        self.low += other.low;
        self.tall += other.tall;
        self.low_unseen += other.low_unseen;
        self.tall_unseen += other.tall_unseen;
    }

    /// Returns whether most of its points are of a door, which is upright: several points per column.
    fn is_door(&self) -> bool {
        self.door >= FEW && self.door > self.wall + self.low + self.tall
    }

    fn is_furniture(&self) -> bool {
        let furniture = self.low + self.tall;
        furniture >= FEW && furniture > 2 * (self.wall + self.door)
    }

    fn is_low_furniture(&self) -> bool {
        let low = self.low + self.low_unseen;
        low >= FEW && low > 2 * (self.wall + self.door) + MUCH * (self.tall + self.tall_unseen)
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

#[cfg(test)]
mod tests {
    use super::*;

    fn column(labels: &[(Class, u16, bool, usize)]) -> Column {
        let mut column = Column::default();
        for (class, views, is_tall, count) in labels {
            (0..*count).for_each(|_| column.add(Label::new(*class, 0.8, *views), *is_tall));
        }
        column
    }

    #[test]
    fn only_what_is_low_is_furniture_without_pictures() {
        use Class::{Cabinet, Sofa, Wall};
        // Points: class, views, above 1.3 m, how many. Furniture by pictures; low furniture.
        for (labels, want) in [
            (&[(Sofa, 0, false, 9)][..], (false, true)),
            (&[(Sofa, 3, false, 9)], (true, true)),
            (&[(Sofa, 0, false, 4)], (false, false)),
            (&[(Sofa, 0, false, 9), (Wall, 0, true, 9)], (false, false)),
            (&[(Cabinet, 0, false, 30), (Cabinet, 0, true, 30)], (false, false)),
            (&[(Cabinet, 3, false, 30), (Cabinet, 3, true, 30)], (true, false)),
            (&[(Sofa, 0, false, 30), (Cabinet, 0, true, 1)], (false, true)),
        ] {
            let column = column(labels);
            assert_eq!((column.is_furniture(), column.is_low_furniture()), want, "{labels:?}");
        }
        let mut unsure = Column::default();
        (0..9).for_each(|_| unsure.add(Label::new(Sofa, 0.4, 0), false));
        assert!(!unsure.is_low_furniture());
    }
}
