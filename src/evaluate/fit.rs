//! Fits the probability of an answer to clips with known truth.

use super::ClipResult;
use crate::align::{Coefficient, FEATURES, Posterior};

/// Logistic regression with a ridge, by Newton's method. None when right or wrong answers are missing.
pub fn fit(results: &[ClipResult], fitted_to: String) -> Option<Posterior> {
    const RIDGE: f64 = 1.0;
    const STEPS: usize = 50;
    let rows: Vec<(&[f64], bool)> = results
        .iter()
        .filter_map(|r| Some((r.features.as_deref()?, r.first_is_right())))
        .filter(|(features, _)| features.len() == FEATURES.len())
        .collect();
    if rows.iter().all(|(_, right)| *right) || rows.iter().all(|(_, right)| !right) {
        return None;
    }
    let count = rows.len() as f64;
    let moments: Vec<(f64, f64)> = (0..FEATURES.len())
        .map(|i| {
            let mean = rows.iter().map(|(x, _)| x[i]).sum::<f64>() / count;
            let variance = rows.iter().map(|(x, _)| (x[i] - mean).powi(2)).sum::<f64>() / count;
            (mean, variance.sqrt().max(1e-6))
        })
        .collect();
    let size = FEATURES.len() + 1;
    let standard: Vec<(nalgebra::DVector<f64>, f64)> = rows
        .iter()
        .map(|(x, right)| {
            let value = |i: usize| ((x[i] - moments[i].0) / moments[i].1).clamp(-4.0, 4.0);
            let row = nalgebra::DVector::from_fn(size, |i, _| if i == 0 { 1.0 } else { value(i - 1) });
            (row, f64::from(u8::from(*right)))
        })
        .collect();
    let mut weights = nalgebra::DVector::<f64>::zeros(size);
    for _ in 0..STEPS {
        let mut gradient = nalgebra::DVector::<f64>::zeros(size);
        let mut hessian = nalgebra::DMatrix::<f64>::identity(size, size) * RIDGE;
        hessian[(0, 0)] = 1e-6;
        for i in 1..size {
            gradient[i] = RIDGE * weights[i];
        }
        for (row, right) in &standard {
            let p = 1.0 / (1.0 + (-weights.dot(row)).exp());
            gradient.axpy(p - right, row, 1.0);
            hessian.ger((p * (1.0 - p)).max(1e-9), row, row, 1.0);
        }
        let step = hessian.cholesky()?.solve(&gradient);
        weights -= &step;
        if step.norm() < 1e-9 {
            break;
        }
    }
    let coefficient = |i: usize| Coefficient {
        feature: FEATURES[i].to_owned(),
        mean: moments[i].0,
        scale: moments[i].1,
        weight: weights[i + 1],
    };
    Some(Posterior {
        fitted_to,
        intercept: weights[0],
        coefficients: (0..FEATURES.len()).map(coefficient).collect(),
    })
}
