//! Probability that the best pose is right, calibrated on simulated homes. Only this module sets it.
//!
//! A logistic regression on a dozen features of the answer, capped by doubts that the features do not
//! include. The coefficients are those of [`MODEL`].

use super::model::{MODEL, Model};
use crate::answer::{Alignment, Alternative};

/// Names of the features.
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

/// A smaller gap is noise as likely as not, so its size has a feature of its own.
const NEAR_GAP_M: f64 = 0.008;
/// Features use at most this many alternatives.
const LISTED: usize = 8;
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

/// Returns the features of an answer, in the order of [`FEATURES`]; `None` without a pose to judge.
pub fn features(alignment: &Alignment) -> Option<[f64; FEATURES.len()]> {
    let best = alignment.alternatives.first()?;
    let free_space = best.free_space?;
    // The gap is at most 10 cm; a worse rival counts as none.
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

/// Facts about an answer that its features do not show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Doubts {
    /// True if the search ended at its budget: an unsearched pose may explain the clip as well.
    pub search_incomplete: bool,
    /// True if the camera was tracked from frames that are far apart.
    pub sparse_track: bool,
}

/// Maximum probability if the search was incomplete.
const MOST_AFTER_INCOMPLETE_SEARCH: f64 = 0.5;
/// Maximum probability if the camera was tracked from sparse frames: of the simulated clips at 2.5 frames a
/// second that were reported as aligned, 13 % were wrong (BENCHMARKS.md).
const MOST_FOR_SPARSE_TRACK: f64 = 0.85;

/// Sets the probabilities of an answer.
pub fn set_probabilities(answer: &mut Alignment, doubts: Doubts) {
    regress(answer, &MODEL);
    if doubts.search_incomplete {
        cap(&mut answer.probability, MOST_AFTER_INCOMPLETE_SEARCH);
        for alternative in &mut answer.alternatives {
            cap(&mut alternative.probability, MOST_AFTER_INCOMPLETE_SEARCH);
        }
    }
    if doubts.sparse_track {
        cap(&mut answer.probability, MOST_FOR_SPARSE_TRACK);
        if let Some(first) = answer.alternatives.first_mut() {
            cap(&mut first.probability, MOST_FOR_SPARSE_TRACK);
        }
    }
}

fn cap(probability: &mut Option<f64>, most: f64) {
    *probability = probability.map(|p| p.min(most));
}

/// Sets the regression's probability for the best pose, capped by its gap to the next explanation. The rest
/// is divided among the other explanations by their losses, with a part for unlisted poses.
fn regress(answer: &mut Alignment, model: &Model) {
    const ELSEWHERE: f64 = 0.25;
    let Some(features) = features(answer) else { return };
    // Evidence for the best pose is also evidence for a rival with nearly its loss.
    let ceiling = 1.0 / (1.0 + (-features[0] / model.temperature_m).exp());
    let best = model.probability(&features).min(ceiling);
    let loss_m = answer.alternatives[0].loss_m;
    let weight = |a: &Alternative| (-(a.loss_m - loss_m) / model.temperature_m).exp();
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
    use crate::FreeSpace;
    use viola_geometry::{LevelName, Pose2};

    #[test]
    fn the_checked_in_coefficients_are_for_these_features() {
        let names: Vec<&str> = MODEL.coefficients.iter().map(|c| c.feature.as_str()).collect();
        assert_eq!(names, FEATURES);
        assert!(MODEL.coefficients.iter().all(|c| c.scale > 0.0 && c.weight.is_finite()));
    }

    /// Returns an answer as sure as the model can be.
    fn sure() -> Alignment {
        let free_space =
            FreeSpace { blocked_rays: 0.0, hits_on_floor: 0.0, unseen_sides: 0.0, walls_on_floor: 0.0 };
        let best = Alternative {
            level: LevelName::MAIN,
            map_from_clip: Pose2::default(),
            loss_m: 0.02,
            inliers: 1.0,
            free_space: Some(free_space),
            misplaced: None,
            probability: None,
            evidence: None,
        };
        Alignment { alternatives: vec![best], hits: 500, coverage: Some(0.5), ..Alignment::failed() }
    }

    fn check(doubts: Doubts, most: f64) {
        let mut answer = sure();
        set_probabilities(&mut answer, doubts);
        let probability = answer.probability.unwrap();
        assert!(probability <= most, "{doubts:?} {probability}");
        assert_eq!(answer.alternatives[0].probability, answer.probability);
    }

    #[test]
    fn doubts_cap_the_probability() {
        let none = Doubts { search_incomplete: false, sparse_track: false };
        let mut answer = sure();
        set_probabilities(&mut answer, none);
        assert!(answer.probability.unwrap() > MOST_FOR_SPARSE_TRACK, "{:?}", answer.probability);
        check(Doubts { sparse_track: true, ..none }, MOST_FOR_SPARSE_TRACK);
        check(Doubts { search_incomplete: true, ..none }, MOST_AFTER_INCOMPLETE_SEARCH);
        check(Doubts { search_incomplete: true, sparse_track: true }, MOST_AFTER_INCOMPLETE_SEARCH);
    }
}
