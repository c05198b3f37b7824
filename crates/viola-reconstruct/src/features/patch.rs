//! The upright patch of a corner: its place, size and direction in the clip's frame.

use super::corners::Corner;
use crate::track::picture::Layer;
use nalgebra::Matrix3;
use viola_geometry::{Point3, Pose3, Vector3};

/// Side of a patch.
pub(super) const SIDE_M: f64 = 0.32;
/// Depth readings across the patch for the fit of its plane.
const READINGS: i32 = 9;
/// Minimum fraction of them with a depth, and maximum RMS residual of a plane, relative to the depth.
const MIN_READ_FRACTION: f64 = 0.6;
const FLAT: f64 = 0.015;
/// A plane is upright if its normal's z component is below this.
const UPRIGHT: f64 = 0.5;
/// Planes with a larger z component of the normal lie flat; they have no upright patch.
const LEVEL: f64 = 0.8;
/// Minimum cosine between the patch's direction and the ray to the camera.
const MIN_FACING: f64 = 0.35;

/// A square patch that stands upright.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patch {
    pub centre: Point3,
    /// Unit vectors to the right, seen from the front, and up.
    pub right: Vector3,
    pub up: Vector3,
    pub heading_rad: f64,
}

impl Patch {
    /// Returns the patch of a corner: it faces as the surface does if that is flat and upright, otherwise
    /// towards the camera. None for level surfaces and flat angles.
    pub fn around(layer: &Layer, corner: &Corner, clip_from_camera: &Pose3) -> Option<Patch> {
        let centre = clip_from_camera * layer.camera.unproject(corner.u, corner.v, corner.depth_m);
        let to_camera = clip_from_camera.translation.vector - centre.coords;
        let normal = normal(layer, corner).map(|normal| clip_from_camera * normal);
        let front = match normal {
            Some(normal) if normal.z.abs() > LEVEL => return None,
            Some(normal) if normal.z.abs() < UPRIGHT => normal,
            _ => to_camera,
        };
        let front = Vector3::new(front.x, front.y, 0.0).try_normalize(1e-6)?;
        if front.dot(&to_camera) < MIN_FACING * to_camera.norm() {
            return None;
        }
        let right = Vector3::z().cross(&front);
        Some(Patch { centre, right, up: Vector3::z(), heading_rad: front.y.atan2(front.x) })
    }
}

/// Returns the normal of the surface around a corner, towards the camera, in the camera's frame; none if it is
/// not flat. The inverse depth of a plane is linear in the picture.
fn normal(layer: &Layer, corner: &Corner) -> Option<Vector3> {
    let camera = &layer.camera;
    let (width, height) = (layer.width() as i64, layer.height() as i64);
    let half = SIDE_M / 2.0 * camera.fx / corner.depth_m;
    let mut readings: Vec<(Vector3, f64)> = Vec::new();
    for row in 0..READINGS {
        for column in 0..READINGS {
            let offset = |i: i32| (f64::from(2 * i) / f64::from(READINGS - 1) - 1.0) * half;
            let (x, y) =
                ((corner.u + offset(column)).round() as i64, (corner.v + offset(row)).round() as i64);
            if (0..width).contains(&x) && (0..height).contains(&y) {
                let depth_m = f64::from(layer.depth_m[(y * width + x) as usize]);
                if depth_m > 0.0 {
                    readings.push((camera.ray(x as f64, y as f64), depth_m));
                }
            }
        }
    }
    if (readings.len() as f64) < MIN_READ_FRACTION * f64::from(READINGS * READINGS) {
        return None;
    }
    let (mut squares, mut sums) = (Matrix3::zeros(), Vector3::zeros());
    for (ray, depth_m) in &readings {
        squares += ray * ray.transpose();
        sums += ray / *depth_m;
    }
    let plane = squares.cholesky()?.solve(&sums);
    let residual = |(ray, depth_m): &(Vector3, f64)| (plane.dot(ray) * depth_m - 1.0).powi(2);
    let mean = readings.iter().map(residual).sum::<f64>() / readings.len() as f64;
    (mean < FLAT * FLAT).then(|| -plane.normalize())
}
