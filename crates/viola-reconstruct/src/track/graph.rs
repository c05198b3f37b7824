//! Pose graph of the key frames, optimised by Gauss-Newton; each step is solved by conjugate gradients.
//!
//! Odometry is weighted by its information. Loops that disagree with everything else fade, and loops with too
//! little weight are rejected (Geman and McClure, 1985; Agarwal et al., 2013).

use super::step::{Step, exponential};
use nalgebra::{Matrix6, Vector6};
use viola_geometry::progress::{self, Cancelled, Progress};
use viola_geometry::{Pose3, Vector3, conjugate_gradients, groups};

/// A measured motion between two key frames.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    pub a: usize,
    pub b: usize,
    pub b_from_a: Pose3,
    /// Information of a small motion of `a` in its own frame: translation, then rotation.
    pub information: Matrix6<f64>,
    /// True for loops, which may be wrong; steps are trusted.
    pub is_loop: bool,
}

impl Edge {
    /// Returns the edge of an alignment of `b` to `a`.
    pub fn of(a: usize, b: usize, step: &Step, is_loop: bool) -> Edge {
        Edge { a, b, b_from_a: step.camera_from_key, information: step.trusted_information(), is_loop }
    }
}

/// Squared error, in standard deviations, at which loops fade.
const FADE: f64 = 30.0;
/// Minimum final weight of a loop; others are rejected.
const WRONG: f64 = 0.1;
const ROUNDS: usize = 12;

/// Optimises the poses (`world_from_key`) by the edges; the first of each connected part stays fixed. Returns
/// for each edge whether it is believed.
pub(super) fn settle(
    poses: &mut [Pose3],
    edges: &[Edge],
    progress: &dyn Progress,
) -> Result<Vec<bool>, Cancelled> {
    let fixed = first_of_parts(poses.len(), edges);
    let mut weights = vec![1.0; edges.len()];
    for round in 0..ROUNDS {
        let errors: Vec<Vector6<f64>> = edges.iter().map(|edge| error(edge, poses)).collect();
        for ((weight, edge), error) in weights.iter_mut().zip(edges).zip(&errors) {
            let squared = (error.transpose() * edge.information * error)[0];
            // Loops fade more and more strictly, so that a wrong one cannot bend the poses that judge it.
            let fade = FADE * f64::powi(2.0, 6 - (round.min(6) as i32));
            *weight = if edge.is_loop { (1.0 + squared / fade).powi(-2) } else { 1.0 };
        }
        let step = solve(poses, edges, &weights, &errors, &fixed, progress)?;
        for (pose, step) in poses.iter_mut().zip(&step) {
            *pose *= exponential(step);
            pose.rotation.renormalize();
        }
        if round > 6 && step.iter().all(|step| step.amax() < 1e-6) {
            break;
        }
    }
    Ok(edges.iter().zip(&weights).map(|(edge, weight)| !edge.is_loop || *weight > WRONG).collect())
}

fn first_of_parts(count: usize, edges: &[Edge]) -> Vec<bool> {
    let mut part: Vec<u32> = (0..count as u32).collect();
    for edge in edges {
        groups::join(&mut part, edge.a as u32, edge.b as u32);
    }
    (0..count as u32).map(|at| groups::root(&mut part, at) == at).collect()
}

/// Returns the residual of `a` against its pose by the edge and `b`, in its own frame.
fn error(edge: &Edge, poses: &[Pose3]) -> Vector6<f64> {
    let off = edge.b_from_a.inverse() * poses[edge.b].inverse() * poses[edge.a];
    let (shift, turn) = (off.translation.vector, off.rotation.scaled_axis());
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// Returns the adjoint matrix, which takes a small motion of `b` in its own frame to that of `a`.
fn carried(a_from_b: &Pose3) -> Matrix6<f64> {
    let turn = a_from_b.rotation.to_rotation_matrix().into_inner();
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    let lever: Vector3 = a_from_b.translation.vector;
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&(lever.cross_matrix() * turn));
    matrix
}

/// Returns the next step of all poses.
fn solve(
    poses: &[Pose3],
    edges: &[Edge],
    weights: &[f64],
    errors: &[Vector6<f64>],
    fixed: &[bool],
    progress: &dyn Progress,
) -> Result<Vec<Vector6<f64>>, Cancelled> {
    let count = poses.len();
    let slopes: Vec<Matrix6<f64>> =
        edges.iter().map(|edge| -carried(&(poses[edge.a].inverse() * poses[edge.b]))).collect();
    let mut right = vec![Vector6::zeros(); count];
    let mut diagonal = vec![Matrix6::identity() * 1e-6; count];
    for (((edge, weight), error), slope) in edges.iter().zip(weights).zip(errors).zip(&slopes) {
        let information = edge.information * *weight;
        right[edge.a] -= information * error;
        right[edge.b] -= slope.transpose() * information * error;
        diagonal[edge.a] += information;
        diagonal[edge.b] += slope.transpose() * information * slope;
    }
    let inverse: Vec<Matrix6<f64>> =
        diagonal.iter().map(|block| block.try_inverse().unwrap_or_else(Matrix6::identity)).collect();
    let hold = |values: &mut Vec<Vector6<f64>>| {
        values.iter_mut().zip(fixed).filter(|(_, fixed)| **fixed).for_each(|(value, _)| value.fill(0.0));
    };
    hold(&mut right);
    let times = |of: &[Vector6<f64>]| {
        if progress.cancelled() {
            // A product of zero ends the iterations.
            return vec![Vector6::zeros(); of.len()];
        }
        let mut out: Vec<Vector6<f64>> = of.iter().map(|value| value * 1e-6).collect();
        for ((edge, weight), slope) in edges.iter().zip(weights).zip(&slopes) {
            let pulled = edge.information * (of[edge.a] + slope * of[edge.b]) * *weight;
            out[edge.a] += pulled;
            out[edge.b] += slope.transpose() * pulled;
        }
        hold(&mut out);
        out
    };
    let eased = |of: &[Vector6<f64>]| of.iter().zip(&inverse).map(|(v, m)| m * v).collect::<Vec<_>>();
    // The matrix is positive definite: a small value is added to its diagonal.
    let (step, _) = conjugate_gradients(right, times, eased, 1e-16, 20 * count.max(10));
    progress::check(progress)?;
    Ok(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::progress::Silent;

    fn sure(a: usize, b: usize, b_from_a: Pose3, is_loop: bool) -> Edge {
        Edge { a, b, b_from_a, information: Matrix6::identity() * 1e4, is_loop }
    }

    /// Returns a walk around a square, its drift by odometry that turns too much at each step, and its edges.
    fn square() -> (Vec<Pose3>, Vec<Pose3>, Vec<Edge>) {
        let turn = |i: usize| if i % 5 == 4 { std::f64::consts::FRAC_PI_2 } else { 0.0 };
        let step = |i: usize, extra: f64| {
            Pose3::new(Vector3::new(0.5, 0.0, 0.0), Vector3::new(0.0, 0.0, turn(i) + extra))
        };
        let walk = |extra: f64| {
            (0..19).fold(vec![Pose3::identity()], |mut poses, i| {
                poses.push(poses[i] * step(i, extra));
                poses
            })
        };
        let edges = (0..19).map(|i| sure(i, i + 1, step(i, 0.004).inverse(), false)).collect();
        (walk(0.0), walk(0.004), edges)
    }

    fn worst_m(poses: &[Pose3], truth: &[Pose3]) -> f64 {
        let off = |(a, b): (&Pose3, &Pose3)| (a.translation.vector - b.translation.vector).norm();
        poses.iter().zip(truth).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn loops_take_drift_away() {
        let (truth, mut poses, mut edges) = square();
        let before_m = worst_m(&poses, &truth);
        edges.extend(
            [(0, 19), (1, 18), (0, 18)].map(|(a, b)| sure(a, b, truth[b].inverse() * truth[a], true)),
        );
        let believed = settle(&mut poses, &edges, &Silent).unwrap();
        assert!(believed.iter().all(|believed| *believed));
        assert!(worst_m(&poses, &truth) < 0.4 * before_m, "{} {before_m}", worst_m(&poses, &truth));
        assert_eq!(poses[0], Pose3::identity());
    }

    /// Planted loops between places that only look alike are rejected, and bend nothing.
    #[test]
    fn false_loops_are_rejected() {
        let (truth, mut right, mut edges) = square();
        edges.extend(
            [(0, 19), (1, 18), (0, 18)].map(|(a, b)| sure(a, b, truth[b].inverse() * truth[a], true)),
        );
        let mut poses = right.clone();
        settle(&mut right, &edges, &Silent).unwrap();
        let planted = [(2, 12), (7, 17), (4, 14)];
        edges.extend(planted.map(|(a, b)| sure(a, b, Pose3::translation(0.1, 0.05, 0.0), true)));
        let believed = settle(&mut poses, &edges, &Silent).unwrap();
        assert_eq!(believed.iter().filter(|believed| !**believed).count(), planted.len());
        assert!(believed[..22].iter().all(|believed| *believed));
        assert!(worst_m(&poses, &right) < 0.01, "{}", worst_m(&poses, &right));
    }
}
