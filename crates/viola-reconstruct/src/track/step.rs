//! Aligns a frame to a key frame by grey and depth together, from coarse to fine (Steinbruecker, Sturm and
//! Cremers, 2011; Kerl, Sturm and Cremers, 2013, for the weights; Chen and Medioni, 1992, for the distances
//! to planes).
//!
//! The slopes are the key frame's and are the same at every step (Baker and Matthews, 2004), so a step
//! only samples the frame's grey and depth. A gain and an offset for changes of exposure are solved for, too.

mod look;
mod state;
mod sums;

use super::picture::Pyramid;
use super::reference::Reference;
use look::sum;
use nalgebra::{Matrix6, UnitQuaternion, Vector6};
use state::{Matrix8, State, Vector8};
use sums::Sums;
use viola_geometry::{Pose3, Vector3};

/// Maximum number of steps at each layer, the finest first; the last number holds for all further layers.
const STEPS: [usize; 4] = [4, 6, 8, 10];
/// Readings further from a point than this fraction of its depth are outliers, finest layer first.
const GATES: [f32; 4] = [0.05, 0.08, 0.15, 0.3];
/// Information of the start as a prior, in points, on position and direction. It holds a frame that its
/// picture does not constrain.
const HOLD: [f64; 2] = [5e5, 3e4];
/// Convergence thresholds of a step.
const ENOUGH_M: f64 = 1e-4;
const ENOUGH_RAD: f64 = 1e-4;

/// Number of points whose errors are correlated.
const TOGETHER: f64 = 100.0;
const MIN_DEVIATION_M: f64 = 0.002;
const MIN_DEVIATION_RAD: f64 = 0.0015;

/// Pose of a frame against its key frame.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub camera_from_key: Pose3,
    /// Grey of the frame = gain * grey of the key frame + offset.
    pub gain: f64,
    pub offset: f64,
    /// Information of a small motion of the key frame's points (translation, then rotation), with gain and
    /// offset marginalised.
    pub information: Matrix6<f64>,
    /// Fraction of the key frame's points that fall into the frame's picture.
    pub overlap: f64,
    /// Fraction of those that have a depth reading that agrees.
    pub agreement: f64,
    /// Root mean square error of grey.
    pub grey_error: f64,
}

impl Step {
    /// Returns the fit of the frame, about 0 to 1: the agreement, less the weighted grey error.
    pub fn score(&self) -> f64 {
        self.agreement - 4.0 * self.grey_error
    }

    /// Returns the covariance of a small motion of the key frame's points. The errors of neighbouring pixels
    /// are correlated, and no depth camera is accurate to less than some millimetres.
    pub fn covariance(&self) -> Matrix6<f64> {
        let spread = self.information / TOGETHER + Matrix6::identity() * 1e-3;
        let mut covariance = spread.try_inverse().unwrap_or_else(|| Matrix6::identity() * 1e3);
        for i in 0..3 {
            covariance[(i, i)] += MIN_DEVIATION_M * MIN_DEVIATION_M;
            covariance[(i + 3, i + 3)] += MIN_DEVIATION_RAD * MIN_DEVIATION_RAD;
        }
        covariance
    }

    /// Returns the inverse of the covariance.
    pub fn trusted_information(&self) -> Matrix6<f64> {
        self.covariance().try_inverse().unwrap_or_else(Matrix6::identity)
    }

    /// Returns the standard deviation of the position in the worst direction.
    pub fn worst_m(&self) -> f64 {
        let covariance = self.covariance();
        covariance.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigenvalues().max().max(0.0).sqrt()
    }
}

/// Finds a frame's pose from a start. `from_layer` is the finest layer used.
pub(super) fn align(
    reference: &Reference,
    pyramid: &Pyramid,
    start: &Pose3,
    exposure: (f64, f64),
    from_layer: usize,
) -> Option<Step> {
    let mut state = State {
        camera_from_key: *start,
        gain: exposure.0,
        offset: exposure.1,
        grey_sigma: 0.1,
        depth_sigma: 4.0,
    };
    let mut last = None;
    for layer in (from_layer..reference.layers.len().min(pyramid.layers.len())).rev() {
        let pick = |of: &[usize]| of.get(layer).or(of.last()).copied().unwrap_or(1);
        let gate = GATES.get(layer).or(GATES.last()).copied().unwrap_or(0.1);
        for _ in 0..pick(&STEPS) {
            let sums = sum(&reference.layers[layer], &pyramid.layers[layer], &state, gate);
            let away = start.inverse() * state.camera_from_key;
            let step = solve(&sums, &away)?;
            let motion = Vector6::from_iterator(step.iter().take(6).copied());
            state.camera_from_key *= exponential(&motion);
            // Products of rotations drift away from unit length, and each frame starts from earlier ones.
            state.camera_from_key.rotation.renormalize();
            state.gain += step[6];
            state.offset += step[7];
            state.grey_sigma = sigma(&sums.grey, 0.004, 0.3).unwrap_or(state.grey_sigma);
            state.depth_sigma = sigma(&sums.depth, 0.25, 20.0).unwrap_or(state.depth_sigma);
            let is_small =
                motion.fixed_rows::<3>(0).norm() < ENOUGH_M && motion.fixed_rows::<3>(3).norm() < ENOUGH_RAD;
            last = Some((sums, layer));
            if is_small {
                break;
            }
        }
    }
    let (sums, layer) = last?;
    if !state.camera_from_key.translation.vector.iter().all(|c| c.is_finite()) {
        return None;
    }
    Some(Step {
        camera_from_key: state.camera_from_key,
        gain: state.gain,
        offset: state.offset,
        information: information(&sums.matrix())?,
        overlap: sums.seen / (reference.counts[layer].max(1) as f64),
        agreement: sums.agree / sums.seen.max(1.0),
        grey_error: state.grey_sigma,
    })
}

/// Returns the root mean square from a sum and count, clamped to `low..=high`; `None` with too few points.
fn sigma(sum_and_count: &[f64; 2], low: f64, high: f64) -> Option<f64> {
    let [sum, count] = *sum_and_count;
    (count > 20.0).then(|| (sum / count).sqrt().clamp(low, high))
}

/// Returns the motion of a small twist: translation, then rotation.
pub(super) fn exponential(motion: &Vector6<f64>) -> Pose3 {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(motion[3], motion[4], motion[5]));
    Pose3::from_parts(Vector3::new(motion[0], motion[1], motion[2]).into(), turn)
}

/// Returns the best step by the points, with the start as a prior.
fn solve(sums: &Sums, away: &Pose3) -> Option<Vector8> {
    let mut matrix = sums.matrix();
    let mut gradient = Vector8::from_row_slice(&sums.gradient);
    let moved = Vector6::from_iterator(
        away.translation.vector.iter().copied().chain(away.rotation.scaled_axis().iter().copied()),
    );
    for i in 0..6 {
        let hold = HOLD[i / 3];
        matrix[(i, i)] += hold;
        gradient[i] += hold * moved[i];
    }
    // A weak prior keeps the exposure if nothing constrains it.
    matrix[(6, 6)] += 100.0;
    matrix[(7, 7)] += 100.0;
    let step = -matrix.cholesky()?.solve(&gradient);
    step.iter().all(|c| c.is_finite()).then_some(step)
}

/// Returns the 6x6 information of the pose, with gain and offset marginalised.
fn information(matrix: &Matrix8) -> Option<Matrix6<f64>> {
    let pose = matrix.fixed_view::<6, 6>(0, 0);
    let cross = matrix.fixed_view::<6, 2>(0, 6);
    let exposure = matrix.fixed_view::<2, 2>(6, 6) + nalgebra::Matrix2::identity();
    Some(pose - cross * exposure.try_inverse()? * cross.transpose())
}
