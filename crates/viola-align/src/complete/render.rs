//! Renders a fused surface from any camera: colour, depth, and holes.

use image::{GrayImage, Luma, Rgb, RgbImage};
use viola_geometry::{Pinhole, Pose3};
use viola_reconstruct::{CloudPoint, NO_COLOR};

/// Coverage of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cover {
    /// A surface that was seen from this side.
    Surface,
    /// The back of a surface: it hides the space behind it, and its look from here is unknown.
    Back,
    /// Nothing is known.
    Hole,
}

/// A picture of the surface.
#[derive(Debug, Clone)]
pub struct Rendering {
    pub camera: Pinhole,
    /// [`NO_COLOR`] without a surface's front, and for surface that no picture showed.
    pub color: RgbImage,
    /// Along the camera's axis, row by row; 0 in holes.
    pub depth_m: Vec<f32>,
    pub cover: Vec<Cover>,
}

impl Rendering {
    /// Returns 255 for pixels without a colour, 0 for others.
    pub fn mask(&self) -> GrayImage {
        let mut mask = GrayImage::new(self.camera.width, self.camera.height);
        for (pixel, color) in mask.pixels_mut().zip(self.color.pixels()) {
            *pixel = Luma([if color.0 == NO_COLOR { 255 } else { 0 }]);
        }
        mask
    }

    /// Returns the fraction of the pixels that show a surface's front, 0..1.
    pub fn covered(&self) -> f64 {
        let count = self.cover.iter().filter(|cover| **cover == Cover::Surface).count();
        count as f64 / self.cover.len().max(1) as f64
    }

    /// Returns the fraction of the pixels that have a colour, 0..1.
    pub fn colored(&self) -> f64 {
        let count = self.color.pixels().filter(|color| color.0 != NO_COLOR).count();
        count as f64 / self.cover.len().max(1) as f64
    }
}

/// Returns the first point of each voxel, so that no surface is drawn three times.
pub fn thin(points: &[CloudPoint], voxel_m: f64) -> Vec<CloudPoint> {
    let mut seen = rustc_hash::FxHashSet::default();
    let voxel = |p: &CloudPoint| p.position_m.map(|c| (f64::from(c) / voxel_m).floor() as i32);
    points.iter().filter(|p| seen.insert(voxel(p))).copied().collect()
}

/// Draws points as discs that lie in the surface, the nearest in front. A disc's diameter is 1.7 voxels, so
/// that a surface has no gaps and unseen parts stay holes.
pub fn render(points: &[CloudPoint], voxel_m: f64, camera: &Pinhole, clip_from_camera: &Pose3) -> Rendering {
    /// Nothing nearer is drawn.
    const NEAR_M: f32 = 0.1;
    /// Depth added with the distance from a disc's middle, so that neighbouring discs meet half way.
    const RIM: f32 = 0.2;
    const NOTHING: (f32, f32, u32) = (f32::INFINITY, 0.0, u32::MAX);
    let (width, height) = (camera.width as usize, camera.height as usize);
    let camera_from_clip = clip_from_camera.inverse();
    let rotation = camera_from_clip.rotation.to_rotation_matrix().into_inner().cast::<f32>();
    let offset = camera_from_clip.translation.vector.cast::<f32>();
    let [fx, fy, cx, cy] = [camera.fx, camera.fy, camera.cx, camera.cy].map(|value| value as f32);
    let radius_m = 0.85 * voxel_m as f32;
    let mut nearest = vec![NOTHING; width * height];
    for (index, point) in points.iter().enumerate() {
        let at = rotation * nalgebra::Vector3::from(point.position_m) + offset;
        if at.z < NEAR_M {
            continue;
        }
        let (u, v) = (fx * at.x / at.z + cx, fy * at.y / at.z + cy);
        let (ru, rv) = (fx * radius_m / at.z, fy * radius_m / at.z);
        let (left, right) = ((u - ru).ceil().max(0.0), (u + ru).floor().min(width as f32 - 1.0));
        let (top, bottom) = ((v - rv).ceil().max(0.0), (v + rv).floor().min(height as f32 - 1.0));
        if left > right || top > bottom {
            continue;
        }
        let normal = rotation * nalgebra::Vector3::from(point.normal);
        let distance = normal.dot(&at);
        for y in top as usize..=bottom as usize {
            let dy = (y as f32 - cy) / fy;
            for x in left as usize..=right as usize {
                let dx = (x as f32 - cx) / fx;
                let slope = normal.x * dx + normal.y * dy + normal.z;
                // A disc seen from its edge is drawn as if it faced the camera.
                let depth = if slope.abs() > 0.1 { distance / slope } else { at.z };
                let off = [dx * depth - at.x, dy * depth - at.y, depth - at.z];
                let off2 = off[0] * off[0] + off[1] * off[1] + off[2] * off[2];
                if off2 > radius_m * radius_m {
                    continue;
                }
                let rank = depth + RIM * off2.sqrt();
                let slot = &mut nearest[y * width + x];
                if rank < slot.0 {
                    *slot = (rank, depth, index as u32);
                }
            }
        }
    }
    let mut color = RgbImage::new(camera.width, camera.height);
    let mut depth_m = vec![0.0; width * height];
    let mut cover = vec![Cover::Hole; width * height];
    for (i, (_, depth, index)) in nearest.into_iter().enumerate().filter(|(_, slot)| slot.2 != u32::MAX) {
        let point = &points[index as usize];
        let (x, y) = (i % width, i / width);
        let normal = rotation * nalgebra::Vector3::from(point.normal);
        let ray = nalgebra::Vector3::new((x as f32 - cx) / fx, (y as f32 - cy) / fy, 1.0);
        depth_m[i] = depth;
        cover[i] = if normal.dot(&ray) < 0.0 { Cover::Surface } else { Cover::Back };
        if cover[i] == Cover::Surface {
            color.put_pixel(x as u32, y as u32, Rgb(point.color));
        }
    }
    Rendering { camera: *camera, color, depth_m, cover }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_reconstruct::cloud::BLACK;

    const VOXEL_M: f64 = 0.03;
    const CAMERA: Pinhole = Pinhole { width: 160, height: 120, fx: 140.0, fy: 140.0, cx: 79.5, cy: 59.5 };

    /// Returns a square of side 2 m across the view, facing the camera if `faces`; its hole is 0.6 m wide.
    fn square(depth_m: f64, faces: bool, hole: bool, color: [u8; 3]) -> Vec<CloudPoint> {
        let steps = (2.0 / VOXEL_M) as i32;
        let place = |i: i32| (f64::from(i) + 0.5) * VOXEL_M - 1.0;
        (0..steps * steps)
            .map(|i| (place(i % steps), place(i / steps)))
            .filter(|(x, y)| !hole || x.abs().max(y.abs()) > 0.3)
            .map(|(x, y)| [x as f32, y as f32, depth_m as f32])
            .map(|at| CloudPoint { color, ..CloudPoint::new(at, [0.0, 0.0, if faces { -1.0 } else { 1.0 }]) })
            .collect()
    }

    fn at(rendering: &Rendering, x: usize, y: usize) -> (Cover, f32, [u8; 3]) {
        let i = y * 160 + x;
        (rendering.cover[i], rendering.depth_m[i], rendering.color.get_pixel(x as u32, y as u32).0)
    }

    #[test]
    fn surfaces_are_closed_and_holes_stay() {
        let rendering = render(&square(2.0, true, true, [9, 8, 7]), VOXEL_M, &CAMERA, &Pose3::identity());
        assert_eq!(at(&rendering, 80, 60).0, Cover::Hole);
        for (x, y) in [(30, 60), (80, 20), (120, 90), (40, 40)] {
            let (cover, depth_m, color) = at(&rendering, x, y);
            assert_eq!((cover, color), (Cover::Surface, [9, 8, 7]), "{x} {y}");
            assert!((depth_m - 2.0).abs() < 0.01, "{depth_m}");
        }
        let hole = rendering.mask().pixels().filter(|p| p.0[0] == 255).count();
        let outside = 160 * 120 - 140 * 120;
        // The hole is 42 pixels wide, less the discs' rims.
        assert!((1200 + outside..=1764 + outside).contains(&hole), "{hole}");
    }

    /// A picture may have no pixel of a surface that the depth camera read.
    #[test]
    fn surface_without_a_colour_is_to_be_painted_and_black_surface_is_not() {
        for (color, painted) in [(NO_COLOR, 255), (BLACK, 0)] {
            let rendering = render(&square(2.0, true, false, color), VOXEL_M, &CAMERA, &Pose3::identity());
            assert_eq!(at(&rendering, 80, 60), (Cover::Surface, 2.0, color));
            assert_eq!(rendering.mask().get_pixel(80, 60).0, [painted], "{color:?}");
            assert_eq!(rendering.mask().get_pixel(0, 0).0, [255], "{color:?}");
            let colored = if painted == 0 { rendering.covered() } else { 0.0 };
            assert!(rendering.covered() > 0.7 && rendering.colored() == colored, "{color:?}");
        }
    }

    #[test]
    fn what_is_behind_a_back_is_not_seen() {
        let mut points = square(2.0, true, false, [1, 200, 1]);
        points.extend(square(1.0, false, true, [200, 1, 1]));
        let rendering = render(&points, VOXEL_M, &CAMERA, &Pose3::identity());
        let (cover, depth_m, color) = at(&rendering, 10, 60);
        assert_eq!((cover, color), (Cover::Back, [0; 3]));
        assert!((depth_m - 1.0).abs() < 0.01);
        assert_eq!(at(&rendering, 80, 60).0, Cover::Surface);
    }
}
