//! A frame's pose against a key frame: grey and depth together, from coarse to fine (Steinbruecker, Sturm and Cremers,
//! 2011; Kerl, Sturm and Cremers, 2013, for the weights; Chen and Medioni, 1992, for the distances to planes).
//!
//! The slopes are the key frame's and are the same at every step (Baker and Matthews, 2004), so that a step only looks
//! up the frame's grey and depth where the points fall. A change of exposure is a gain and an offset, solved for along
//! with the pose.

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

/// Steps at each layer, the finest first; the last number holds for all further layers.
const STEPS: [usize; 4] = [4, 6, 8, 10];
/// Readings further from a point than this share of its depth are of something else, finest layer first.
const GATES: [f32; 4] = [0.05, 0.08, 0.15, 0.3];
/// Information, in points, that a start has of its place and of its direction: what holds a frame in front of
/// which nothing can be told apart.
const HOLD: [f64; 2] = [5e5, 3e4];
/// Steps end below this.
const ENOUGH_M: f64 = 1e-4;
const ENOUGH_RAD: f64 = 1e-4;

/// Points that err together.
const TOGETHER: f64 = 100.0;
const LEAST_M: f64 = 0.002;
const LEAST_RAD: f64 = 0.0015;

/// Where a frame is, against its key frame.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub camera_from_key: Pose3,
    /// Grey of the frame = gain * grey of the key frame + offset.
    pub gain: f64,
    pub offset: f64,
    /// Of a small motion of the key frame's points (translation, then rotation), with gain and offset solved for.
    pub information: Matrix6<f64>,
    /// Share of the key frame's points that fall into the frame's picture.
    pub overlap: f64,
    /// Share of those that fall on a reading, and whose reading is where it should be.
    pub agreement: f64,
    /// Root mean square error of grey.
    pub grey_error: f64,
}

impl Step {
    /// How well the frame fits, about 0..1: what is seen where it should be, less where it looks otherwise.
    pub fn score(&self) -> f64 {
        self.agreement - 4.0 * self.grey_error
    }

    /// The covariance of a small motion of the key frame's points. Neighbouring pixels err together, so that there are
    /// fewer independent ones than points, and no depth camera is true to less than some millimetres.
    pub fn covariance(&self) -> Matrix6<f64> {
        let spread = self.information / TOGETHER + Matrix6::identity() * 1e-3;
        let mut covariance = spread.try_inverse().unwrap_or_else(|| Matrix6::identity() * 1e3);
        for i in 0..3 {
            covariance[(i, i)] += LEAST_M * LEAST_M;
            covariance[(i + 3, i + 3)] += LEAST_RAD * LEAST_RAD;
        }
        covariance
    }

    /// The inverse of the covariance.
    pub fn trusted_information(&self) -> Matrix6<f64> {
        self.covariance().try_inverse().unwrap_or_else(Matrix6::identity)
    }

    /// The standard deviation of the place in the direction that is known worst.
    pub fn worst_m(&self) -> f64 {
        let covariance = self.covariance();
        covariance.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigenvalues().max().max(0.0).sqrt()
    }
}

/// Finds a frame's pose from a start. `layers` restricts it to the coarsest ones.
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
            // Products of rotations drift away from unit length, and each frame starts from the ones before.
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

/// The spread of weighted squares, within what is plausible; none without any.
fn sigma(sum_and_count: &[f64; 2], low: f64, high: f64) -> Option<f64> {
    let [sum, count] = *sum_and_count;
    (count > 20.0).then(|| (sum / count).sqrt().clamp(low, high))
}

/// The motion of a small twist: translation, then rotation.
pub(super) fn exponential(motion: &Vector6<f64>) -> Pose3 {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(motion[3], motion[4], motion[5]));
    Pose3::from_parts(Vector3::new(motion[0], motion[1], motion[2]).into(), turn)
}

/// The step that is best by the points, and by the start where these say nothing.
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
    // Exposure stays where nothing speaks of it.
    matrix[(6, 6)] += 100.0;
    matrix[(7, 7)] += 100.0;
    let step = -matrix.cholesky()?.solve(&gradient);
    step.iter().all(|c| c.is_finite()).then_some(step)
}

/// The 6x6 information of the pose when gain and offset are solved for as well.
fn information(matrix: &Matrix8) -> Option<Matrix6<f64>> {
    let pose = matrix.fixed_view::<6, 6>(0, 0);
    let cross = matrix.fixed_view::<6, 2>(0, 6);
    let exposure = matrix.fixed_view::<2, 2>(6, 6) + nalgebra::Matrix2::identity();
    Some(pose - cross * exposure.try_inverse()? * cross.transpose())
}
