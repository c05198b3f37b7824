//! Rigid motions of the plane.

use super::{Point2, Vector2};
use serde::{Deserialize, Serialize};

/// A rigid motion of the plane, SE(2): rotate by `yaw_rad`, then move by `(x_m, y_m)`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Pose2 {
    pub x_m: f64,
    pub y_m: f64,
    /// Counter-clockwise, in (-pi, pi] when it comes from this crate.
    pub yaw_rad: f64,
}

impl Pose2 {
    pub const IDENTITY: Pose2 = Pose2 { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };

    pub fn new(x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        Pose2 { x_m, y_m, yaw_rad: wrap_angle(yaw_rad) }
    }

    /// `a_from_b.compose(b_from_c)` is `a_from_c`.
    pub fn compose(&self, other: &Pose2) -> Pose2 {
        let moved = self.apply(&Point2::new(other.x_m, other.y_m));
        Pose2::new(moved.x, moved.y, self.yaw_rad + other.yaw_rad)
    }

    /// `a_from_b.inverse()` is `b_from_a`.
    pub fn inverse(&self) -> Pose2 {
        let (s, c) = self.yaw_rad.sin_cos();
        Pose2::new(-(c * self.x_m + s * self.y_m), s * self.x_m - c * self.y_m, -self.yaw_rad)
    }

    pub fn apply(&self, point: &Point2) -> Point2 {
        let rotated = self.rotate(&point.coords);
        Point2::new(rotated.x + self.x_m, rotated.y + self.y_m)
    }

    /// Rotates a direction, without the translation.
    pub fn rotate(&self, direction: &Vector2) -> Vector2 {
        let (s, c) = self.yaw_rad.sin_cos();
        Vector2::new(c * direction.x - s * direction.y, s * direction.x + c * direction.y)
    }

    pub fn translation(&self) -> Vector2 {
        Vector2::new(self.x_m, self.y_m)
    }

    /// Returns the distance between the origins, in metres.
    pub fn distance_m(&self, other: &Pose2) -> f64 {
        (self.translation() - other.translation()).norm()
    }

    /// Returns whether another pose is nearer than `distance_m` and turned by less than `angle_rad`.
    pub fn is_within(&self, other: &Pose2, distance_m: f64, angle_rad: f64) -> bool {
        self.distance_m(other) < distance_m && angle_between(self.yaw_rad, other.yaw_rad) < angle_rad
    }

    pub fn is_finite(&self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && self.yaw_rad.is_finite()
    }
}

/// Returns the same angle in (-pi, pi].
pub fn wrap_angle(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let wrapped = (angle_rad + PI).rem_euclid(TAU) - PI;
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

/// Returns the unsigned difference of two angles, 0..pi.
pub fn angle_between(a_rad: f64, b_rad: f64) -> f64 {
    wrap_angle(a_rad - b_rad).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    prop_compose! {
        fn pose()(x in -50.0..50.0f64, y in -50.0..50.0f64, yaw in -20.0..20.0f64) -> Pose2 {
            Pose2::new(x, y, yaw)
        }
    }

    fn check_close(a: &Pose2, b: &Pose2) {
        assert!(a.distance_m(b) < 1e-9, "{a:?} {b:?}");
        assert!(angle_between(a.yaw_rad, b.yaw_rad) < 1e-9, "{a:?} {b:?}");
    }

    proptest! {
        #[test]
        fn inverse_undoes(pose in pose(), x in -9.0..9.0f64, y in -9.0..9.0f64) {
            check_close(&pose.compose(&pose.inverse()), &Pose2::IDENTITY);
            check_close(&pose.inverse().compose(&pose), &Pose2::IDENTITY);
            let point = Point2::new(x, y);
            prop_assert!((pose.inverse().apply(&pose.apply(&point)) - point).norm() < 1e-9);
        }

        #[test]
        fn composition_is_application_in_turn(a in pose(), b in pose(), x in -9.0..9.0f64, y in -9.0..9.0f64) {
            let point = Point2::new(x, y);
            prop_assert!((a.compose(&b).apply(&point) - a.apply(&b.apply(&point))).norm() < 1e-9);
        }

        #[test]
        fn wrapping_keeps_the_angle(angle in -100.0..100.0f64) {
            let wrapped = wrap_angle(angle);
            prop_assert!(wrapped > -std::f64::consts::PI && wrapped <= std::f64::consts::PI);
            prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-9);
            prop_assert!((wrapped.cos() - angle.cos()).abs() < 1e-9);
        }
    }

    #[test]
    fn agrees_with_nalgebra() {
        let ours = Pose2::new(1.0, -2.0, 0.7);
        let theirs = nalgebra::Isometry2::new(nalgebra::Vector2::new(1.0, -2.0), 0.7);
        let point = Point2::new(0.3, 4.0);
        assert!((ours.apply(&point) - theirs * point).norm() < 1e-12);
    }
}
