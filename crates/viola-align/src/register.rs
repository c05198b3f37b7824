//! Stages 7-9: registers a virtual scan, and returns a ranked answer with a probability.

use crate::answer::{Alignment, AlignmentState};
use crate::observe::{Observation, ScanView};
use crate::refine::{self, Refined};
use crate::scan::Hit;
use crate::score::{self, Doubts, Ranked};
use crate::search::{Modes, Search, SearchLimits};
use crate::{AlignError, AlignParams, Target};
use viola_geometry::progress::{self, Progress, Stage};
use viola_reconstruct::Reason;

/// Minimum number of hits: a metre of wall.
const MIN_HITS: usize = 30;

/// Registers an observation. `target` is `None` for a map without a point.
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
    // Of several assumed floors, the one whose scan fits the map best is taken.
    let mut best: Option<Alignment> = None;
    for view in observation.views() {
        let answer = register_view(&view, &blank, target, params, progress)?;
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

/// Returns the loss, which decides between hypotheses of the floor.
fn fit(answer: &Alignment) -> f64 {
    answer.loss_m.unwrap_or(f64::INFINITY)
}

/// Registers one scan: search, refine, rank, confidence, verdict. An answer in doubt resumes the search.
fn register_view(
    view: &ScanView,
    blank: &Alignment,
    target: &Target,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Alignment, AlignError> {
    let scan = view.scan;
    let mut answer = Alignment { hits: scan.hits.len(), floor: Some(view.floor.clone()), ..blank.clone() };
    let hits = score::hit_weights(&scan.hits, &params.hit_weights);
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
    let mut place = |limits: &SearchLimits| {
        progress::begin(progress, Stage::Search)?;
        let found = search.run(limits, progress)?;
        progress::begin(progress, Stage::Refine)?;
        let new = found.modes.iter().skip(refined.len()).map(|mode| mode.map_from_clip);
        refined.extend(refine::refine(&new.collect::<Vec<_>>(), &hits, target));
        progress::begin(progress, Stage::Decide)?;
        let ranked = score::rank(&refined, &hits, scan, target, &params.score);
        let doubts = Doubts { search_incomplete: !found.complete, sparse_track: view.sparse_track };
        let answer = decide(ranked, &found, &hits, answer.clone(), target, doubts);
        Ok::<_, AlignError>((answer, found.complete))
    };
    let (mut answer, complete) = place(&params.search.first)?;
    if answer.state != AlignmentState::Aligned && complete {
        // The right pose may score below the first limits.
        answer = place(&params.search.in_doubt)?.0;
    }
    if let (Some(map_from_clip), Some(covariance)) = (answer.map_from_clip, answer.covariance) {
        let best = Refined { map_from_clip, covariance: covariance.into() };
        let mean = refine::mean(&best, &hits, target);
        answer.map_from_clip = Some(mean);
        // Its rank stays that of the minimum, as for the other alternatives.
        if let Some(best) = answer.alternatives.first_mut() {
            best.map_from_clip = mean;
        }
    }
    Ok(answer)
}

/// Turns ranked poses into an answer with probabilities and a state.
fn decide(
    ranked: Vec<Ranked>,
    found: &Modes,
    hits: &[Hit],
    mut answer: Alignment,
    target: &Target,
    doubts: Doubts,
) -> Alignment {
    let Some(best) = ranked.first() else {
        let detail = "the search found no place in the map where the clip could lie";
        answer.reasons.push(Reason::new("no_candidate", detail));
        return answer;
    };
    let pose = best.alternative.map_from_clip;
    answer.coverage = Some(score::coverage(&pose, hits, target));
    answer.loss_m = Some(best.alternative.loss_m);
    answer.inliers = Some(best.alternative.inliers);
    answer.covariance = Some(best.covariance.into());
    answer.alternatives = ranked.into_iter().map(|r| r.alternative).collect();
    score::set_probabilities(&mut answer, doubts);
    if !found.complete {
        let detail = format!(
            "the search ended at its budget of {} nodes; poses that score up to {:.2} may be missing",
            found.nodes, found.open_bound
        );
        answer.reasons.push(Reason::new("search_incomplete", detail));
    }
    score::set_state(&mut answer);
    if answer.state != AlignmentState::Failed {
        answer.map_from_clip = Some(pose);
    } else {
        answer.covariance = None;
    }
    answer
}
