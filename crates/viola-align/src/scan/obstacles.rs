//! Obstacles on the floor plan that stop a ray at the vacuum's height.

use super::hit::{FREE_CELL_M, HIT_SPACING_M, Hit, MAX_HEIGHT_M, RaycastParams};
use rustc_hash::{FxHashMap, FxHashSet};
use viola_geometry::{Point2, Vector2, cell_of, cells_around};
use viola_reconstruct::{CloudPoint, PointCloud};

/// Surface up to this far above and below counts as being at that height (the authors' slab).
const SLAB_M: f64 = 0.10;
/// Maximum vertical component of an obstacle's normal.
const MAX_NORMAL_Z: f64 = 0.6;
/// Rays in a full turn.
const RAYS: usize = 720;
/// Side of the columns in which the vertical extent of obstacles is measured.
const COLUMN_M: f64 = 0.06;
/// Minimum seen extent of a column above the slab that counts as a wall down to the floor.
const MIN_UPPER_EXTENT_M: f64 = 0.35;
/// Maximum length of a ray.
const MAX_RANGE_M: f64 = 8.0;

/// Obstacles, as points on the floor plan that stop a ray.
pub(super) struct Obstacles {
    points: Vec<Hit>,
    spacing_m: f64,
}

pub(super) type Cell = [i32; 2];

/// The vertical surface above one cell of the floor plan.
#[derive(Default)]
struct Column {
    low_m: f64,
    high_m: f64,
    in_slab: bool,
    count: u32,
    point_sum: Vector2,
    normal_sum: Vector2,
}

fn is_upright(point: &CloudPoint) -> bool {
    f64::from(point.normal[2]).abs() <= MAX_NORMAL_Z
}

/// Returns the surface that can stop a ray, whatever the vacuum's height.
pub fn upright(mut cloud: PointCloud) -> PointCloud {
    cloud.points.retain(is_upright);
    cloud
}

impl Obstacles {
    pub(super) fn new(cloud: &PointCloud, free_m: &[Point2], params: &RaycastParams) -> Obstacles {
        let upright = |p: &&CloudPoint| {
            is_upright(p) && (0.0..MAX_HEIGHT_M).contains(&(f64::from(p.position_m[2]) - params.floor_m))
        };
        let in_slab = |z: f64| (z - params.vacuum_height_m).abs() <= SLAB_M;
        let mut columns: FxHashMap<Cell, Column> = FxHashMap::default();
        for point in cloud.points.iter().filter(upright) {
            let (at, normal) = (point.position(), point.normal());
            let column = columns.entry(cell_of(&at.xy(), COLUMN_M)).or_insert_with(|| Column {
                low_m: at.z,
                high_m: at.z,
                ..Column::default()
            });
            column.low_m = column.low_m.min(at.z);
            column.high_m = column.high_m.max(at.z);
            column.in_slab |= in_slab(at.z);
            column.count += 1;
            column.point_sum += at.coords.xy();
            column.normal_sum += normal.xy();
        }
        let extent = |cell: Cell| -> f64 {
            let near = cells_around(cell).filter_map(|c| columns.get(&c));
            let (low, high) =
                near.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c.low_m), h.max(c.high_m)));
            (high - low).max(0.0)
        };
        let hit = |point_m: Point2, normal: Vector2, extent_m: f64, at_vacuum_height: bool| Hit {
            extent_m,
            at_vacuum_height,
            ..Hit::standing(point_m, normal)
        };
        let mut points: Vec<Hit> = cloud
            .points
            .iter()
            .filter(upright)
            .filter(|p| in_slab(f64::from(p.position_m[2])))
            .map(|p| {
                let (at, n) = (p.position(), p.normal());
                hit(at.xy(), n.xy().normalize(), extent(cell_of(&at.xy(), COLUMN_M)), true)
            })
            .collect();
        // A wall whose foot was not seen still stands on the floor, unless the floor was seen there.
        let free: FxHashSet<Cell> = free_m.iter().map(|p| cell_of(p, COLUMN_M)).collect();
        let mut upper: Vec<(Cell, Hit)> = columns
            .iter()
            .filter(|(cell, column)| {
                column.count >= 4
                    && column.high_m - column.low_m >= MIN_UPPER_EXTENT_M
                    && !free.contains(*cell)
                    && cells_around(**cell).all(|c| columns.get(&c).is_none_or(|near| !near.in_slab))
            })
            .filter_map(|(cell, column)| {
                let normal = column.normal_sum.try_normalize(0.5 * f64::from(column.count))?;
                let mean = column.point_sum / f64::from(column.count);
                Some((*cell, hit(Point2::from(mean), normal, extent(*cell), false)))
            })
            .collect();
        upper.sort_by_key(|(cell, _)| *cell);
        points.extend(upper.into_iter().map(|(_, hit)| hit));
        Obstacles { points, spacing_m: cloud.voxel_m.max(COLUMN_M * 0.5) }
    }

    /// Adds completed obstacles, except where the clip saw free floor or an obstacle itself.
    pub(super) fn add_completed(&mut self, completed: Obstacles, free_m: &[Point2]) {
        let free_cell = |p: &Point2| cell_of(p, FREE_CELL_M);
        let free: FxHashSet<Cell> = free_m.iter().map(free_cell).collect();
        let column = |p: &Point2| cell_of(p, COLUMN_M);
        let seen: FxHashSet<Cell> =
            self.points.iter().flat_map(|hit| cells_around(column(&hit.point_m))).collect();
        let is_new =
            |hit: &Hit| !free.contains(&free_cell(&hit.point_m)) && !seen.contains(&column(&hit.point_m));
        let new = completed.points.into_iter().filter(is_new);
        self.points.extend(new.map(|hit| Hit { completed: true, ..hit }));
    }

    /// Adds the first hits seen from one place. Keyed by cell, so that cameras do not repeat each other;
    /// the earliest camera that sees a cell keeps it.
    pub(super) fn cast(&self, from: &Point2, hits: &mut FxHashMap<Cell, (usize, Hit)>) {
        use std::f64::consts::TAU;
        const NOTHING: (f32, u32) = (f32::INFINITY, u32::MAX);
        let mut nearest = vec![NOTHING; RAYS];
        let rays = RAYS as f64;
        for (index, standing) in self.points.iter().enumerate() {
            let offset = standing.point_m - from;
            let range_m = offset.norm();
            if !(0.05..=MAX_RANGE_M).contains(&range_m) {
                continue;
            }
            // Neighbouring points of one surface shade without a gap between them.
            let half_width = (0.75 * self.spacing_m / range_m).atan() * rays / TAU;
            let middle = offset.y.atan2(offset.x).rem_euclid(TAU) * rays / TAU;
            let (first, last) = ((middle - half_width).ceil() as i64, (middle + half_width).floor() as i64);
            for ray in first..=last {
                let slot = &mut nearest[ray.rem_euclid(RAYS as i64) as usize];
                if (range_m as f32, index as u32) < *slot {
                    *slot = (range_m as f32, index as u32);
                }
            }
        }
        for (_, index) in nearest.into_iter().filter(|slot| *slot != NOTHING) {
            let standing = &self.points[index as usize];
            let cell = cell_of(&standing.point_m, HIT_SPACING_M);
            hits.entry(cell).or_insert((index as usize, Hit { from_m: *from, ..*standing }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::VACUUM_HEIGHT_M;

    #[test]
    fn the_extent_of_an_obstacle_is_the_same_above_a_floor_below_the_first_one() {
        for floor_m in [0.0, -0.65] {
            let point =
                |height_m: f64| CloudPoint::new([1.0, 0.0, (floor_m + height_m) as f32], [-1.0, 0.0, 0.0]);
            let cloud = PointCloud { points: [0.05, 0.15, 0.25].map(point).to_vec(), voxel_m: 0.03 };
            let params = RaycastParams { vacuum_height_m: floor_m + VACUUM_HEIGHT_M, floor_m };
            let obstacles = Obstacles::new(&cloud, &[], &params);
            let extent_m = obstacles.points[0].extent_m;
            assert!((extent_m - 0.2).abs() < 1e-6, "{floor_m} {extent_m}");
        }
    }
}
