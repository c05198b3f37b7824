//! The virtual scan: rays at the vacuum's height from below every key camera (paper III-B).

use super::free::free_cells;
use super::hit::{Hit, RaycastParams};
use super::landmarks::{Landmark, landmarks};
use super::obstacles::Obstacles;
use rustc_hash::FxHashMap;
use viola_geometry::{Point2, Pose2, Pose3, Vector3};
use viola_reconstruct::{KeyFrame, PointCloud};

/// Maximum number of hits of a scan.
pub const MAX_HITS: usize = 500;

/// The virtual scan of a clip, in the clip frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VirtualScan {
    pub hits: Vec<Hit>,
    /// Centres of the cells that the camera's readings passed through at the vacuum's height.
    pub free_m: Vec<Point2>,
    /// The key cameras on the floor plan; the first is the identity by the definition of the clip frame.
    pub cameras: Vec<Pose2>,
    /// Objects in the pictures that belong in some rooms and not in others.
    pub landmarks: Vec<Landmark>,
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
    let obstacles = Obstacles::new(cloud_in_clip, &free_m, params);
    let landmarks = landmarks(cloud_in_clip, &cameras, params);
    VirtualScan { hits: cast(&obstacles, &cameras), free_m, cameras, landmarks }
}

/// Casts the rays of a scan again, with completed points beside the observed ones. `observed_in_clip` is the
/// cloud that the scan was cast in, with the floor at 0.
pub fn recast(
    scan: &VirtualScan,
    observed_in_clip: &PointCloud,
    completed_in_clip: &PointCloud,
    params: &RaycastParams,
) -> VirtualScan {
    let mut obstacles = Obstacles::new(observed_in_clip, &scan.free_m, params);
    obstacles.add_completed(Obstacles::new(completed_in_clip, &scan.free_m, params), &scan.free_m);
    VirtualScan { hits: cast(&obstacles, &scan.cameras), ..scan.clone() }
}

fn cast(obstacles: &Obstacles, cameras: &[Pose2]) -> Vec<Hit> {
    let mut hits = FxHashMap::default();
    for camera in cameras {
        obstacles.cast(&Point2::new(camera.x_m, camera.y_m), &mut hits);
    }
    let mut hits: Vec<(usize, Hit)> = hits.into_values().collect();
    hits.sort_by_key(|(index, _)| *index);
    thin(hits.into_iter().map(|(_, hit)| hit).collect(), MAX_HITS)
}

/// Returns a camera's position and heading on the floor.
pub fn lay_flat(clip_from_camera: &Pose3) -> Pose2 {
    let heading = viola_reconstruct::heading(clip_from_camera, &Vector3::z());
    let at = clip_from_camera.translation.vector;
    Pose2::new(at.x, at.y, heading.y.atan2(heading.x))
}

/// Keeps `most` hits that lie far from each other (farthest-point sampling), in their original order.
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
