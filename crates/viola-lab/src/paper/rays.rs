//! Virtual LiDAR hits: rays at the vacuum's height from below every key camera (paper III-B).

use viola_align::VACUUM_HEIGHT_M;
use viola_geometry::{Point2, Pose2, wrap_angle};
use viola_reconstruct::PointCloud;

/// Half height of the slab of points around the rays' height that rays can hit.
const SLAB_M: f64 = 0.10;
/// Points up to this height are floor, not hits. The paper identifies the floor by its labels.
const FLOOR_M: f64 = 0.05;
/// Rays of one camera, evenly over `FAN_RAD` about its heading; a ray ends at the nearest point within
/// `CONE_RAD` of it.
const RAYS: usize = 300;
const FAN_RAD: f64 = std::f64::consts::PI;
const CONE_RAD: f64 = 3f64.to_radians();

/// Returns the hits of all cameras, in the clip frame, without duplicates.
pub(super) fn cast(cloud_in_clip: &PointCloud, cameras: &[Pose2]) -> Vec<Point2> {
    let is_in_slab = |z_m: f64| z_m > FLOOR_M && (z_m - VACUUM_HEIGHT_M).abs() <= SLAB_M;
    let slab: Vec<Point2> = cloud_in_clip
        .points
        .iter()
        .filter(|p| is_in_slab(f64::from(p.position_m[2])))
        .map(|p| Point2::new(f64::from(p.position_m[0]), f64::from(p.position_m[1])))
        .collect();
    let mut is_hit = vec![false; slab.len()];
    for camera in cameras {
        for index in nearest_in_cones(&slab, camera).into_iter().flatten() {
            is_hit[index] = true;
        }
    }
    slab.into_iter().zip(is_hit).filter(|(_, is_hit)| *is_hit).map(|(point, _)| point).collect()
}

/// Returns the nearest point in the cone of each ray of one camera.
fn nearest_in_cones(slab: &[Point2], camera: &Pose2) -> Vec<Option<usize>> {
    let step_rad = FAN_RAD / (RAYS - 1) as f64;
    let clip_at = Point2::new(camera.x_m, camera.y_m);
    let mut nearest: Vec<(f64, Option<usize>)> = vec![(f64::INFINITY, None); RAYS];
    for (index, point) in slab.iter().enumerate() {
        let offset = point - clip_at;
        let range_m = offset.norm();
        let bearing_rad = wrap_angle(offset.y.atan2(offset.x) - camera.yaw_rad);
        let from_first_rad = bearing_rad + 0.5 * FAN_RAD;
        let first = ((from_first_rad - CONE_RAD) / step_rad).ceil().max(0.0) as usize;
        let last = ((from_first_rad + CONE_RAD) / step_rad).floor();
        if last < 0.0 {
            continue;
        }
        for slot in nearest.iter_mut().take(last as usize + 1).skip(first) {
            if range_m < slot.0 {
                *slot = (range_m, Some(index));
            }
        }
    }
    nearest.into_iter().map(|(_, index)| index).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::{CloudPoint, Label};

    fn cloud(points: &[[f32; 3]]) -> PointCloud {
        let points = points
            .iter()
            .map(|&position_m| CloudPoint {
                position_m,
                normal: [1.0, 0.0, 0.0],
                color: [0; 3],
                label: Label::NONE,
                weight: 1,
            })
            .collect();
        PointCloud { points, voxel_m: 0.02 }
    }

    #[test]
    fn the_nearest_in_the_slab_and_in_the_fan() {
        let cloud = cloud(&[
            [2.0, 0.0, 0.12],
            [1.0, 0.0, 0.12],  // occludes the first
            [0.5, 0.0, 0.50],  // above the slab
            [0.5, 0.0, 0.04],  // floor, though in the slab
            [-1.0, 0.1, 0.12], // behind the camera
            [0.0, 1.0, 0.20],  // at the edge of the fan
        ]);
        let hits = cast(&cloud, &[Pose2::IDENTITY]);
        assert_eq!(hits, [Point2::new(1.0, 0.0), Point2::new(0.0, 1.0)]);
        let turned = cast(&cloud, &[Pose2::new(0.0, 0.0, std::f64::consts::PI)]);
        assert_eq!(turned.len(), 2);
        assert_eq!(turned[0].x, -1.0, "{turned:?}");
    }
}
