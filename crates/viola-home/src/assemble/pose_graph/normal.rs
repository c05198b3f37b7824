//! Normal equations of a pose graph, and their solution by conjugate gradients.
//!
//! Every clip has a prior, which bounds the condition number. Conjugate gradients with a block-diagonal
//! preconditioner then need tens of iterations, and one iteration is linear in the number of edges, also if
//! hundreds of clips overlap in one place, where a factorisation fills up.

use super::{Edge, Prior};
use nalgebra::{Matrix3, Matrix6, Vector6};
use viola_geometry::{Pose3, Vector3, conjugate_gradients};

/// Added to an alignment's standard deviations: errors of the map, common to all hits.
const MAP_M: f64 = 0.015;
const MAP_RAD: f64 = 0.3f64.to_radians();
/// Standard deviations of a clip's floor height and tilt.
const FLOOR_M: f64 = 0.02;
const FLOOR_RAD: f64 = 0.6f64.to_radians();
/// Information of the planar pose that a person fixed.
const FIXED: f64 = 1e12;
/// Relative residual at which conjugate gradients end.
const TOLERANCE: f64 = 1e-12;
const MAX_ITERATIONS: usize = 1_000;

pub(super) struct NormalEquations {
    /// Blocks on the diagonal.
    diagonal: Vec<Matrix6<f64>>,
    /// Blocks above the diagonal: row, column, block.
    above: Vec<(usize, usize, Matrix6<f64>)>,
    gradient: Vec<Vector6<f64>>,
}

/// Returns the error of `pose` against `at`: translation, then rotation vector, in their common frame.
fn error(pose: &Pose3, at: &Pose3) -> Vector6<f64> {
    let shift = pose.translation.vector - at.translation.vector;
    let turn = (pose.rotation * at.rotation.inverse()).scaled_axis();
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

impl NormalEquations {
    pub fn new(clips: usize) -> NormalEquations {
        NormalEquations {
            diagonal: vec![Matrix6::zeros(); clips],
            above: Vec::new(),
            gradient: vec![Vector6::zeros(); clips],
        }
    }

    /// Adds a clip's prior: its own alignment and floor. A fixed clip is at its prior and stays there.
    pub fn add_prior(&mut self, i: usize, pose: &Pose3, prior: &Prior) {
        let plane = match &prior.covariance {
            None => Matrix3::identity() * FIXED,
            Some(covariance) => {
                let map = Vector3::new(MAP_M, MAP_M, MAP_RAD).map(|s| s * s);
                let sum = covariance + Matrix3::from_diagonal(&map);
                sum.try_inverse().unwrap_or_else(Matrix3::identity)
            }
        };
        let mut information = Matrix6::zeros();
        // x, y and yaw.
        let places = [0, 1, 5];
        for (r, &row) in places.iter().enumerate() {
            for (c, &column) in places.iter().enumerate() {
                information[(row, column)] = plane[(r, c)];
            }
        }
        information[(2, 2)] = FLOOR_M.powi(-2);
        information[(3, 3)] = FLOOR_RAD.powi(-2);
        information[(4, 4)] = FLOOR_RAD.powi(-2);
        self.diagonal[i] += information;
        self.gradient[i] += information * error(pose, &prior.map_from_clip);
    }

    /// Adds the edge of an overlap; `kernel`: scale of the robust kernel, in standard deviations. An edge does not move
    /// its fixed clips.
    pub fn add_edge(&mut self, edge: &Edge, poses: &[Pose3], kernel: f64, is_fixed: impl Fn(usize) -> bool) {
        let (a, b) = (&poses[edge.a], &poses[edge.b]);
        let error = error(&(b.inverse() * a), &edge.overlap.b_from_a);
        let information = Matrix6::from_fn(|r, c| edge.overlap.information[r][c]);
        let far = (error.transpose() * information * error)[0].max(0.0).sqrt() / kernel;
        let kernel_weight = 1.0 / (1.0 + far * far);
        let information = information * (kernel_weight * kernel_weight);
        let b_from_map = b.rotation.inverse().to_rotation_matrix().into_inner();
        let between = (a.translation.vector - b.translation.vector).cross_matrix();
        let mut by_a = Matrix6::zeros();
        by_a.fixed_view_mut::<3, 3>(0, 0).copy_from(&b_from_map);
        by_a.fixed_view_mut::<3, 3>(3, 3).copy_from(&b_from_map);
        let mut by_b = -by_a;
        by_b.fixed_view_mut::<3, 3>(0, 3).copy_from(&(b_from_map * between));
        let (weighted_a, weighted_b) = (by_a.transpose() * information, by_b.transpose() * information);
        for (clip, weighted, by) in [(edge.a, weighted_a, by_a), (edge.b, weighted_b, by_b)] {
            if !is_fixed(clip) {
                self.gradient[clip] += weighted * error;
                self.diagonal[clip] += weighted * by;
            }
        }
        if !is_fixed(edge.a) && !is_fixed(edge.b) {
            self.above.push((edge.a, edge.b, weighted_a * by_b));
        }
    }

    /// Returns the Gauss-Newton steps; none if the system is not positive definite.
    pub fn solve(&self) -> Option<Vec<Vector6<f64>>> {
        let preconditioner: Option<Vec<_>> = self.diagonal.iter().map(|block| block.cholesky()).collect();
        let preconditioner = preconditioner?;
        let scaled = |residual: &[Vector6<f64>]| -> Vec<Vector6<f64>> {
            preconditioner.iter().zip(residual).map(|(block, r)| block.solve(r)).collect()
        };
        let downhill = self.gradient.iter().map(|g| -g).collect();
        let times = |vector: &[Vector6<f64>]| self.times(vector);
        let (steps, is_definite) =
            conjugate_gradients(downhill, times, scaled, TOLERANCE * TOLERANCE, MAX_ITERATIONS);
        (is_definite && steps.iter().all(|step| step.iter().all(|c| c.is_finite()))).then_some(steps)
    }

    fn times(&self, vector: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
        let mut image: Vec<Vector6<f64>> = self.diagonal.iter().zip(vector).map(|(d, v)| d * v).collect();
        for (row, column, block) in &self.above {
            image[*row] += block * vector[*column];
            image[*column] += block.transpose() * vector[*row];
        }
        image
    }
}
