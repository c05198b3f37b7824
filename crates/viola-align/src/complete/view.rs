//! A virtual camera.

use nalgebra::{Rotation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use viola_geometry::{Pinhole, Point3, Pose3, Vector3};
use viola_reconstruct::KeyFrame;

/// A camera without roll, in the clip frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Position.
    pub eye_m: [f64; 3],
    /// Heading: 0 looks along x, a quarter turn along y.
    pub yaw_rad: f64,
    /// Downward tilt.
    pub pitch_rad: f64,
}

/// Size of the completed pictures, in pixels.
const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;

impl View {
    /// Returns the pose of a key camera, without its roll.
    pub fn of(key: &KeyFrame, clip_from_world: &Pose3) -> View {
        let clip_from_camera = clip_from_world * key.world_from_camera;
        let forward = clip_from_camera.rotation * Vector3::z();
        let heading = viola_reconstruct::heading(&clip_from_camera, &Vector3::z());
        View {
            eye_m: clip_from_camera.translation.vector.into(),
            yaw_rad: heading.y.atan2(heading.x),
            pitch_rad: (-forward.z).clamp(-1.0, 1.0).asin(),
        }
    }

    pub fn forward(&self) -> Vector3 {
        let (sin_yaw, cos_yaw) = self.yaw_rad.sin_cos();
        let (sin, cos) = self.pitch_rad.sin_cos();
        Vector3::new(cos * cos_yaw, cos * sin_yaw, -sin)
    }

    pub fn eye(&self) -> Point3 {
        Point3::from(self.eye_m)
    }

    pub fn clip_from_camera(&self) -> Pose3 {
        let forward = self.forward();
        let right = Vector3::new(self.yaw_rad.sin(), -self.yaw_rad.cos(), 0.0);
        let down = forward.cross(&right);
        let rotation = Rotation3::from_basis_unchecked(&[right, down, forward]);
        Pose3::from_parts(self.eye().into(), UnitQuaternion::from_rotation_matrix(&rotation))
    }

    /// Returns the view, moved back along its axis.
    pub fn back(&self, distance_m: f64) -> View {
        View { eye_m: (self.eye() - self.forward() * distance_m).into(), ..*self }
    }

    /// Returns the view, turned about the vertical, to the left.
    pub fn turned(&self, angle_rad: f64) -> View {
        View { yaw_rad: self.yaw_rad + angle_rad, ..*self }
    }

    /// Returns the view, turned and tilted just enough to bring a point into its picture, a tenth of it from
    /// the edge.
    pub fn towards(&self, point: &Point3, camera: &Pinhole) -> View {
        let offset = point - self.eye();
        let yaw_rad = offset.y.atan2(offset.x);
        let pitch_rad = (-offset.z).atan2(offset.xy().norm());
        let reach = |size: u32| (0.8 * 0.5 * f64::from(size) / camera.fx).atan();
        let (wide, high) = (reach(camera.width), reach(camera.height));
        let turn = (self.yaw_rad - yaw_rad + PI).rem_euclid(TAU) - PI;
        View {
            yaw_rad: yaw_rad + turn.clamp(-wide, wide),
            pitch_rad: self.pitch_rad.clamp(pitch_rad - high, pitch_rad + high),
            ..*self
        }
    }

    /// Returns whether a point is in its picture, ignoring occlusion.
    pub fn sees(&self, point: &Point3, camera: &Pinhole) -> bool {
        let in_camera = self.clip_from_camera().inverse() * point;
        camera.project(&in_camera).is_some_and(|pixel| {
            (0.0..f64::from(camera.width)).contains(&pixel.x)
                && (0.0..f64::from(camera.height)).contains(&pixel.y)
        })
    }
}

/// Returns the camera of the virtual views: as wide as that of the clip, with a minimum width, so that there
/// is something to complete from.
pub fn camera_like(key: &Pinhole) -> Pinhole {
    const NARROWEST: f64 = 1.1;
    let longer = f64::from(key.width.max(key.height));
    let focal = (f64::from(WIDTH) * key.fx.max(key.fy) / longer).min(NARROWEST * f64::from(WIDTH));
    Pinhole {
        width: WIDTH,
        height: HEIGHT,
        fx: focal,
        fy: focal,
        cx: f64::from(WIDTH) / 2.0 - 0.5,
        cy: f64::from(HEIGHT) / 2.0 - 0.5,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_looks_where_it_says() {
        let view = View { eye_m: [1.0, 2.0, 1.5], yaw_rad: 0.7, pitch_rad: 0.4 };
        let pose = view.clip_from_camera();
        let forward = pose.rotation * Vector3::z();
        assert!((forward - view.forward()).norm() < 1e-12);
        let right = pose.rotation * Vector3::x();
        assert!(right.z.abs() < 1e-12, "level: {right}");
        let down = pose.rotation * Vector3::y();
        assert!(down.z < 0.0, "y is down: {down}");
        let camera =
            camera_like(&Pinhole { width: 640, height: 480, fx: 577.0, fy: 577.0, cx: 319.5, cy: 239.5 });
        assert!(view.sees(&(view.eye() + view.forward() * 2.0), &camera));
        assert!(!view.sees(&(view.eye() - view.forward() * 2.0), &camera));
        let behind = view.eye() - view.forward() * 2.0;
        let turned = view.towards(&behind, &camera);
        assert!(turned.sees(&behind, &camera) && turned.eye_m == view.eye_m, "{turned:?}");
        assert_eq!(view.towards(&(view.eye() + view.forward()), &camera), view);
        let back = view.back(0.5);
        assert!((back.eye() + view.forward() * 0.5 - view.eye()).norm() < 1e-12);
    }
}
