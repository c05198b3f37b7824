//! Fits the whole model to clips with ground truth: loss weights, temperature, probability and covariance.

mod spread;

use super::weights::learned_loss;
use super::{ClipResult, Listed, Placement};
use std::collections::BTreeSet;
use viola_align::{
    Alternative, Coefficient, Evidence, FEATURES, LossWeights, MODEL, MadeBy, Model, features,
    fraction_of_odds,
};

/// Weight of clips with the map of another home. They are half of the training data; with this weight, one clip in eleven.
const FOREIGN_WEIGHT: f64 = 0.1;

/// Returns the model fitted to these clips; none unless right and wrong answers are present.
///
/// The loss comes first; then the alternatives are ranked by it, and the probability is fitted to the new ranks.
/// The loss stays that of [`MODEL`] unless a learned one ranks clips of other homes clearly better. `made_by` is the model's
/// provenance.
pub fn fit(results: &[ClipResult], made_by: MadeBy) -> Option<Model> {
    let learned = learned_loss(results, &MODEL.loss).filter(|_| learning_pays(results));
    let mut model = Model {
        made_by,
        loss: learned.map_or(MODEL.loss, |learned| learned.weights),
        temperature_m: learned.map_or(MODEL.temperature_m, |learned| learned.temperature_m),
        bound: MODEL.bound,
        intercept: 0.0,
        coefficients: Vec::new(),
        covariance: MODEL.covariance,
    };
    let answers: Vec<Answer> = results.iter().filter_map(|result| Answer::of(result, &model)).collect();
    (model.intercept, model.coefficients) = regress(&answers)?;
    model.bound = likeliest_bound(&answers, &model);
    let right = results.iter().filter(|result| result.is_success());
    let placed: Vec<Placement> = right.filter_map(|result| result.placement).collect();
    model.covariance = spread::fit(&placed).unwrap_or(MODEL.covariance);
    Some(model)
}

/// Minimum fraction of the clips that a learned loss wins in other homes. With less, its probabilities were worse
/// (docs/experiments.md, Probability).
const MIN_GAIN: f64 = 0.01;

/// Returns whether a loss that was learned on half of the homes ranks the true pose first in clearly more clips of the
/// other half than that of [`MODEL`], both ways together.
fn learning_pays(results: &[ClipResult]) -> bool {
    let homes: BTreeSet<&str> = results.iter().map(home).collect();
    let odd: BTreeSet<&str> = homes.into_iter().skip(1).step_by(2).collect();
    let known = results.iter().filter(|result| !result.foreign).count();
    let (odd, even): (Vec<ClipResult>, Vec<ClipResult>) =
        results.iter().cloned().partition(|result| odd.contains(home(result)));
    let gain = |train: &[ClipResult], test: &[ClipResult]| {
        let learned = learned_loss(train, &MODEL.loss)?;
        Some(ranked_right(test, &learned.weights) as i64 - ranked_right(test, &MODEL.loss) as i64)
    };
    gain(&odd, &even).zip(gain(&even, &odd)).is_some_and(|(a, b)| (a + b) as f64 > MIN_GAIN * known as f64)
}

/// Returns the name of a clip's home, which starts the clip's name.
fn home(result: &ClipResult) -> &str {
    result.clip.split('_').next().unwrap_or_default()
}

/// Returns the number of clips whose true pose has the least loss.
fn ranked_right(results: &[ClipResult], weights: &LossWeights) -> usize {
    let is_right = |result: &&ClipResult| {
        let losses = result
            .alternatives
            .iter()
            .filter_map(|listed| listed.evidence.map(|evidence| (weights.loss_m(&evidence), listed.right)));
        losses.min_by(|a, b| a.0.total_cmp(&b.0)).is_some_and(|(_, right)| right)
    };
    results.iter().filter(is_right).count()
}

/// An answer to learn the probability from.
#[derive(Debug, Clone, Copy)]
struct Answer {
    features: [f64; FEATURES.len()],
    /// Bounds of the probability, for each of [`BOUNDS`].
    fractions: [f64; BOUNDS.len()],
    right: bool,
    weight: f64,
}

/// Candidates for the factor of the temperature in the bound by the odds.
const BOUNDS: [f64; 5] = [1.0, 0.75, 0.5, 0.35, 0.25];

/// Returns the bound that makes the answers likeliest.
fn likeliest_bound(answers: &[Answer], model: &Model) -> f64 {
    let log_likelihood = |bound: usize| -> f64 {
        let of = |answer: &Answer| {
            let p = model.probability(&answer.features).min(answer.fractions[bound]).clamp(1e-6, 1.0 - 1e-6);
            answer.weight * if answer.right { p.ln() } else { (1.0 - p).ln() }
        };
        answers.iter().map(of).sum()
    };
    let scored = (0..BOUNDS.len()).map(|bound| (log_likelihood(bound), BOUNDS[bound]));
    // The larger of equal ones, which is more careful, comes last.
    scored.rev().max_by(|a, b| a.0.total_cmp(&b.0)).map_or(1.0, |best| best.1)
}

impl Answer {
    /// Returns the answer of a clip by the model's loss and temperature; none without evidence.
    fn of(result: &ClipResult, model: &Model) -> Option<Answer> {
        let evidence = |listed: &Listed| Some((*listed, listed.evidence?));
        let listed: Vec<(Listed, Evidence)> =
            result.alternatives.iter().map(evidence).collect::<Option<_>>()?;
        let mut ranked: Vec<(Alternative, bool)> = listed
            .iter()
            .map(|(listed, evidence)| {
                let of = Alternative::of(listed.level, listed.map_from_clip, evidence, &model.loss);
                (of, listed.right)
            })
            .collect();
        ranked.sort_by(|a, b| a.0.loss_m.total_cmp(&b.0.loss_m));
        let right = ranked.first()?.1;
        let alternatives: Vec<Alternative> = ranked.into_iter().map(|(alternative, _)| alternative).collect();
        let temperature_m = model.temperature_m(result.hits);
        let features = features(&alternatives, temperature_m)?;
        let mut fractions = [1.0; BOUNDS.len()];
        for (fraction, bound) in fractions.iter_mut().zip(BOUNDS) {
            *fraction = fraction_of_odds(&alternatives, temperature_m * bound)?;
        }
        let weight = if result.foreign { FOREIGN_WEIGHT } else { 1.0 };
        Some(Answer { features, fractions, right, weight })
    }
}

/// Sign of the effect of each of [`FEATURES`].
const SIGNS: [f64; FEATURES.len()] = [1.0, -1.0, -1.0, 1.0];

/// Fits the regression; a feature whose effect would have the wrong sign has none.
fn regress(answers: &[Answer]) -> Option<(f64, Vec<Coefficient>)> {
    let mut used = [true; FEATURES.len()];
    loop {
        let (intercept, coefficients) = regress_on(answers, &used)?;
        let wrong = coefficients.iter().zip(SIGNS).position(|(c, sign)| c.weight * sign < 0.0);
        match wrong {
            Some(wrong) => used[wrong] = false,
            None => return Some((intercept, coefficients)),
        }
    }
}

/// Fits a ridge logistic regression by Newton's method; the weights of features that are not used are 0.
fn regress_on(answers: &[Answer], used: &[bool]) -> Option<(f64, Vec<Coefficient>)> {
    const RIDGE: f64 = 1.0;
    const STEPS: usize = 50;
    if answers.iter().all(|answer| answer.right) || answers.iter().all(|answer| !answer.right) {
        return None;
    }
    let count = answers.len() as f64;
    let moments: Vec<(f64, f64)> = (0..FEATURES.len())
        .map(|i| {
            let values = || answers.iter().map(|answer| answer.features[i]);
            let mean = values().sum::<f64>() / count;
            let variance = values().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
            (mean, variance.sqrt().max(1e-6))
        })
        .collect();
    let size = FEATURES.len() + 1;
    let standard: Vec<(nalgebra::DVector<f64>, f64, f64)> = answers
        .iter()
        .map(|Answer { features, right, weight, .. }| {
            let value = |i: usize| ((features[i] - moments[i].0) / moments[i].1).clamp(-4.0, 4.0);
            let row = nalgebra::DVector::from_fn(size, |i, _| match i {
                0 => 1.0,
                i if used[i - 1] => value(i - 1),
                _ => 0.0,
            });
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

    /// Answers whose correctness depends only on the first feature x, with odds e^x.
    fn answers() -> Vec<Answer> {
        (0..4000u64)
            .map(|i| {
                let x = ((i * 37) % 1000) as f64 / 100.0 - 5.0;
                // Evenly spread in 0..1, independent of x.
                let luck = ((i * 7919 + i / 1000 * 1231) % 997) as f64 / 997.0;
                let mut features = [0.0; FEATURES.len()];
                features[0] = x;
                let right = luck < 1.0 / (1.0 + (-x).exp());
                Answer { features, fractions: [1.0; BOUNDS.len()], right, weight: 1.0 }
            })
            .collect()
    }

    fn listed(right: bool, distance_m: f64, blocked_rays: f64) -> Listed {
        let evidence = Evidence { distance_m, blocked_rays, ..Evidence::default() };
        Listed { right, evidence: Some(evidence), ..Listed::example() }
    }

    fn model((intercept, coefficients): (f64, Vec<Coefficient>)) -> Model {
        Model { intercept, coefficients, ..MODEL.clone() }
    }

    #[test]
    fn finds_the_odds_that_made_the_data() {
        let model = model(regress(&answers()).unwrap());
        for x in [-3.0, -1.0, 0.0, 1.0, 3.0f64] {
            let mut features = [0.0; FEATURES.len()];
            features[0] = x;
            let want = 1.0 / (1.0 + (-x).exp());
            let got = model.probability(&features);
            assert!((got - want).abs() < 0.03, "{x}: {got} is not {want}");
        }
    }

    /// Beside a rival with its loss an answer is right in half of the cases, whatever its features.
    #[test]
    fn the_bound_is_as_tight_as_the_rivals_are_right() {
        let with = |fractions: [f64; BOUNDS.len()]| {
            let answers: Vec<Answer> =
                (0..100).map(|i| Answer { fractions, right: i % 2 == 0, ..answers()[0] }).collect();
            likeliest_bound(&answers, &Model { intercept: 9.0, coefficients: Vec::new(), ..MODEL.clone() })
        };
        assert_eq!(with([0.1, 0.3, 0.5, 0.7, 0.9]), BOUNDS[2]);
        assert_eq!(with([0.5; BOUNDS.len()]), BOUNDS[0]);
    }

    #[test]
    fn one_kind_of_answer_teaches_nothing() {
        let right: Vec<Answer> = answers().into_iter().filter(|answer| answer.right).collect();
        assert!(regress(&right).is_none());
        assert!(regress(&[]).is_none());
    }

    /// In half of the clips of three homes, the true pose has more distance and fewer blocked rays than the wrong one.
    #[test]
    fn a_loss_is_learned_only_if_it_ranks_other_homes_better() {
        let clips = |blocked_rays: f64| -> Vec<ClipResult> {
            let example = ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.1)));
            let clip = |i: usize| {
                let wrong = if i.is_multiple_of(2) {
                    listed(false, 0.02, blocked_rays)
                } else {
                    listed(false, 0.06, 0.0)
                };
                ClipResult {
                    clip: format!("{:06}_{i}", i / 2 % 3),
                    alternatives: vec![wrong, listed(true, 0.03, 0.0)],
                    ..example.clone()
                }
            };
            (0..600).map(clip).collect()
        };
        let known = MODEL.loss.blocked_m;
        assert!(known * 0.4 < 0.01 && known > 0.01, "the cases need another weight than {known}");
        assert!(learning_pays(&clips(0.4)));
        assert!(!learning_pays(&clips(1.0)));
        assert!(!learning_pays(&[]));
    }

    /// The learned loss may turn the ranks; the probability is that of the new first.
    #[test]
    fn answers_are_ranked_by_the_learned_loss() {
        let result = ClipResult {
            alternatives: vec![listed(false, 0.02, 1.0), listed(true, 0.03, 0.0)],
            ..ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.1)))
        };
        for (blocked_m, right) in [(0.0, false), (0.05, true)] {
            let model = Model { loss: LossWeights { blocked_m, ..MODEL.loss }, ..MODEL.clone() };
            assert_eq!(Answer::of(&result, &model).unwrap().right, right, "{blocked_m}");
        }
    }
}
