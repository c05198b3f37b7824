//! Conjugate gradients for the normal equations of a pose graph.

use nalgebra::Vector6;

/// Solves a symmetric, positive definite system with one block for each pose, from zero (Hestenes and Stiefel, 1952).
/// `times` multiplies by the matrix, `precondition` by an approximation of its inverse. Ends after `max_iterations`, or
/// if the residual's squared length, measured with the preconditioner, is at most the fraction `goal` of the first.
///
/// Returns the solution so far, and false if the matrix is not positive definite.
pub fn conjugate_gradients(
    right: Vec<Vector6<f64>>,
    times: impl Fn(&[Vector6<f64>]) -> Vec<Vector6<f64>>,
    precondition: impl Fn(&[Vector6<f64>]) -> Vec<Vector6<f64>>,
    goal: f64,
    max_iterations: usize,
) -> (Vec<Vector6<f64>>, bool) {
    let mut solution = vec![Vector6::zeros(); right.len()];
    let mut residual = right;
    let mut direction = precondition(&residual);
    let mut length = dot(&residual, &direction);
    let goal = goal * length;
    for _ in 0..max_iterations {
        if length <= goal || length < f64::MIN_POSITIVE {
            break;
        }
        let image = times(&direction);
        let along = length / dot(&direction, &image);
        if !along.is_finite() || along <= 0.0 {
            return (solution, false);
        }
        for i in 0..solution.len() {
            solution[i] += direction[i] * along;
            residual[i] -= image[i] * along;
        }
        let toward = precondition(&residual);
        let next = dot(&residual, &toward);
        for i in 0..solution.len() {
            direction[i] = toward[i] + direction[i] * (next / length);
        }
        length = next;
    }
    (solution, true)
}

fn dot(a: &[Vector6<f64>], b: &[Vector6<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solves a chain of four poses: `diagonal` times each block, minus its neighbours.
    fn solved(right: &[Vector6<f64>], diagonal: f64) -> (Vec<Vector6<f64>>, bool) {
        let times = |of: &[Vector6<f64>]| chain(of, diagonal);
        let precondition = |of: &[Vector6<f64>]| of.iter().map(|block| block / diagonal).collect::<Vec<_>>();
        conjugate_gradients(right.to_vec(), times, precondition, 1e-24, 100)
    }

    fn chain(of: &[Vector6<f64>], diagonal: f64) -> Vec<Vector6<f64>> {
        let near = |i: Option<usize>| i.and_then(|i| of.get(i)).copied().unwrap_or_else(Vector6::zeros);
        (0..of.len()).map(|i| of[i] * diagonal - near(i.checked_sub(1)) - near(Some(i + 1))).collect()
    }

    #[test]
    fn a_definite_system_is_solved_and_an_indefinite_one_is_reported() {
        let right: Vec<Vector6<f64>> =
            (0..4).map(|i| Vector6::from_fn(|row, _| f64::from(i) - 0.3 * row as f64)).collect();
        let (solution, is_definite) = solved(&right, 2.5);
        let off = chain(&solution, 2.5).iter().zip(&right).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        assert!(is_definite && off < 1e-9, "{off}");
        // The smallest eigenvalue of the chain is that of its diagonal minus 1.618.
        assert!(!solved(&right, 1.0).1);
        let zeros: Vec<Vector6<f64>> = vec![Vector6::zeros(); 4];
        assert_eq!(solved(&zeros, 2.5), (zeros, true));
    }
}
