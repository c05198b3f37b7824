//! Stages 7-9: from what the vacuum would see to a ranked answer with a probability.

use super::decide::Ranked;
use super::observe::Observation;
use super::posterior::{self, POSTERIOR};
use super::raycast::{Hit, VirtualScan};
use super::refine::Refined;
use super::search::{Modes, Reach, Search};
use super::{
    AlignError, AlignParams, Alignment, AlignmentState, FloorReport, Reason, Target, decide, refine, weigh,
};
use crate::progress::{self, Progress, Stage};

/// Fewer hits than this say nothing: a metre of wall.
const MIN_HITS: usize = 30;

/// Registers an observation. No target is a map without a point.
pub fn register(
    observation: &Observation,
    target: Option<&Target>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Alignment, AlignError> {
    let mut blank = Alignment {
        hits: observation.scan.hits.len(),
        key_frames: observation.key_frames,
        labels: observation.labels.clone(),
        floor: observation.floor.clone(),
        reasons: observation.reasons.clone(),
        ..Alignment::failed()
    };
    let Some(target) = target else {
        blank.reasons.push(Reason::new("map_empty", "the LiDAR map has no occupied point"));
        return Ok(blank);
    };
    // Where the floor is a guess, the guess whose scan fits the map best is taken.
    let mut best: Option<Alignment> = None;
    for (scan, floor) in observation.views() {
        let answer = register_scan(scan, floor, &blank, target, params, progress)?;
        if best.as_ref().is_none_or(|best| fit(&answer) < fit(best)) {
            best = Some(answer);
        }
    }
    let mut answer = best.unwrap_or(blank);
    if answer.floor.as_ref().is_some_and(|floor| floor.assumed) {
        let height_m = answer.floor.as_ref().map_or(0.0, |floor| floor.camera_height_m);
        answer.reasons.push(Reason::new(
            "floor_assumed",
            format!(
                "gravity is known, so several heights of the camera were tried; {height_m:.2} m fits best"
            ),
        ));
    }
    Ok(answer)
}

/// What decides between guesses of the floor.
fn fit(answer: &Alignment) -> f64 {
    answer.loss_m.unwrap_or(f64::INFINITY)
}

fn register_scan(
    scan: &VirtualScan,
    floor: &FloorReport,
    blank: &Alignment,
    target: &Target,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Alignment, AlignError> {
    let mut answer = Alignment { hits: scan.hits.len(), floor: Some(floor.clone()), ..blank.clone() };
    let hits = weigh::weigh(&scan.hits, &params.weigh);
    if hits.len() < MIN_HITS {
        let detail = format!(
            "the clip shows {} standing points on walls and furniture and {MIN_HITS} are needed; film more of the room, and its lower half",
            hits.len(),
        );
        answer.reasons.push(Reason::new("too_few_hits", detail));
        return Ok(answer);
    }
    let mut search = Search::new(&hits, target, &params.search);
    let mut refined = Vec::new();
    let mut place = |reach: &Reach| {
        progress::begin(progress, Stage::Search)?;
        let found = search.run(reach, progress)?;
        progress::begin(progress, Stage::Refine)?;
        let new = found.modes.iter().skip(refined.len()).map(|mode| mode.map_from_clip);
        refined.extend(refine::refine(&new.collect::<Vec<_>>(), &hits, target, &params.refine));
        progress::begin(progress, Stage::Decide)?;
        let ranked = decide::rank(&refined, &hits, scan, target, &params.decide);
        Ok::<_, AlignError>((judge(ranked, &found, &hits, answer.clone(), target, params), found.complete))
    };
    let (mut answer, complete) = place(&params.search.first)?;
    if answer.state != AlignmentState::Aligned && complete {
        // The truth may score too low to be among what was looked at.
        answer = place(&params.search.in_doubt)?.0;
    }
    if let (Some(map_from_clip), Some(covariance)) = (answer.map_from_clip, answer.covariance) {
        let best = Refined { map_from_clip, covariance: covariance.into() };
        let mean = refine::mean(&best, &hits, target, &params.refine);
        answer.map_from_clip = Some(mean);
        // What ranks it stays that of the minimum, as for its rivals.
        if let Some(best) = answer.alternatives.first_mut() {
            best.map_from_clip = mean;
        }
    }
    Ok(answer)
}

/// Fills in where hits lie in the map.
fn judge(
    ranked: Vec<Ranked>,
    found: &Modes,
    hits: &[Hit],
    mut answer: Alignment,
    target: &Target,
    params: &AlignParams,
) -> Alignment {
    let Some(best) = ranked.first() else {
        let detail = "the search found no place in the map where the clip could lie";
        answer.reasons.push(Reason::new("no_candidate", detail));
        return answer;
    };
    let pose = best.alternative.map_from_clip;
    answer.coverage = Some(decide::coverage(&pose, hits, target, params.decide.evidence.inlier_m));
    answer.loss_m = Some(best.alternative.loss_m);
    answer.inliers = Some(best.alternative.inliers);
    answer.covariance = Some(best.covariance.into());
    answer.alternatives = ranked.into_iter().map(|r| r.alternative).collect();
    POSTERIOR.judge(&mut answer);
    if !found.complete {
        // A place that was not looked at may explain the clip as well.
        const AT_MOST: f64 = 0.5;
        answer.probability = answer.probability.map(|p| p.min(AT_MOST));
        for alternative in &mut answer.alternatives {
            alternative.probability = alternative.probability.map(|p| p.min(AT_MOST));
        }
        let detail = format!(
            "the search ended at its budget of {} nodes; poses that score up to {:.2} may be missing",
            found.nodes, found.open_bound
        );
        answer.reasons.push(Reason::new("search_incomplete", detail));
    }
    verdict(&mut answer, &params.decide);
    if answer.state != AlignmentState::Failed {
        answer.map_from_clip = Some(pose);
    } else {
        answer.covariance = None;
    }
    answer
}

/// `aligned` from the bar on, `failed` without support, and the reasons for anything but `aligned`.
fn verdict(answer: &mut Alignment, params: &decide::DecideParams) {
    let inliers = answer.inliers.unwrap_or(0.0);
    let probability = answer.probability.unwrap_or(0.0);
    if inliers < params.min_inliers {
        let percent = inliers * 100.0;
        answer.reasons.push(Reason::new(
            "no_support",
            format!("only {percent:.0} % of what the clip shows at the vacuum's height is in the map anywhere; is it the map of this home?"),
        ));
        answer.state = AlignmentState::Failed;
    } else if probability >= params.sure {
        answer.state = AlignmentState::Aligned;
    } else {
        answer.state = AlignmentState::Ambiguous;
        let percent = probability * 100.0;
        let rivals = posterior::near_rivals(answer);
        answer.reasons.push(if rivals > 0 {
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
