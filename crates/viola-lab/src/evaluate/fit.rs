//! Fits the whole model to clips with ground truth: loss weights, temperature and probability.

use super::ClipResult;
use super::homes::FOREIGN;
use super::weights::learned_loss;
use viola_align::{Coefficient, FEATURES, MODEL, MadeBy, Model};

/// Weight of clips with the map of another home: half of the training data, but rare in the field.
const FOREIGN_WEIGHT: f64 = 0.35;

/// Returns the model fitted to these clips; none unless right and wrong answers are present.
///
/// Without clips that have a choice, the loss stays that of [`MODEL`]. `made_by` is the model's provenance.
pub fn fit(results: &[ClipResult], made_by: MadeBy) -> Option<Model> {
    let (intercept, coefficients) = regress(results)?;
    let learned = learned_loss(results, MODEL.loss.most_misplaced);
    let loss = learned.map_or(MODEL.loss, |learned| learned.weights);
    let temperature_m = learned.map_or(MODEL.temperature_m, |learned| learned.temperature_m);
    Some(Model { made_by, loss, temperature_m, intercept, coefficients })
}

/// Fits a ridge logistic regression by Newton's method.
fn regress(results: &[ClipResult]) -> Option<(f64, Vec<Coefficient>)> {
    const RIDGE: f64 = 1.0;
    const STEPS: usize = 50;
    let weight = |r: &ClipResult| if r.set.ends_with(FOREIGN) { FOREIGN_WEIGHT } else { 1.0 };
    let rows: Vec<(&[f64], bool, f64)> = results
        .iter()
        .filter_map(|r| Some((r.features.as_deref()?, r.first_is_right(), weight(r))))
        .filter(|(features, ..)| features.len() == FEATURES.len())
        .collect();
    if rows.iter().all(|(_, right, _)| *right) || rows.iter().all(|(_, right, _)| !right) {
        return None;
    }
    let count = rows.len() as f64;
    let moments: Vec<(f64, f64)> = (0..FEATURES.len())
        .map(|i| {
            let mean = rows.iter().map(|(x, ..)| x[i]).sum::<f64>() / count;
            let variance = rows.iter().map(|(x, ..)| (x[i] - mean).powi(2)).sum::<f64>() / count;
            (mean, variance.sqrt().max(1e-6))
        })
        .collect();
    let size = FEATURES.len() + 1;
    let standard: Vec<(nalgebra::DVector<f64>, f64, f64)> = rows
        .iter()
        .map(|(x, right, weight)| {
            let value = |i: usize| ((x[i] - moments[i].0) / moments[i].1).clamp(-4.0, 4.0);
            let row = nalgebra::DVector::from_fn(size, |i, _| if i == 0 { 1.0 } else { value(i - 1) });
            (row, f64::from(u8::from(*right)), *weight)
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
        for (row, right, weight) in &standard {
            let p = 1.0 / (1.0 + (-weights.dot(row)).exp());
            gradient.axpy(weight * (p - right), row, 1.0);
            hessian.ger(weight * (p * (1.0 - p)).max(1e-9), row, row, 1.0);
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
    Some((weights[0], (0..FEATURES.len()).map(coefficient).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_align::AlignmentState;

    /// Clips whose correctness depends only on the first feature x, with odds e^x.
    fn results() -> Vec<ClipResult> {
        (0..4000u64)
            .map(|i| {
                let x = ((i * 37) % 1000) as f64 / 100.0 - 5.0;
                // Evenly spread in 0..1, independent of x.
                let luck = ((i * 7919 + i / 1000 * 1231) % 997) as f64 / 997.0;
                let right = luck < 1.0 / (1.0 + (-x).exp());
                let mut features = vec![0.0; FEATURES.len()];
                features[0] = x;
                ClipResult {
                    features: Some(features),
                    truth_rank: right.then_some(0),
                    ..ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.1)))
                }
            })
            .collect()
    }

    fn made_by() -> MadeBy {
        let [command, fitted_to, commit] = ["", "test", ""].map(str::to_owned);
        MadeBy { command, fitted_to, commit, note: None }
    }

    #[test]
    fn finds_the_odds_that_made_the_data() {
        let model = fit(&results(), made_by()).unwrap();
        for x in [-3.0, -1.0, 0.0, 1.0, 3.0f64] {
            let mut features = [0.0; FEATURES.len()];
            features[0] = x;
            let want = 1.0 / (1.0 + (-x).exp());
            let got = model.probability(&features);
            assert!((got - want).abs() < 0.03, "{x}: {got} is not {want}");
        }
    }

    #[test]
    fn one_kind_of_answer_teaches_nothing() {
        let right: Vec<ClipResult> = results().into_iter().filter(|r| r.first_is_right()).collect();
        assert_eq!(fit(&right, made_by()), None);
        assert_eq!(fit(&[], made_by()), None);
    }
}
