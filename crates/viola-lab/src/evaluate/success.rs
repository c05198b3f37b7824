//! The paper's bounds of success: a pose counts as right if both of its errors are below them.

/// Distance from the true pose.
pub const SUCCESS_M: f64 = 0.3;
/// Angle from the true pose.
pub const SUCCESS_DEG: f64 = 10.0;
