//! The pinhole camera.

use super::{Point3, Vector3};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// A pinhole camera without distortion: x right, y down, z forward. Pixel centres are at integer
/// coordinates, so `(0, 0)` is the centre of the first pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pinhole {
    pub width: u32,
    pub height: u32,
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
}

impl Pinhole {
    /// Returns the pixel of a point, or `None` if the point is not in front of the camera. The pixel may lie
    /// outside the picture.
    pub fn project(&self, point_in_camera: &Point3) -> Option<Point2<f64>> {
        if point_in_camera.z <= 1e-6 {
            return None;
        }
        Some(Point2::new(
            self.fx * point_in_camera.x / point_in_camera.z + self.cx,
            self.fy * point_in_camera.y / point_in_camera.z + self.cy,
        ))
    }

    /// Returns the point at `depth_m` along z on the ray of pixel `(u, v)`.
    pub fn unproject(&self, u: f64, v: f64, depth_m: f64) -> Point3 {
        Point3::from(self.ray(u, v) * depth_m)
    }

    /// Returns the viewing direction of pixel `(u, v)`, scaled to z = 1.
    pub fn ray(&self, u: f64, v: f64) -> Vector3 {
        Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0)
    }

    /// Returns the camera with its picture resized to `width` x `height`.
    pub fn resized(&self, width: u32, height: u32) -> Pinhole {
        let (sx, sy) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Pinhole {
            width,
            height,
            fx: self.fx * sx,
            fy: self.fy * sy,
            // The corner of the picture is fixed; the first pixel's centre is half a pixel from it.
            cx: (self.cx + 0.5) * sx - 0.5,
            cy: (self.cy + 0.5) * sy - 0.5,
        }
    }

    /// Returns whether the intrinsics are plausible: focal lengths of 0.05 to 50 picture sizes, and a
    /// principal point at most one picture size outside the picture.
    pub fn is_plausible(&self) -> bool {
        let size = f64::from(self.width.max(self.height));
        let focal = |f: f64| f.is_finite() && f > 0.05 * size && f < 50.0 * size;
        let centre = |c: f64, n: u32| c.is_finite() && c > -f64::from(n) && c < 2.0 * f64::from(n);
        self.width > 0
            && self.height > 0
            && focal(self.fx)
            && focal(self.fy)
            && centre(self.cx, self.width)
            && centre(self.cy, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CAMERA: Pinhole = Pinhole { width: 640, height: 480, fx: 577.6, fy: 578.7, cx: 318.9, cy: 242.7 };

    proptest! {
        #[test]
        fn project_undoes_unproject(u in -100.0..700.0f64, v in -100.0..600.0f64, depth in 0.1..10.0f64) {
            let pixel = CAMERA.project(&CAMERA.unproject(u, v, depth)).unwrap();
            prop_assert!((pixel.x - u).abs() < 1e-9 && (pixel.y - v).abs() < 1e-9);
        }

        #[test]
        fn resizing_keeps_rays(u in 0.0..640.0f64, v in 0.0..480.0f64) {
            let half = CAMERA.resized(320, 240);
            let ray = half.ray((u + 0.5) / 2.0 - 0.5, (v + 0.5) / 2.0 - 0.5);
            prop_assert!((ray - CAMERA.ray(u, v)).norm() < 1e-12);
        }
    }

    #[test]
    fn points_behind_are_not_seen() {
        assert_eq!(CAMERA.project(&Point3::new(0.0, 0.0, -1.0)), None);
        assert!(CAMERA.is_plausible());
        assert!(!Pinhole { fx: f64::NAN, ..CAMERA }.is_plausible());
        assert!(!Pinhole { width: 0, ..CAMERA }.is_plausible());
    }
}
