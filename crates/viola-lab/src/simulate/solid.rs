//! Basic shapes of all solids.

use super::finish::Finish;
use super::model::Model;
use nalgebra::{Matrix3, Rotation3};
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point3, Pose2, Vector3};

/// A unit shape, in -1..1 along each axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Block,
    /// Its axis is z.
    Cylinder,
    Ball,
    /// The block without its edges and corners: its intersection with a ball of [`CUSHION_RADIUS`].
    Cushion,
    /// A surface of triangles.
    Mesh(&'static Model),
}

/// Radius of the ball that rounds a cushion, in half sides of its block: more than 1, which is a ball, and
/// less than the square root of 2, where the edges begin.
pub(super) const CUSHION_RADIUS: f64 = 1.3;

/// A unit shape scaled by `half`, rolled by `roll_rad` about y, tilted by `tilt_rad` about x, rotated by
/// `yaw_rad`, moved to `centre`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solid {
    pub shape: Shape,
    pub centre: Point3,
    pub half: Vector3,
    pub yaw_rad: f64,
    pub tilt_rad: f64,
    pub roll_rad: f64,
    pub class: Class,
    pub finish: Finish,
}

impl Solid {
    /// Returns an upright block, by the centre of its bottom and its full size.
    pub fn block(class: Class, bottom: [f64; 3], size: [f64; 3], finish: Finish) -> Solid {
        Solid {
            shape: Shape::Block,
            centre: Point3::new(bottom[0], bottom[1], bottom[2] + size[2] / 2.0),
            half: Vector3::new(size[0], size[1], size[2]) / 2.0,
            yaw_rad: 0.0,
            tilt_rad: 0.0,
            roll_rad: 0.0,
            class,
            finish,
        }
    }

    pub fn moved(&self, pose: &Pose2) -> Solid {
        let ground = pose.apply(&self.centre.xy());
        Solid {
            centre: Point3::new(ground.x, ground.y, self.centre.z),
            yaw_rad: self.yaw_rad + pose.yaw_rad,
            ..*self
        }
    }

    /// Returns its mirror image, x to -x; triangles are only moved.
    pub fn mirrored(&self) -> Solid {
        let centre = Point3::new(-self.centre.x, self.centre.y, self.centre.z);
        Solid { centre, yaw_rad: -self.yaw_rad, roll_rad: -self.roll_rad, ..*self }
    }

    pub fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), self.yaw_rad)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), self.tilt_rad)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), self.roll_rad)
    }

    /// Returns the transform of directions from home to the unit shape.
    pub fn unit_from_home(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal(&self.half.map(|h| 1.0 / h)) * self.rotation().inverse().matrix()
    }

    /// Returns the transform of directions from the unit shape to home.
    pub fn home_from_unit(&self) -> Matrix3<f64> {
        self.rotation().matrix() * Matrix3::from_diagonal(&self.half)
    }

    /// Returns the half size of its bounding box, about `centre`.
    pub fn half_bounds(&self) -> Vector3 {
        let axes = self.home_from_unit();
        let ball = Vector3::from_fn(|row, _| axes.row(row).norm());
        let block = Vector3::from_fn(|row, _| axes.row(row).iter().map(|v| v.abs()).sum());
        match self.shape {
            Shape::Ball => ball,
            Shape::Block | Shape::Mesh(_) => block,
            Shape::Cushion => block.inf(&(ball * CUSHION_RADIUS)),
            Shape::Cylinder => {
                Vector3::from_fn(|row, _| axes[(row, 0)].hypot(axes[(row, 1)]) + axes[(row, 2)].abs())
            }
        }
    }

    pub fn bottom_m(&self) -> f64 {
        self.centre.z - self.half_bounds().z
    }

    pub fn top_m(&self) -> f64 {
        self.centre.z + self.half_bounds().z
    }
}
