//! The state of an answer, and its reasons.

use super::confidence::{near_rivals, near_scales};
use crate::answer::{Alignment, AlignmentState};
use viola_reconstruct::Reason;

/// Minimum fraction of the hits with a counterpart in the map.
const MIN_INLIER_FRACTION: f64 = 0.3;
/// Minimum probability of the state `aligned`.
pub const MIN_ALIGNED_PROBABILITY: f64 = 0.9;

/// Minimum gain of another scale that is told as the reason of a doubt.
const MIN_TOLD_GAIN_M: f64 = 0.005;
/// Maximum probability of all listed explanations together at which the clip is said to be of another home.
const FOREIGN: f64 = 0.3;

/// Returns whether the probability is that of the state `aligned`.
pub fn is_sure(answer: &Alignment) -> bool {
    answer.probability.is_some_and(|probability| probability >= MIN_ALIGNED_PROBABILITY)
}

/// Describes a clip that fits better if its lengths are multiplied by `factor`.
fn disagreement(factor: f64) -> String {
    format!(
        "clip and map disagree about lengths: multiplied by {factor:.2}, the clip fits the map much better; check the unit of the depth, and the size of the map's cells"
    )
}

/// Sets the state from inliers and probability, with the reasons for anything but `aligned`. `uncapped` is the probability
/// before its caps, which have reasons of their own.
pub fn set_state(answer: &mut Alignment, uncapped: Option<f64>) {
    let inliers = answer.inliers.unwrap_or(0.0);
    let probability = answer.probability.unwrap_or(0.0);
    if inliers < MIN_INLIER_FRACTION {
        let percent = inliers * 100.0;
        answer.reasons.push(Reason::new(
            "no_support",
            format!("only {percent:.0} % of what the clip shows at the vacuum's height is in the map anywhere; is it the map of this home?"),
        ));
        answer.state = AlignmentState::Failed;
    } else if is_sure(answer) {
        answer.state = AlignmentState::Aligned;
    } else {
        answer.state = AlignmentState::Ambiguous;
        let percent = probability * 100.0;
        let (rivals, scales) = (near_rivals(answer), near_scales(answer));
        answer.reasons.extend(if let Some(better) = answer.better_scale.filter(|better| better.gain_m > MIN_TOLD_GAIN_M) {
            Some(Reason::new("scale_disagrees", disagreement(better.factor)))
        } else if scales > 0 {
            let fit = if scales == 1 {
                "an explanation at another scale fits".to_owned()
            } else {
                format!("{scales} explanations at other scales fit")
            };
            Some(Reason::new(
                "several_scales",
                format!("the clip has no metres, and {fit} nearly as well, which leaves the best at {percent:.0} %; film more of the room, or record with a phone that measures depth"),
            ))
        } else if rivals > 0 {
            let explain = if rivals == 1 {
                "another pose explains".to_owned()
            } else {
                format!("{rivals} other poses explain")
            };
            Some(Reason::new(
                "several_modes",
                format!("{explain} the clip nearly as well, which leaves the best at {percent:.0} %; film more of the room, or choose one"),
            ))
        } else if uncapped.is_some_and(|uncapped| uncapped >= MIN_ALIGNED_PROBABILITY) {
            None
        } else {
            Some(Reason::new(
                "weak_evidence",
                format!("no other pose explains the clip as well, but what it shows makes this one only {percent:.0} % sure; film more of the room, and its lower half"),
            ))
        });
    }
    let listed: f64 = answer.alternatives.iter().filter_map(|one| one.probability).sum();
    if answer.state != AlignmentState::Aligned && answer.probability.is_some() && listed < FOREIGN {
        let percent = listed * 100.0;
        answer.reasons.push(Reason::new(
            "not_this_home",
            format!("all poses in this home together are only {percent:.0} % probable; the clip may be of another home, or of a part that the robot has not mapped"),
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::Alternative;
    use crate::{BetterScale, Evidence, MODEL};
    use viola_geometry::{LevelName, Pose2};

    /// Returns the codes of an answer whose explanations have these probabilities.
    fn codes(probabilities: &[f64]) -> Vec<String> {
        let (evidence, weights) = (Evidence { inliers: 0.9, ..Evidence::default() }, MODEL.loss);
        let best = Alternative::of(LevelName::MAIN, Pose2::default(), &evidence, &weights);
        let alternative = |probability: &f64| Alternative { probability: Some(*probability), ..best.clone() };
        let mut answer = Alignment {
            alternatives: probabilities.iter().map(alternative).collect(),
            probability: probabilities.first().copied(),
            inliers: Some(0.9),
            ..Alignment::failed()
        };
        set_state(&mut answer, None);
        answer.reasons.into_iter().map(|reason| reason.code).collect()
    }

    #[test]
    fn a_clip_in_another_unit_is_told() {
        let mut answer = Alignment {
            probability: Some(0.6),
            inliers: Some(0.9),
            better_scale: Some(BetterScale { factor: 1.1, gain_m: 0.03 }),
            ..Alignment::failed()
        };
        set_state(&mut answer, None);
        let told: Vec<_> = answer.reasons.iter().map(|reason| reason.code.as_str()).collect();
        assert_eq!(told, ["scale_disagrees", "not_this_home"]);
    }

    /// More of the room would not help.
    #[test]
    fn only_an_answer_in_doubt_without_its_caps_has_weak_evidence() {
        let is_weak = |uncapped: f64| {
            let mut answer = Alignment { probability: Some(0.85), inliers: Some(0.9), ..Alignment::failed() };
            set_state(&mut answer, Some(uncapped));
            answer.reasons.iter().any(|reason| reason.code == "weak_evidence")
        };
        assert!(is_weak(0.89) && !is_weak(0.9));
    }

    #[test]
    fn a_clip_without_a_probable_pose_may_be_of_another_home() {
        assert_eq!(codes(&[0.95]), Vec::<String>::new());
        assert_eq!(codes(&[0.3, 0.2]), ["weak_evidence"]);
        assert_eq!(codes(&[0.1, 0.1]), ["weak_evidence", "not_this_home"]);
        assert_eq!(codes(&[]), ["weak_evidence"]);
    }
}
