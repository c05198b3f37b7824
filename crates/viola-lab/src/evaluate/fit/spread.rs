//! Fits the calibration of the covariance to the errors of right answers.

use super::Placement;
use nalgebra::{Matrix3, Vector3};
use viola_align::CovarianceModel;

/// Starting point, and the factors by which each number is varied until none of them is better.
const START: CovarianceModel = CovarianceModel { scale: 1.0, floor_m: 0.01, floor_rad: 0.002 };
const FACTORS: [f64; 3] = [2.0, 1.2, 1.03];
const ROUNDS: usize = 40;

/// Returns the calibration of the greatest likelihood of the errors; `None` without errors.
pub(super) fn fit(placed: &[Placement]) -> Option<CovarianceModel> {
    if placed.is_empty() {
        return None;
    }
    let mut best = START;
    for factor in FACTORS {
        for _ in 0..ROUNDS {
            let tried = [factor, 1.0 / factor].into_iter().flat_map(|by| {
                [
                    CovarianceModel { scale: best.scale * by, ..best },
                    CovarianceModel { floor_m: best.floor_m * by, ..best },
                    CovarianceModel { floor_rad: best.floor_rad * by, ..best },
                ]
            });
            let better = tried.min_by(|a, b| cost(a, placed).total_cmp(&cost(b, placed)));
            match better {
                Some(better) if cost(&better, placed) < cost(&best, placed) => best = better,
                _ => break,
            }
        }
    }
    Some(best)
}

/// Returns the negative logarithm of the likelihood, without constants.
fn cost(model: &CovarianceModel, placed: &[Placement]) -> f64 {
    let of = |placed: &Placement| {
        let covariance = model.calibrated(&Matrix3::from(placed.spread));
        let Some(root) = covariance.cholesky() else { return f64::INFINITY };
        let error = Vector3::from(placed.error);
        root.determinant().ln() + error.dot(&root.solve(&error))
    };
    placed.iter().map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn finds_the_calibration_that_made_the_errors() {
        let truth = CovarianceModel { scale: 1.6, floor_m: 0.02, floor_rad: 0.004 };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let placed: Vec<Placement> = (0..4000)
            .map(|i| {
                let sigma = 0.003 * f64::from(1 + i % 10);
                let spread =
                    Matrix3::from_diagonal(&Vector3::new(sigma, 2.0 * sigma, 0.2 * sigma).map(|s| s * s));
                let root = truth.calibrated(&spread).cholesky().unwrap();
                let error: Vector3<f64> = root.l() * Vector3::from_fn(|_, _| normal());
                let covariance = truth.calibrated(&spread).into();
                Placement { error: error.into(), spread: spread.into(), covariance }
            })
            .collect();
        let found = fit(&placed).unwrap();
        for (found, want) in
            [(found.scale, truth.scale), (found.floor_m, truth.floor_m), (found.floor_rad, truth.floor_rad)]
        {
            assert!((found / want - 1.0).abs() < 0.1, "{found} is not {want}");
        }
        let mean = placed.iter().map(Placement::nees).sum::<f64>() / placed.len() as f64;
        assert!((mean - 3.0).abs() < 0.15, "{mean}");
        assert_eq!(fit(&[]), None);
    }
}
