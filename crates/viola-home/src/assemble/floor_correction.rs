//! A clip's pose in space: its planar pose and the correction of its floor plane.

use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};
use viola_geometry::{Pose2, Pose3, Vector3};

/// Height and tilt of a clip's pose in space. The tilt is small, as is the height without that of the clip's frame above the
/// floor: the clip's own floor is level and at z = 0, except for the errors of its floor plane.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FloorCorrection {
    pub z_m: f64,
    /// Rotation vector about the map's x and y axes, applied after the yaw.
    pub tilt_rad: [f64; 2],
}

impl FloorCorrection {
    /// Returns that of a clip whose frame has its origin `rise_m` above the floor.
    pub(super) fn of_rise(rise_m: f64) -> FloorCorrection {
        FloorCorrection { z_m: rise_m, tilt_rad: [0.0; 2] }
    }
}

/// Returns the pose in space.
pub(super) fn pose_in_space(pose: &Pose2, correction: &FloorCorrection) -> Pose3 {
    let yaw = UnitQuaternion::from_scaled_axis(Vector3::z() * pose.yaw_rad);
    let tilt =
        UnitQuaternion::from_scaled_axis(Vector3::new(correction.tilt_rad[0], correction.tilt_rad[1], 0.0));
    Pose3::from_parts(Vector3::new(pose.x_m, pose.y_m, correction.z_m).into(), tilt * yaw)
}

/// Returns the pose in space of a clip whose frame has its origin `rise_m` above the floor.
pub(super) fn raised_pose(pose: &Pose2, rise_m: f64) -> Pose3 {
    pose_in_space(pose, &FloorCorrection::of_rise(rise_m))
}

/// Inverse of [`pose_in_space`]: the rotation without the tilt is the yaw.
pub(super) fn split_pose(pose: &Pose3) -> (Pose2, FloorCorrection) {
    let up = pose.rotation * Vector3::z();
    let tilt = UnitQuaternion::rotation_between(&Vector3::z(), &up).unwrap_or_default();
    let yaw = (tilt.inverse() * pose.rotation).scaled_axis();
    let at = pose.translation.vector;
    let vector = tilt.scaled_axis();
    (Pose2::new(at.x, at.y, yaw.z), FloorCorrection { z_m: at.z, tilt_rad: [vector.x, vector.y] })
}

/// Rounds a pose to 1 mm, and its angles to what moves a point 4 m away by 1 mm: a clip that others move by
/// less keeps its bytes, and so do its tiles.
pub(super) fn rounded(pose: &Pose2, correction: &FloorCorrection) -> (Pose2, FloorCorrection) {
    const PER_M: f64 = 1_000.0;
    const PER_RAD: f64 = 4_096.0;
    let to = |value: f64, steps: f64| (value * steps).round() / steps;
    let angle = |rad: f64| to(rad, PER_RAD);
    let pose = Pose2::new(to(pose.x_m, PER_M), to(pose.y_m, PER_M), angle(pose.yaw_rad));
    (pose, FloorCorrection { z_m: to(correction.z_m, PER_M), tilt_rad: correction.tilt_rad.map(angle) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_geometry::angle_between;

    proptest! {
        #[test]
        fn taken_apart_and_put_together(
            x in -20.0..20.0f64, y in -20.0..20.0f64, yaw in -3.1..3.1f64,
            z in -0.1..0.1f64, rx in -0.1..0.1f64, ry in -0.1..0.1f64,
        ) {
            let (pose, correction) = (Pose2::new(x, y, yaw), FloorCorrection { z_m: z, tilt_rad: [rx, ry] });
            let (pose2, correction2) = split_pose(&pose_in_space(&pose, &correction));
            prop_assert!(pose2.distance_m(&pose) < 1e-9 && angle_between(pose2.yaw_rad, yaw) < 1e-9);
            prop_assert!((correction2.z_m - z).abs() < 1e-9);
            prop_assert!((0..2).all(|i| (correction2.tilt_rad[i] - correction.tilt_rad[i]).abs() < 1e-9));
        }
    }
}
