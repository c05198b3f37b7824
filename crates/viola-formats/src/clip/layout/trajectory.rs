//! Poses by time.

use viola_geometry::Pose3;

/// A value and its time.
pub(super) struct Timed<T> {
    pub time_s: f64,
    pub value: T,
}

pub(super) fn times<T>(timed: &[Timed<T>]) -> Vec<f64> {
    timed.iter().map(|t| t.time_s).collect()
}

/// Interpolates ascending poses at a time, from the neighbours within the gap, or returns the only one.
pub(super) fn pose_at(poses: &[Timed<Pose3>], time_s: f64, max_gap_s: f64) -> Option<Pose3> {
    let next = poses.partition_point(|pose| pose.time_s < time_s);
    let near = |pose: &&Timed<Pose3>| (pose.time_s - time_s).abs() <= max_gap_s;
    let before = next.checked_sub(1).map(|index| &poses[index]).filter(near);
    let after = poses.get(next).filter(near);
    match (before, after) {
        (Some(before), Some(after)) => {
            let share = (time_s - before.time_s) / (after.time_s - before.time_s);
            // Opposite rotations cannot be interpolated; the earlier pose is the fallback.
            before.value.try_lerp_slerp(&after.value, share, 1e-9).or(Some(before.value))
        }
        (one, other) => one.or(other).map(|pose| pose.value),
    }
}
