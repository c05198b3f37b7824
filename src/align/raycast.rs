//! What the vacuum would see: rays at its height from below every key camera (paper III-B).

use super::cloud::PointCloud;
use super::free::free_cells;
use super::fuse::KeyFrame;
use super::standing::Standing;
use super::things::{Thing, things};
use crate::geometry::{Point2, Pose2, Pose3, Vector2, Vector3};
use rustc_hash::FxHashMap;

/// How rays are cast.
#[derive(Debug, Clone, PartialEq)]
pub struct RaycastParams {
    /// Height of the vacuum's LiDAR above the floor; turrets are 7-12 cm, a bare sensor up to 15.
    pub vacuum_height_m: f64,
    /// Height of the floor in the clip frame: 0, unless another floor is tried.
    pub floor_m: f64,
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
            floor_m: 0.0,
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
    /// Not seen but filled in by [`super::complete`].
    pub completed: bool,
    /// Where the ray began.
    pub from_m: Point2,
}

#[cfg(test)]
impl Hit {
    /// On a wall, seen from the origin, that counts in full.
    pub(super) fn standing(point_m: Point2, normal: Vector2) -> Hit {
        Hit {
            point_m,
            normal,
            weight: 1.0,
            extent_m: 1.0,
            at_vacuum_height: true,
            completed: false,
            from_m: Point2::origin(),
        }
    }
}

/// The virtual scan of a clip, in the clip frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VirtualScan {
    pub hits: Vec<Hit>,
    /// Centres of cells that a reading of the camera passed through at the vacuum's height.
    pub free_m: Vec<Point2>,
    /// The key cameras, laid flat; the first is the identity by the definition of the clip frame.
    pub cameras: Vec<Pose2>,
    /// What pictures show that belongs into some rooms and not into others.
    pub things: Vec<Thing>,
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
    let things = things(cloud_in_clip, &cameras, params);
    VirtualScan { hits: cast(&standing, &cameras, params), free_m, cameras, things }
}

/// Casts the rays of a scan again, with what was filled in beside what was seen. `observed_in_clip` is the cloud
/// that the scan was cast in, with the floor at 0.
pub fn recast(
    scan: &VirtualScan,
    observed_in_clip: &PointCloud,
    completed_in_clip: &PointCloud,
    params: &RaycastParams,
) -> VirtualScan {
    let mut standing = Standing::new(observed_in_clip, &scan.free_m, params);
    standing.add_completed(Standing::new(completed_in_clip, &scan.free_m, params), &scan.free_m, params);
    VirtualScan { hits: cast(&standing, &scan.cameras, params), ..scan.clone() }
}

fn cast(standing: &Standing, cameras: &[Pose2], params: &RaycastParams) -> Vec<Hit> {
    let mut hits = FxHashMap::default();
    for camera in cameras {
        standing.cast(&Point2::new(camera.x_m, camera.y_m), params, &mut hits);
    }
    let mut hits: Vec<(usize, Hit)> = hits.into_values().collect();
    hits.sort_by_key(|(index, _)| *index);
    thin(hits.into_iter().map(|(_, hit)| hit).collect(), params.max_hits)
}

/// A camera's place and heading on the floor.
pub fn lay_flat(clip_from_camera: &Pose3) -> Pose2 {
    let heading = super::floor::heading(clip_from_camera, &Vector3::z());
    let at = clip_from_camera.translation.vector;
    Pose2::new(at.x, at.y, heading.y.atan2(heading.x))
}

/// Keeps `most` hits that lie far from each other (farthest-point sampling), in their old order.
fn thin(hits: Vec<Hit>, most: usize) -> Vec<Hit> {
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
