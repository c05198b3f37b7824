//! Rugs and stairs of the fused map: they are no objects with boxes, but areas.

use crate::assemble::Tile;
use crate::rooms::outline::{Outline, trace};
use viola_formats::lidar::LidarMap;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Grid, GridFrame, Point2};

/// Side of the cells; on larger maps they are larger.
const CELL_M: f64 = 0.05;
const MAX_CELLS: f64 = 4e6;
/// Width around the robot's map in which areas are looked for: stairs are beyond its edge.
const BEYOND_M: f64 = 1.0;
/// Minimum number of points of a cell.
const MIN_POINTS: u8 = 2;
/// Minimum area of a rug or a staircase.
const MIN_AREA_M2: f64 = 0.25;
/// Tolerance of a polygon to the border of its cells.
const TOLERANCE_M: f64 = 0.07;
/// A rug's points are below this.
const RUG_TOP_M: f64 = 0.08;

/// Counts of points that are labelled as rug or as stairs, from above.
pub struct Ground {
    rug: Grid<u8>,
    stairs: Grid<u8>,
}

impl Ground {
    /// Returns a raster around a level's LiDAR map, with the carpet that the robot detected.
    pub fn new(lidar: &LidarMap) -> Ground {
        let (min_m, max_m) = (lidar.info.min_m, lidar.info.max_m);
        let side = |axis: usize| max_m[axis] - min_m[axis] + 2.0 * BEYOND_M;
        let cell_m = CELL_M.max((side(0) * side(1) / MAX_CELLS).sqrt());
        let frame = GridFrame::covering(min_m, max_m, BEYOND_M, cell_m);
        let mut ground = Ground { rug: Grid::filled(frame, 0), stairs: Grid::filled(frame, 0) };
        ground.add_carpet(&lidar.carpet_m, lidar.info.cell_m.unwrap_or(CELL_M));
        ground
    }

    /// Adds the points of a tile.
    pub fn add(&mut self, tile: &Tile) {
        for point in tile.points.iter().map(|point| &point.point) {
            let [x, y, z] = point.position_m.map(f64::from);
            let grid = match point.label.class {
                Class::Rug if z < RUG_TOP_M => &mut self.rug,
                Class::Stairs => &mut self.stairs,
                _ => continue,
            };
            if let Some((x, y)) = grid.frame.cell(&Point2::new(x, y)) {
                let count = grid.get(x, y).saturating_add(1);
                grid.set(x, y, count);
            }
        }
    }

    fn add_carpet(&mut self, centres_m: &[Point2], cell_m: f64) {
        let frame = self.rug.frame;
        let half_m = cell_m / 2.0;
        for centre in centres_m {
            let low = frame.cell(&Point2::new(centre.x - half_m + 1e-6, centre.y - half_m + 1e-6));
            let high = frame.cell(&Point2::new(centre.x + half_m - 1e-6, centre.y + half_m - 1e-6));
            let (Some((left, bottom)), Some((right, top))) = (low, high) else { continue };
            for y in bottom..=top {
                for x in left..=right {
                    self.rug.set(x, y, MIN_POINTS);
                }
            }
        }
    }

    /// Returns the outlines of the rugs, the largest first.
    pub fn rugs(&self) -> Vec<Outline> {
        outlines(&self.rug)
    }

    /// Returns the outlines of the stairs, the largest first.
    pub fn stairs(&self) -> Vec<Outline> {
        outlines(&self.stairs)
    }
}

fn outlines(counts: &Grid<u8>) -> Vec<Outline> {
    let cells = counts.cells.iter().map(|count| *count >= MIN_POINTS).collect();
    let traced = trace(&Grid { frame: counts.frame, cells }).into_iter();
    let large = traced.filter(|outline| outline.outer_area_m2() >= MIN_AREA_M2);
    let mut outlines: Vec<Outline> = large.filter_map(|outline| outline.simplified(TOLERANCE_M)).collect();
    outlines.sort_by(|a, b| b.outer_area_m2().total_cmp(&a.outer_area_m2()));
    outlines
}
