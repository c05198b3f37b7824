//! What the vacuum would see: rays at its height from below every key camera (paper III-B).

use super::cloud::{CloudPoint, PointCloud};
use super::fuse::KeyFrame;
use crate::geometry::{Point2, Pose2, Pose3, Vector2, Vector3};
use rustc_hash::{FxHashMap, FxHashSet};

/// How rays are cast.
#[derive(Debug, Clone, PartialEq)]
pub struct RaycastParams {
    /// Height of the vacuum's LiDAR above the floor; turrets are 7-12 cm, a bare sensor up to 15.
    pub vacuum_height_m: f64,
    /// Surface this far above and below counts as being at that height (the authors' slab).
    pub slab_m: f64,
    /// A surface whose normal leans at least this much towards the vertical is no obstacle.
    pub max_normal_z: f64,
    /// Rays in a full turn.
    pub rays: usize,
    /// Side of the columns in which the vertical extent of what stands is measured.
    pub column_m: f64,
    /// A column seen only above the slab counts as a wall down to the floor if at least this much of it
    /// was seen.
    pub min_upper_extent_m: f64,
    /// Surface above this is ceiling, lamps and beams.
    pub max_height_m: f64,
    /// Hits closer together than this are one.
    pub hit_spacing_m: f64,
    pub max_hits: usize,
    /// Longest ray.
    pub max_range_m: f64,
    /// Side of the cells in which free space is remembered.
    pub free_cell_m: f64,
}

impl Default for RaycastParams {
    fn default() -> Self {
        RaycastParams {
            vacuum_height_m: 0.12,
            slab_m: 0.10,
            max_normal_z: 0.6,
            rays: 720,
            column_m: 0.06,
            min_upper_extent_m: 0.35,
            max_height_m: 2.2,
            hit_spacing_m: 0.03,
            max_hits: 500,
            max_range_m: 8.0,
            free_cell_m: 0.05,
        }
    }
}

/// A first hit, in the clip frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub point_m: Point2,
    /// Unit length, towards the seen side.
    pub normal: Vector2,
    /// How much it counts as evidence, 0..1; [`super::weigh`] sets it.
    pub weight: f64,
    /// How much of the column through it was seen standing, bottom to top.
    pub extent_m: f64,
    /// Seen at the vacuum's height; otherwise only above, and projected down along gravity.
    pub at_vacuum_height: bool,
    /// Where the ray began.
    pub from_m: Point2,
}

/// The virtual scan of a clip, in the clip frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VirtualScan {
    pub hits: Vec<Hit>,
    /// Centres of cells that a reading of the camera passed through at the vacuum's height.
    pub free_m: Vec<Point2>,
    /// The key cameras, laid flat; the first is the identity by the definition of the clip frame.
    pub cameras: Vec<Pose2>,
}

/// Casts the rays.
pub fn raycast(
    cloud_in_clip: &PointCloud,
    key_frames: &[KeyFrame],
    clip_from_world: &Pose3,
    params: &RaycastParams,
) -> VirtualScan {
    let cameras: Vec<Pose2> =
        key_frames.iter().map(|k| lay_flat(&(clip_from_world * k.world_from_camera))).collect();
    let free_m = free_cells(key_frames, clip_from_world, params);
    let standing = Standing::new(cloud_in_clip, &free_m, params);
    let mut hits = FxHashMap::default();
    for camera in &cameras {
        standing.cast(&Point2::new(camera.x_m, camera.y_m), params, &mut hits);
    }
    let mut hits: Vec<(usize, Hit)> = hits.into_values().collect();
    hits.sort_by_key(|(index, _)| *index);
    let hits: Vec<Hit> = hits.into_iter().map(|(_, hit)| hit).collect();
    VirtualScan { hits: thin(hits, params.max_hits), free_m, cameras }
}

/// A camera's place and heading on the floor.
pub fn lay_flat(clip_from_camera: &Pose3) -> Pose2 {
    let heading = super::floor::heading(clip_from_camera, &Vector3::z());
    let at = clip_from_camera.translation.vector;
    Pose2::new(at.x, at.y, heading.y.atan2(heading.x))
}

/// What stands, as points on the floor plan that stop a ray.
struct Standing {
    points: Vec<Hit>,
    spacing_m: f64,
}

type Cell = [i32; 2];

fn cell_of(x: f64, y: f64, side_m: f64) -> Cell {
    [x, y].map(|c| (c / side_m).floor() as i32)
}

/// A cell and the eight around it.
fn around([x, y]: Cell) -> impl Iterator<Item = Cell> {
    (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| [x + dx, y + dy]))
}

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

impl Standing {
    fn new(cloud: &PointCloud, free_m: &[Point2], params: &RaycastParams) -> Standing {
        let upright = |p: &&CloudPoint| {
            f64::from(p.normal[2]).abs() <= params.max_normal_z
                && (0.0..params.max_height_m).contains(&f64::from(p.position_m[2]))
        };
        let in_slab = |z: f64| (z - params.vacuum_height_m).abs() <= params.slab_m;
        let mut columns: FxHashMap<Cell, Column> = FxHashMap::default();
        for point in cloud.points.iter().filter(upright) {
            let (at, normal) = (point.position(), point.normal());
            let column = columns.entry(cell_of(at.x, at.y, params.column_m)).or_insert_with(|| Column {
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
            let near = around(cell).filter_map(|c| columns.get(&c));
            let (low, high) = near.fold((f64::INFINITY, 0f64), |(l, h), c| (l.min(c.low_m), h.max(c.high_m)));
            (high - low).max(0.0)
        };
        let hit = |point_m: Point2, normal: Vector2, extent_m: f64, at_vacuum_height: bool| Hit {
            point_m,
            normal,
            weight: 1.0,
            extent_m,
            at_vacuum_height,
            from_m: Point2::origin(),
        };
        let mut points: Vec<Hit> = cloud
            .points
            .iter()
            .filter(upright)
            .filter(|p| in_slab(f64::from(p.position_m[2])))
            .map(|p| {
                let (at, n) = (p.position(), p.normal());
                let cell = cell_of(at.x, at.y, params.column_m);
                hit(at.xy(), n.xy().normalize(), extent(cell), true)
            })
            .collect();
        // A wall whose foot was not seen still stands on the floor, unless the floor was seen there.
        let free: FxHashSet<Cell> = free_m.iter().map(|p| cell_of(p.x, p.y, params.column_m)).collect();
        let mut upper: Vec<(Cell, Hit)> = columns
            .iter()
            .filter(|(cell, column)| {
                column.count >= 4
                    && column.high_m - column.low_m >= params.min_upper_extent_m
                    && !free.contains(*cell)
                    && around(**cell).all(|c| columns.get(&c).is_none_or(|near| !near.in_slab))
            })
            .filter_map(|(cell, column)| {
                let normal = column.normal_sum.try_normalize(0.5 * f64::from(column.count))?;
                let mean = column.point_sum / f64::from(column.count);
                Some((*cell, hit(Point2::from(mean), normal, extent(*cell), false)))
            })
            .collect();
        upper.sort_by_key(|(cell, _)| *cell);
        points.extend(upper.into_iter().map(|(_, hit)| hit));
        Standing { points, spacing_m: cloud.voxel_m.max(params.column_m * 0.5) }
    }

    /// Adds the first hits seen from one place. Keyed by cell, so that cameras do not repeat each other;
    /// the earliest camera that sees a cell keeps it.
    fn cast(&self, from: &Point2, params: &RaycastParams, hits: &mut FxHashMap<Cell, (usize, Hit)>) {
        use std::f64::consts::TAU;
        const NOTHING: (f32, u32) = (f32::INFINITY, u32::MAX);
        let mut nearest = vec![NOTHING; params.rays];
        let rays = params.rays as f64;
        for (index, standing) in self.points.iter().enumerate() {
            let offset = standing.point_m - from;
            let range_m = offset.norm();
            if range_m < 0.05 || range_m > params.max_range_m {
                continue;
            }
            // Neighbouring points of one surface shade without a gap between them.
            let half_width = (0.75 * self.spacing_m / range_m).atan() * rays / TAU;
            let middle = offset.y.atan2(offset.x).rem_euclid(TAU) * rays / TAU;
            let (first, last) = ((middle - half_width).ceil() as i64, (middle + half_width).floor() as i64);
            for ray in first..=last {
                let slot = &mut nearest[ray.rem_euclid(params.rays as i64) as usize];
                if (range_m as f32, index as u32) < *slot {
                    *slot = (range_m as f32, index as u32);
                }
            }
        }
        for (_, index) in nearest.into_iter().filter(|slot| *slot != NOTHING) {
            let standing = &self.points[index as usize];
            let cell = cell_of(standing.point_m.x, standing.point_m.y, params.hit_spacing_m);
            hits.entry(cell).or_insert((index as usize, Hit { from_m: *from, ..*standing }));
        }
    }
}

/// Keeps `most` hits that lie far from each other (farthest-point sampling), in their old order.
pub(super) fn thin(hits: Vec<Hit>, most: usize) -> Vec<Hit> {
    if hits.len() <= most {
        return hits;
    }
    let mut gap = vec![f64::INFINITY; hits.len()];
    let mut kept = vec![false; hits.len()];
    let mut next = 0;
    for _ in 0..most {
        kept[next] = true;
        gap[next] = -1.0;
        let chosen = hits[next].point_m;
        let mut farthest = (0, -1.0);
        for (i, hit) in hits.iter().enumerate() {
            gap[i] = gap[i].min((hit.point_m - chosen).norm_squared());
            if gap[i] > farthest.1 {
                farthest = (i, gap[i]);
            }
        }
        next = farthest.0;
    }
    hits.into_iter().zip(kept).filter(|(_, kept)| *kept).map(|(hit, _)| hit).collect()
}

/// Cells that the cameras' rays crossed near the vacuum's height on their way to what they hit.
fn free_cells(key_frames: &[KeyFrame], clip_from_world: &Pose3, params: &RaycastParams) -> Vec<Point2> {
    // Below half the height the floor's noise would count, above one and a half a low table would.
    let (low, high) = (0.5 * params.vacuum_height_m, 1.5 * params.vacuum_height_m);
    let cell_m = params.free_cell_m;
    let mut counts: FxHashMap<[i32; 2], u32> = FxHashMap::default();
    for key in key_frames {
        let clip_from_camera = clip_from_world * key.world_from_camera;
        let from = clip_from_camera.translation.vector;
        for point in key.readings.points_in_camera() {
            let to = (clip_from_camera * point).coords;
            // The share of the way at which the ray enters and leaves the layer; it must fall through it.
            if from.z <= high || to.z >= high {
                continue;
            }
            let at = |z: f64| (from.z - z) / (from.z - to.z);
            // Stop short of the hit: it is a surface, not free space.
            let short = 1.0 - 0.05 / (to - from).norm();
            let (enter, leave) = (at(high), at(low).min(short));
            if leave <= enter {
                continue;
            }
            let (a, b) = (from + (to - from) * enter, from + (to - from) * leave);
            let steps = ((b - a).xy().norm() / cell_m).ceil().max(1.0);
            let mut last = None;
            for step in 0..=steps as usize {
                let p = a + (b - a) * (step as f64 / steps);
                let cell = [p.x, p.y].map(|c| (c / cell_m).floor() as i32);
                if last != Some(cell) {
                    *counts.entry(cell).or_default() += 1;
                    last = Some(cell);
                }
            }
        }
    }
    // One ray may be a flying pixel at an edge.
    let mut cells: Vec<[i32; 2]> =
        counts.into_iter().filter(|(_, n)| *n >= 2).map(|(cell, _)| cell).collect();
    cells.sort_unstable();
    cells
        .into_iter()
        .map(|[x, y]| Point2::new((f64::from(x) + 0.5) * cell_m, (f64::from(y) + 0.5) * cell_m))
        .collect()
}
