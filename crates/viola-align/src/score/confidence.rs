//! Probability that the best pose is right, calibrated on simulated homes. Only this module sets it.
//!
//! A logistic regression on features of the answer, at most the answer's fraction of the odds of all
//! explanations, capped by facts that the features do not include. The coefficients are those of [`MODEL`].

use super::model::{MODEL, Model};
use crate::answer::{Alignment, Alternative, FreeSpace};

/// Names of the features: log odds against all different explanations, and three kinds of evidence of the pose. They
/// separate clips of other homes better than the loss, which has them with its own weights.
pub const FEATURES: [&str; 4] = ["odds", "walls_on_floor", "unseen_sides", "inliers"];

/// Features use at most this many alternatives.
const LISTED: usize = 8;
/// Odds of unlisted explanations, which bound the log odds at 3.9.
const UNLISTED_ODDS: f64 = 0.02;
/// Odds that a clip or a map has another unit than it says, before anything is seen (docs/experiments.md).
const WRONG_UNIT_ODDS: f64 = 1e-2;
/// Maximum difference in loss of a rival that explains the clip nearly as well.
const NEAR_RIVAL_M: f64 = 0.02;

/// Returns the explanations that are not close to the best one: distant poses and those on other levels.
fn rivals(alternatives: &[Alternative]) -> impl Iterator<Item = &Alternative> {
    let best = alternatives.first();
    alternatives
        .iter()
        .take(LISTED)
        .skip(1)
        .filter(move |other| best.is_some_and(|best| other.is_different_from(best)))
}

/// Returns the number of different explanations that lose by less than [`NEAR_RIVAL_M`].
pub fn near_rivals(alignment: &Alignment) -> usize {
    let Some(best) = alignment.alternatives.first() else { return 0 };
    rivals(&alignment.alternatives).filter(|a| a.loss_m - best.loss_m < NEAR_RIVAL_M).count()
}

/// Returns the number of other scales whose explanation loses by less than [`NEAR_RIVAL_M`].
pub fn near_scales(alignment: &Alignment) -> usize {
    alignment.scale_rival_gaps_m.iter().filter(|gap_m| **gap_m < NEAR_RIVAL_M).count()
}

/// Returns the features of an answer, in the order of [`FEATURES`]; `None` without a pose to judge.
/// `alternatives` are sorted by loss, `temperature_m` is that of the clip's hits.
pub fn features(alternatives: &[Alternative], temperature_m: f64) -> Option<[f64; FEATURES.len()]> {
    let best = alternatives.first()?;
    let FreeSpace { walls_on_floor, unseen_sides, .. } = best.free_space?;
    let against = odds_against(alternatives, temperature_m)?;
    Some([-against.ln(), walls_on_floor, unseen_sides, best.inliers])
}

/// Returns the odds of all different explanations against the best one; `None` without a pose.
fn odds_against(alternatives: &[Alternative], temperature_m: f64) -> Option<f64> {
    let best = alternatives.first()?;
    let odds = |rival: &Alternative| (-(rival.loss_m - best.loss_m) / temperature_m).exp();
    Some(UNLISTED_ODDS + rivals(alternatives).map(odds).sum::<f64>())
}

/// Returns the best pose's fraction of the odds, which bounds its probability: whatever speaks for it speaks for a rival
/// with the same loss, too. `temperature_m` is that of the bound.
pub fn fraction_of_odds(alternatives: &[Alternative], temperature_m: f64) -> Option<f64> {
    odds_against(alternatives, temperature_m).map(|against| 1.0 / (1.0 + against))
}

/// Facts about an answer that cap its probability; its features do not include them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProbabilityCaps {
    /// True if the search ended at its budget: an unsearched pose may explain the clip as well.
    pub search_incomplete: bool,
    /// True if the camera was tracked from frames that are far apart.
    pub sparse_track: bool,
}

/// Maximum probability if the search was incomplete.
const MAX_AFTER_INCOMPLETE_SEARCH: f64 = 0.5;
/// Maximum probability if the camera was tracked from sparse frames: of the simulated clips at 2.5 frames a
/// second that were reported as aligned, 13 % were wrong (docs/experiments.md).
const MAX_FOR_SPARSE_TRACK: f64 = 0.85;

/// Sets the probabilities of an answer; returns that of the best pose before the caps.
pub fn set_probabilities(answer: &mut Alignment, caps: ProbabilityCaps) -> Option<f64> {
    regress(answer, &MODEL);
    let uncapped = answer.probability;
    if caps.search_incomplete {
        cap(&mut answer.probability, MAX_AFTER_INCOMPLETE_SEARCH);
        for alternative in &mut answer.alternatives {
            cap(&mut alternative.probability, MAX_AFTER_INCOMPLETE_SEARCH);
        }
    }
    if caps.sparse_track {
        cap(&mut answer.probability, MAX_FOR_SPARSE_TRACK);
        if let Some(first) = answer.alternatives.first_mut() {
            cap(&mut first.probability, MAX_FOR_SPARSE_TRACK);
        }
    }
    uncapped
}

fn cap(probability: &mut Option<f64>, most: f64) {
    *probability = probability.map(|p| p.min(most));
}

/// Returns the odds of explanations at other scales against the best one. A unit that was withheld may be any; one
/// that was told is rarely wrong.
fn odds_of_other_scales(answer: &Alignment, temperature_m: f64) -> f64 {
    let odds = |gap_m: f64| (-gap_m / temperature_m).exp();
    let withheld: f64 = answer.scale_rival_gaps_m.iter().map(|gap_m| odds(*gap_m)).sum();
    let wrong = answer.better_scale.map_or(0.0, |better| WRONG_UNIT_ODDS * odds(-better.gain_m));
    withheld + wrong
}

/// Sets the regression's probability for the best pose, at most its fraction of the odds. The rest is divided among the
/// other explanations by their losses, with a part for unlisted poses.
fn regress(answer: &mut Alignment, model: &Model) {
    const ELSEWHERE: f64 = 0.25;
    let temperature_m = model.temperature_m(answer.hits);
    let Some(mut features) = features(&answer.alternatives, temperature_m) else { return };
    let Some(mut fraction) = fraction_of_odds(&answer.alternatives, temperature_m * model.bound) else {
        return;
    };
    let at_other_scales = odds_of_other_scales(answer, temperature_m);
    if at_other_scales > 0.0 {
        features[0] = -((-features[0]).exp() + at_other_scales).ln();
        fraction = 1.0 / (1.0 / fraction + at_other_scales);
    }
    let best = model.probability(&features).min(fraction);
    let loss_m = answer.alternatives[0].loss_m;
    let weight = |a: &Alternative| (-(a.loss_m - loss_m) / temperature_m).exp();
    let sum: f64 = ELSEWHERE + answer.alternatives.iter().skip(1).map(weight).sum::<f64>();
    for (rank, alternative) in answer.alternatives.iter_mut().enumerate() {
        let other = ((1.0 - best) * weight(alternative) / sum).min(best);
        alternative.probability = Some(if rank == 0 { best } else { other });
    }
    answer.probability = Some(best);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BetterScale, Evidence};
    use viola_geometry::{LevelName, Pose2};

    #[test]
    fn the_checked_in_coefficients_are_for_these_features() {
        let names: Vec<&str> = MODEL.coefficients.iter().map(|c| c.feature.as_str()).collect();
        assert_eq!(names, FEATURES);
        assert!(MODEL.coefficients.iter().all(|c| c.scale > 0.0 && c.weight.is_finite()));
    }

    /// Returns an answer as sure as the model can be.
    fn sure() -> Alignment {
        let evidence = Evidence { distance_m: 0.02, inliers: 1.0, ..Evidence::default() };
        let best = Alternative::of(LevelName::MAIN, Pose2::default(), &evidence, &MODEL.loss);
        Alignment { alternatives: vec![best], hits: 500, coverage: Some(0.5), ..Alignment::failed() }
    }

    /// Returns the probability of a sure answer with a rival that loses by `gap_m`.
    fn beside_a_rival(gap_m: f64, hits: usize) -> f64 {
        let mut answer = sure();
        let mut rival = answer.alternatives[0].clone();
        rival.map_from_clip = Pose2::new(3.0, 0.0, 0.0);
        rival.loss_m += gap_m;
        answer.alternatives.push(rival);
        answer.hits = hits;
        set_probabilities(&mut answer, ProbabilityCaps { search_incomplete: false, sparse_track: false });
        let rival = answer.alternatives[1].probability.unwrap();
        assert!(rival <= answer.probability.unwrap());
        answer.probability.unwrap()
    }

    #[test]
    fn a_worse_rival_and_more_evidence_make_an_answer_surer() {
        let by_gap = [0.0, 0.002, 0.005, 0.01, 0.02, 0.05].map(|gap_m| beside_a_rival(gap_m, 200));
        assert!(by_gap.is_sorted(), "{by_gap:?}");
        assert!(by_gap[0] < 0.5 && by_gap[5] > 0.9, "{by_gap:?}");
        let by_hits = [50, 100, 200, 400, 800].map(|hits| beside_a_rival(0.01, hits));
        assert!(by_hits.is_sorted(), "{by_hits:?}");
    }

    #[test]
    fn a_better_scale_is_a_rival() {
        let at_gain = |gain_m: f64| {
            let mut answer = sure();
            answer.better_scale = Some(BetterScale { factor: 1.1, gain_m });
            set_probabilities(&mut answer, ProbabilityCaps { search_incomplete: false, sparse_track: false });
            answer.probability.unwrap()
        };
        let by_gain = [0.0, 0.005, 0.01, 0.02, 0.04].map(at_gain);
        assert!(by_gain.is_sorted_by(|a, b| a > b), "{by_gain:?}");
        assert!(by_gain[0] > 0.95 && by_gain[4] < 0.1, "{by_gain:?}");
    }

    fn check(caps: ProbabilityCaps, most: f64) {
        let mut answer = sure();
        let uncapped = set_probabilities(&mut answer, caps);
        let probability = answer.probability.unwrap();
        assert!(probability <= most && uncapped.unwrap() > most, "{caps:?} {probability} {uncapped:?}");
        assert_eq!(answer.alternatives[0].probability, answer.probability);
    }

    #[test]
    fn doubts_cap_the_probability() {
        let none = ProbabilityCaps { search_incomplete: false, sparse_track: false };
        let mut answer = sure();
        set_probabilities(&mut answer, none);
        assert!(answer.probability.unwrap() > MAX_FOR_SPARSE_TRACK, "{:?}", answer.probability);
        check(ProbabilityCaps { sparse_track: true, ..none }, MAX_FOR_SPARSE_TRACK);
        check(ProbabilityCaps { search_incomplete: true, ..none }, MAX_AFTER_INCOMPLETE_SEARCH);
        check(ProbabilityCaps { search_incomplete: true, sparse_track: true }, MAX_AFTER_INCOMPLETE_SEARCH);
    }
}
