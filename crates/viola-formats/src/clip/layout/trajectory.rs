//! Poses by time.

use viola_geometry::Pose3;

/// A value and its time.
pub(super) struct Timed<T> {
    pub time_s: f64,
    pub value: T,
}

impl<T> Timed<T> {
    pub fn gap_s(&self, time_s: f64) -> f64 {
        (self.time_s - time_s).abs()
    }
}

/// Returns the item of an ascending list that is nearest to a time; `None` without any.
pub(super) fn nearest<T>(timed: &[Timed<T>], time_s: f64) -> Option<&Timed<T>> {
    let after = timed.partition_point(|item| item.time_s < time_s);
    let near = [after.checked_sub(1), Some(after)].into_iter().flatten().filter_map(|at| timed.get(at));
    near.min_by(|a, b| a.gap_s(time_s).total_cmp(&b.gap_s(time_s)))
}

pub(super) fn times<T>(timed: &[Timed<T>]) -> Vec<f64> {
    timed.iter().map(|t| t.time_s).collect()
}

/// A single pose this near stands for a frame: a frame of 50 Hz.
const HELD_S: f64 = 0.02;

/// Interpolates ascending poses at a time, between neighbours of which the nearer one is within the gap and that are at
/// most twice the gap apart. A pose without such a neighbour counts if it is within [`HELD_S`].
pub(super) fn pose_at(poses: &[Timed<Pose3>], time_s: f64, max_gap_s: f64) -> Option<Pose3> {
    let next = poses.partition_point(|pose| pose.time_s < time_s);
    let gap_s = |pose: &Timed<Pose3>| pose.gap_s(time_s);
    let before = next.checked_sub(1).map(|index| &poses[index]);
    let after = poses.get(next);
    match (before, after) {
        (Some(before), Some(after))
            if gap_s(before).min(gap_s(after)) <= max_gap_s
                && gap_s(before) + gap_s(after) <= 2.0 * max_gap_s =>
        {
            let fraction = (time_s - before.time_s) / (after.time_s - before.time_s);
            // Opposite rotations cannot be interpolated; the earlier pose is the fallback.
            before.value.try_lerp_slerp(&after.value, fraction, 1e-9).or(Some(before.value))
        }
        _ => {
            let alone = nearest(poses, time_s).filter(|pose| gap_s(pose) <= HELD_S.min(max_gap_s));
            alone.map(|pose| pose.value)
        }
    }
}

/// Returns the reason to tell if [`pose_at`] finds none of a file's poses for any picture; `None` without poses or pictures.
/// Both are ascending.
pub(super) fn no_pose_near(
    file: &str,
    poses: &[Timed<Pose3>],
    pictures_s: &[f64],
    max_gap_s: f64,
) -> Option<String> {
    let (first_s, last_s) = (poses.first()?.time_s, poses.last()?.time_s);
    let (from_s, to_s) = (pictures_s.first()?, pictures_s.last()?);
    Some(format!(
        "no depth picture is between two poses of {file} at most {:.2} s apart; the poses are from {first_s:.2} s to \
         {last_s:.2} s, and the pictures from {from_s:.2} s to {to_s:.2} s",
        2.0 * max_gap_s
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poses along x: the place is the time.
    fn poses(times_s: &[f64]) -> Vec<Timed<Pose3>> {
        times_s.iter().map(|&time_s| Timed { time_s, value: Pose3::translation(time_s, 0.0, 0.0) }).collect()
    }

    #[test]
    fn poses_are_interpolated_and_hardly_held() {
        for (times_s, time_s, expected) in [
            (&[0.0, 0.2][..], 0.09, Some(0.09)),
            (&[0.0, 0.2], 0.15, Some(0.15)),
            (&[0.0, 0.3], 0.05, None),
            (&[0.0, 0.3], 0.01, Some(0.0)),
            (&[0.0], 0.015, Some(0.0)),
            (&[0.0], 0.05, None),
            (&[1.0], 0.99, Some(1.0)),
            (&[], 0.0, None),
        ] {
            let found = pose_at(&poses(times_s), time_s, 0.11).map(|pose| pose.translation.x);
            let is_right = match (found, expected) {
                (Some(found), Some(expected)) => (found - expected).abs() < 1e-9,
                (None, None) => true,
                _ => false,
            };
            assert!(is_right, "{times_s:?} at {time_s}: {found:?} instead of {expected:?}");
        }
    }
}
