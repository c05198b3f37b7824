//! Finds whether two poses are different explanations of a clip.

use viola_geometry::{Pose2, angle_between};

/// A pose further away than either of these is a different explanation (paper IV-A, theta_T and theta_R).
const CLOSE_M: f64 = 0.3;
const CLOSE_DEG: f64 = 20.0;

/// Returns whether a pose is a different explanation than another one.
pub fn is_different(a: &Pose2, b: &Pose2) -> bool {
    a.distance_m(b) > CLOSE_M || angle_between(a.yaw_rad, b.yaw_rad).to_degrees() > CLOSE_DEG
}
