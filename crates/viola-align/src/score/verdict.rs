//! The state of an answer, and its reasons.

use super::confidence::{near_rivals, near_scales};
use crate::answer::{Alignment, AlignmentState};
use viola_reconstruct::Reason;

/// Minimum fraction of the hits with a counterpart in the map.
const LEAST_INLIERS: f64 = 0.3;
/// Minimum probability of the state `aligned`.
const SURE: f64 = 0.9;

/// Sets the state from inliers and probability, with the reasons for anything but `aligned`.
pub fn set_state(answer: &mut Alignment) {
    let inliers = answer.inliers.unwrap_or(0.0);
    let probability = answer.probability.unwrap_or(0.0);
    if inliers < LEAST_INLIERS {
        let percent = inliers * 100.0;
        answer.reasons.push(Reason::new(
            "no_support",
            format!("only {percent:.0} % of what the clip shows at the vacuum's height is in the map anywhere; is it the map of this home?"),
        ));
        answer.state = AlignmentState::Failed;
    } else if probability >= SURE {
        answer.state = AlignmentState::Aligned;
    } else {
        answer.state = AlignmentState::Ambiguous;
        let percent = probability * 100.0;
        let (rivals, scales) = (near_rivals(answer), near_scales(answer));
        answer.reasons.push(if scales > 0 {
            Reason::new(
                "several_scales",
                format!("the clip has no metres, and {scales} explanation(s) at other scales fit nearly as well, which leaves the best at {percent:.0} %; film more of the room, or record with a phone that measures depth"),
            )
        } else if rivals > 0 {
            Reason::new(
                "several_modes",
                format!("{rivals} other pose(s) explain the clip nearly as well, which leaves the best at {percent:.0} %; film more of the room, or choose one"),
            )
        } else {
            Reason::new(
                "weak_evidence",
                format!("no other pose explains the clip as well, but what it shows makes this one only {percent:.0} % sure; film more of the room, and its lower half"),
            )
        });
    }
}
