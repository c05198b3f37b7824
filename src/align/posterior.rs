//! How probable it is that the best pose is right, from what the answer shows, calibrated on simulated homes.
//!
//! A logistic regression on a dozen figures of the answer. Its coefficients are in `posterior.json`, which
//! `viola evaluate --fit` writes from simulated clips with known truth (seeds 0-999; tables are made from
//! others).

use super::{Alignment, Alternative};
use crate::geometry::angle_between;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// The figures, by name.
pub const FEATURES: [&str; 12] = [
    "gap",
    "near_gap",
    "gap_hits",
    "loss",
    "inliers",
    "log_hits",
    "coverage",
    "blocked_rays",
    "hits_on_floor",
    "walls_on_floor",
    "log_sigma",
    "rivals",
];

/// A rival further than either of these from the best pose is a different explanation (paper's theta_T and
/// theta_R).
const CLOSE_M: f64 = 0.3;
const CLOSE_DEG: f64 = 20.0;
/// Below this a gap is noise as likely as not, so its size counts on a scale of its own.
const NEAR_GAP_M: f64 = 0.008;
/// A rival that loses by this much is e times less probable. The fit of the loss's own weights to training clips gives
/// 6 mm, which holds where the truth is listed; at 12 mm half as many of the training clips whose truth cannot be known,
/// or that belong to another home, are called `aligned`, for one in 20 of the others.
const TEMPERATURE_M: f64 = 0.012;
/// Answers have so many alternatives, and the figures are of no more where more are listed.
const LISTED: usize = 8;
/// A rival within this explains the clip nearly as well.
const NEAR_RIVAL_M: f64 = 0.02;

/// The explanations that are not close to the best one.
fn rivals(alternatives: &[Alternative]) -> impl Iterator<Item = &Alternative> {
    let best = alternatives.first().map(|best| best.map_from_clip).unwrap_or_default();
    alternatives.iter().take(LISTED).skip(1).filter(move |a| {
        a.map_from_clip.distance_m(&best) > CLOSE_M
            || angle_between(a.map_from_clip.yaw_rad, best.yaw_rad).to_degrees() > CLOSE_DEG
    })
}

/// How many different explanations lose by less than [`NEAR_RIVAL_M`].
pub fn near_rivals(alignment: &Alignment) -> usize {
    let Some(best) = alignment.alternatives.first() else { return 0 };
    rivals(&alignment.alternatives).filter(|a| a.loss_m - best.loss_m < NEAR_RIVAL_M).count()
}

/// The figures of an answer, in the order of [`FEATURES`]; none when it has no pose to judge.
pub fn features(alignment: &Alignment) -> Option<[f64; FEATURES.len()]> {
    let best = alignment.alternatives.first()?;
    let free_space = best.free_space?;
    // A rival 10 cm worse is as good as none.
    let gap_m = rivals(&alignment.alternatives).map(|a| a.loss_m - best.loss_m).fold(0.1, f64::min);
    let log_hits = (alignment.hits.max(1) as f64 / 100.0).ln();
    let covariance = alignment.covariance.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let sigma_m = (covariance[0][0] + covariance[1][1]).sqrt();
    Some([
        gap_m,
        gap_m.min(NEAR_GAP_M),
        gap_m * (log_hits + 2.0),
        best.loss_m,
        best.inliers,
        log_hits,
        alignment.coverage.unwrap_or(0.0).sqrt(),
        free_space.blocked_rays,
        free_space.hits_on_floor,
        free_space.walls_on_floor,
        sigma_m.max(1e-4).ln(),
        near_rivals(alignment) as f64,
    ])
}

/// A logistic regression on standardised figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// What it was fitted to, in words.
    pub fitted_to: String,
    pub intercept: f64,
    pub coefficients: Vec<Coefficient>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    pub feature: String,
    /// The figure's mean and spread in the training clips.
    pub mean: f64,
    pub scale: f64,
    pub weight: f64,
}

/// The checked-in coefficients.
pub static POSTERIOR: LazyLock<Posterior> = LazyLock::new(|| {
    serde_json::from_str(include_str!("posterior.json")).expect("posterior.json is checked in and tested")
});

impl Posterior {
    /// Probability that the first alternative is the right pose.
    pub fn probability(&self, features: &[f64; FEATURES.len()]) -> f64 {
        let terms = self.coefficients.iter().zip(features).map(|(c, x)| {
            // Beyond what training saw, the figure says no more than at its edge.
            c.weight * ((x - c.mean) / c.scale).clamp(-4.0, 4.0)
        });
        1.0 / (1.0 + (-(self.intercept + terms.sum::<f64>())).exp())
    }

    /// Puts probabilities into an answer: the best pose's from the regression, but no more than its gap to
    /// the next explanation allows; the rest shared among the other explanations by their losses, with some
    /// kept for a place that is not listed.
    pub fn judge(&self, alignment: &mut Alignment) {
        const ELSEWHERE: f64 = 0.25;
        let Some(features) = features(alignment) else { return };
        // Whatever else speaks for the best pose speaks for a rival with nearly its loss, too.
        let ceiling = 1.0 / (1.0 + (-features[0] / TEMPERATURE_M).exp());
        let best = self.probability(&features).min(ceiling);
        let loss_m = alignment.alternatives[0].loss_m;
        let weight = |a: &Alternative| (-(a.loss_m - loss_m) / TEMPERATURE_M).exp();
        let sum: f64 = ELSEWHERE + alignment.alternatives.iter().skip(1).map(weight).sum::<f64>();
        for (rank, alternative) in alignment.alternatives.iter_mut().enumerate() {
            let other = ((1.0 - best) * weight(alternative) / sum).min(best);
            alternative.probability = Some(if rank == 0 { best } else { other });
        }
        alignment.probability = Some(best);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checked_in_coefficients_are_for_these_features() {
        let names: Vec<&str> = POSTERIOR.coefficients.iter().map(|c| c.feature.as_str()).collect();
        assert_eq!(names, FEATURES);
        assert!(POSTERIOR.coefficients.iter().all(|c| c.scale > 0.0 && c.weight.is_finite()));
    }
}
