//! Depth pictures of a point cloud, as a camera at each pose would see it.

use super::DepthImage;
use viola_geometry::{Pinhole, Point3, Pose3};

/// Pixels along a side of the blocks in which near points hide far ones: 5 cm at a distance of 1 m with the cameras of
/// point clouds. Sparser surfaces are seen through.
const BLOCK: usize = 8;
/// A point is hidden if it is further away than the nearest one of its block by more than this factor. Floors that are
/// seen at a small angle change their depth by up to a fifth in a block.
const HIDDEN: f32 = 1.2;

/// Points in the world of a clip's poses and in their unit.
#[derive(Debug, Default)]
pub(super) struct Cloud {
    pub points: Vec<[f32; 3]>,
}

impl Cloud {
    /// Returns the depth of the nearest point in each pixel, in the unit of the points; 0 without one.
    pub fn depth(&self, camera: &Pinhole, world_from_camera: &Pose3) -> DepthImage {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let camera_from_world = world_from_camera.inverse();
        let blocks_wide = width.div_ceil(BLOCK);
        let mut nearest = vec![f32::INFINITY; width * height];
        let mut nearest_of_block = vec![f32::INFINITY; blocks_wide * height.div_ceil(BLOCK)];
        for point in &self.points {
            let point = camera_from_world * Point3::from(point.map(f64::from));
            let Some(pixel) = camera.project(&point) else { continue };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            if u < 0.0 || v < 0.0 || u >= width as f64 || v >= height as f64 {
                continue;
            }
            let (u, v, depth) = (u as usize, v as usize, point.z as f32);
            let block = v / BLOCK * blocks_wide + u / BLOCK;
            nearest[v * width + u] = nearest[v * width + u].min(depth);
            nearest_of_block[block] = nearest_of_block[block].min(depth);
        }
        let is_seen = |(pixel, depth): (usize, f32)| {
            let block = pixel / width / BLOCK * blocks_wide + pixel % width / BLOCK;
            if depth <= HIDDEN * nearest_of_block[block] && depth.is_finite() { depth } else { 0.0 }
        };
        let depth_m = nearest.into_iter().enumerate().map(is_seen).collect();
        DepthImage { width: camera.width, height: camera.height, depth_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::Vector3;

    const CAMERA: Pinhole = Pinhole { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };

    /// Returns a square upright wall at z, with points every 2 cm.
    fn wall(z: f32, half_width: f32) -> impl Iterator<Item = [f32; 3]> {
        let steps = (half_width / 0.02) as i32;
        let at = |i: i32| i as f32 * 0.02;
        (-steps..=steps).flat_map(move |i| (-steps..=steps).map(move |j| [at(i), at(j), z]))
    }

    #[test]
    fn near_points_hide_far_ones_and_points_behind_the_camera_are_not_seen() {
        let cloud = Cloud { points: wall(4.0, 4.0).chain(wall(1.5, 0.3)).chain(wall(-1.0, 1.0)).collect() };
        let depth = cloud.depth(&CAMERA, &Pose3::identity());
        assert_eq!(depth.at(31, 23), 1.5);
        assert_eq!(depth.at(2, 2), 4.0);
        let seen = |wanted: f32| depth.depth_m.iter().filter(|depth| **depth == wanted).count();
        assert_eq!(seen(1.5) + seen(4.0) + seen(0.0), 64 * 48);
        assert!(seen(1.5) > 500 && seen(4.0) > 1500, "{} {}", seen(1.5), seen(4.0));
    }

    #[test]
    fn the_camera_moves() {
        let cloud = Cloud { points: wall(4.0, 4.0).collect() };
        let nearer = Pose3::from_parts(Vector3::new(0.0, 0.0, 1.0).into(), Default::default());
        assert_eq!(cloud.depth(&CAMERA, &nearer).at(31, 23), 3.0);
        let away = Pose3::rotation(Vector3::new(0.0, std::f64::consts::PI, 0.0));
        assert!(cloud.depth(&CAMERA, &away).depth_m.iter().all(|depth| *depth == 0.0));
    }
}
