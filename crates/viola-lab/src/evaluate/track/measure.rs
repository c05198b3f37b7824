//! Errors of a trajectory.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use serde::Serialize;
use viola_geometry::{Point3, Pose3, Vector3};

/// Errors of a trajectory against the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrajectoryErrors {
    /// RMS distance of the cameras after rigid alignment of the whole trajectory.
    pub ate_m: f64,
    /// The same as a fraction of the true path.
    #[serde(rename = "share_of_path")]
    pub fraction_of_path: f64,
    /// RMS angle of the orientations after their own alignment.
    pub rotation_deg: f64,
    /// RMS error of the motion over one metre of path, per metre; over the whole path if it is shorter.
    pub rpe_m_per_m: f64,
    /// RMS error of the rotation over 30 degrees of turning, per degree.
    pub rpe_deg_per_deg: f64,
}

/// Path length and turning of relative errors.
const STRETCH_M: f64 = 1.0;
const STRETCH_RAD: f64 = std::f64::consts::FRAC_PI_6;

/// Returns the errors over all frames with both poses; none for fewer than three.
pub fn measure(found: &[Option<Pose3>], truth: &[Option<Pose3>]) -> Option<TrajectoryErrors> {
    let pairs: Vec<(Pose3, Pose3)> =
        found.iter().zip(truth).filter_map(|(f, t)| Some(((*f)?, (*t)?))).collect();
    if pairs.len() < 3 {
        return None;
    }
    let at = |pose: &Pose3| Point3::from(pose.translation.vector);
    let truth_from_found = laid_over(&pairs.iter().map(|(f, t)| (at(f), at(t))).collect::<Vec<_>>())?;
    let squares = pairs.iter().map(|(f, t)| (truth_from_found * at(f) - at(t)).norm_squared());
    let ate_m = (squares.sum::<f64>() / pairs.len() as f64).sqrt();
    let step = |pair: &[(Pose3, Pose3)]| pair[0].1.inverse() * pair[1].1;
    let way = |of: &dyn Fn(&Pose3) -> f64| {
        let mut sum = vec![0.0];
        pairs.windows(2).for_each(|pair| sum.push(sum[sum.len() - 1] + of(&step(pair))));
        sum
    };
    let (moved_m, turned_rad) =
        (way(&|step| step.translation.vector.norm()), way(&|step| step.rotation.angle()));
    Some(TrajectoryErrors {
        ate_m,
        fraction_of_path: ate_m / moved_m[moved_m.len() - 1].max(1e-9),
        rotation_deg: rotation_rad(&pairs)?.to_degrees(),
        rpe_m_per_m: relative(&pairs, &moved_m, STRETCH_M, |off| off.translation.vector.norm()),
        rpe_deg_per_deg: relative(&pairs, &turned_rad, STRETCH_RAD, |off| off.rotation.angle()),
    })
}

/// Returns the RMS relative error over each stretch, divided by the stretch.
fn relative(pairs: &[(Pose3, Pose3)], way: &[f64], stretch: f64, size: impl Fn(&Pose3) -> f64) -> f64 {
    let stretch = stretch.min(way[way.len() - 1]).max(1e-9);
    let (mut sum, mut count) = (0.0, 0);
    for first in 0..pairs.len() {
        let last = way.partition_point(|at| *at < way[first] + stretch * (1.0 - 1e-9));
        let (Some(a), Some(b)) = (pairs.get(first), pairs.get(last)) else { continue };
        let off = (a.1.inverse() * b.1).inverse() * (a.0.inverse() * b.0);
        sum += (size(&off) / (way[last] - way[first])).powi(2);
        count += 1;
    }
    (sum / f64::from(count.max(1))).sqrt()
}

/// Returns the RMS angle between orientations after the best common rotation (chordal mean).
fn rotation_rad(pairs: &[(Pose3, Pose3)]) -> Option<f64> {
    let off = |(found, truth): &(Pose3, Pose3)| truth.rotation * found.rotation.inverse();
    let sum =
        pairs.iter().fold(Matrix3::zeros(), |sum, pair| sum + off(pair).to_rotation_matrix().into_inner());
    let mean = nearest_rotation(&sum)?;
    let squares = pairs.iter().map(|pair| (mean.inverse() * off(pair)).angle().powi(2));
    Some((squares.sum::<f64>() / pairs.len() as f64).sqrt())
}

fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let svd = matrix.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut mirror = Matrix3::identity();
    mirror[(2, 2)] = (u * v_t).determinant().signum();
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * mirror * v_t)))
}

/// Returns the rigid transform from the first points to the second (Umeyama, 1991, without scale).
fn laid_over(pairs: &[(Point3, Point3)]) -> Option<Pose3> {
    let count = pairs.len() as f64;
    let (from, to) = pairs
        .iter()
        .fold((Vector3::zeros(), Vector3::zeros()), |(a, b), pair| (a + pair.0.coords, b + pair.1.coords));
    let (from, to) = (from / count, to / count);
    let spread = pairs
        .iter()
        .fold(Matrix3::zeros(), |sum, (a, b)| sum + (b.coords - to) * (a.coords - from).transpose());
    let turn = nearest_rotation(&spread)?;
    Some(Pose3::from_parts((to - turn * from).into(), turn))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(stretch: f64) -> Vec<Option<Pose3>> {
        let at = |i: usize| {
            let t = i as f64 / 50.0;
            let place = Vector3::new(stretch * 4.0 * t, (3.0 * t).sin(), 0.3 * t * t);
            Some(Pose3::new(place, Vector3::new(0.2 * t, 0.1, 1.5 * t)))
        };
        (0..=50).map(at).collect()
    }

    #[test]
    fn a_trajectory_in_another_world_has_no_error() {
        let world = Pose3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.3, 2.0, -1.0));
        let moved: Vec<_> = walk(1.0).into_iter().map(|pose| pose.map(|pose| world * pose)).collect();
        let errors = measure(&moved, &walk(1.0)).unwrap();
        for error in [errors.ate_m, errors.rotation_deg, errors.rpe_m_per_m, errors.rpe_deg_per_deg] {
            assert!(error < 1e-6, "{errors:?}");
        }
    }

    /// A trajectory 10 % too long errs by 10 % of each stretch along the stretched axis.
    #[test]
    fn a_stretched_trajectory_has_its_error() {
        let errors = measure(&walk(1.1), &walk(1.0)).unwrap();
        assert!((0.05..0.1).contains(&errors.rpe_m_per_m), "{errors:?}");
        // 4.4 m against 4 m, aligned at the middle: a uniform error of up to 0.2 m has an RMS of 0.115 m.
        assert!((errors.ate_m - 0.115).abs() < 0.02, "{errors:?}");
        assert!(errors.rotation_deg < 1e-6);
    }

    #[test]
    fn nothing_tracked_is_no_error_of_zero() {
        assert_eq!(measure(&[None, None], &walk(1.0)), None);
    }
}
