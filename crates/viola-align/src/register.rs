//! Stages 7-9: registers a virtual scan to the maps of all levels, and returns one ranked answer with a
//! probability.
//!
//! The levels are searched one by one; their poses are ranked together, so that a pose on another level is a
//! rival like any other.

use crate::answer::{Alignment, AlignmentState};
use crate::observe::{Observation, ScanView};
use crate::refine::{self, Refined};
use crate::scan::Hit;
use crate::score::{self, Doubts, OnLevel, Ranked};
use crate::search::{Modes, Search, SearchLimits};
use crate::{AlignError, AlignParams, Target};
use viola_geometry::LevelName;
use viola_geometry::progress::{self, Progress, Stage};
use viola_reconstruct::Reason;

/// Minimum number of hits: a metre of wall.
const MIN_HITS: usize = 30;

/// Registers an observation. `targets` are the maps of the levels that have a point.
pub fn register(
    observation: &Observation,
    targets: &[&Target],
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
    if targets.is_empty() {
        blank.reasons.push(Reason::new("map_empty", "the LiDAR map has no occupied point"));
        return Ok(blank);
    }
    // Of several assumed floors, the one whose scan fits the map best is taken.
    let mut best: Option<Alignment> = None;
    for view in observation.views() {
        let answer = register_view(&view, &blank, targets, params, progress)?;
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

/// The search in the map of one level.
struct LevelSearch<'a> {
    target: &'a Target,
    search: Search<'a>,
    refined: Vec<Refined>,
}

impl<'a> LevelSearch<'a> {
    fn new(target: &'a Target, hits: &[Hit], params: &'a AlignParams) -> LevelSearch<'a> {
        let search = Search::new(hits, target, &params.search);
        LevelSearch { target, search, refined: Vec::new() }
    }

    /// Refines the modes that are new since the last call.
    fn refine(&mut self, found: &Modes, hits: &[Hit]) {
        let new: Vec<_> =
            found.modes.iter().skip(self.refined.len()).map(|mode| mode.map_from_clip).collect();
        self.refined.extend(refine::refine(&new, hits, self.target));
    }
}

/// Registers one scan: search, refine, rank, confidence, verdict. An answer in doubt resumes the search.
fn register_view(
    view: &ScanView,
    blank: &Alignment,
    targets: &[&Target],
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
    let mut levels: Vec<LevelSearch> =
        targets.iter().map(|target| LevelSearch::new(target, &hits, params)).collect();
    let mut place = |limits: &SearchLimits| {
        progress::begin(progress, Stage::Search)?;
        let found = levels.iter_mut().map(|level| level.search.run(limits, progress));
        let found: Vec<Modes> = found.collect::<Result<_, AlignError>>()?;
        progress::begin(progress, Stage::Refine)?;
        levels.iter_mut().zip(&found).for_each(|(level, found)| level.refine(found, &hits));
        progress::begin(progress, Stage::Decide)?;
        let refined: Vec<OnLevel> =
            levels.iter().map(|level| OnLevel { target: level.target, refined: &level.refined }).collect();
        let ranked = score::rank(&refined, &hits, scan, &params.score);
        let cut_short = found.iter().find(|found| !found.complete);
        let doubts = Doubts { search_incomplete: cut_short.is_some(), sparse_track: view.sparse_track };
        let answer = decide(ranked, cut_short, &hits, answer.clone(), targets, doubts);
        Ok::<_, AlignError>((answer, cut_short.is_none()))
    };
    let (mut answer, complete) = place(&params.search.first)?;
    if answer.state != AlignmentState::Aligned && complete {
        // The right pose may score below the first limits.
        answer = place(&params.search.in_doubt)?.0;
    }
    if let (Some(target), Some(map_from_clip), Some(covariance)) =
        (on_level(targets, answer.level), answer.map_from_clip, answer.covariance)
    {
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

fn on_level<'a>(targets: &[&'a Target], level: LevelName) -> Option<&'a Target> {
    targets.iter().find(|target| target.level == level).copied()
}

/// Turns ranked poses into an answer with probabilities and a state. `cut_short` is a search that ended at its
/// budget.
fn decide(
    ranked: Vec<Ranked>,
    cut_short: Option<&Modes>,
    hits: &[Hit],
    mut answer: Alignment,
    targets: &[&Target],
    doubts: Doubts,
) -> Alignment {
    let Some(best) = ranked.first() else {
        let detail = "the search found no place in the map where the clip could lie";
        answer.reasons.push(Reason::new("no_candidate", detail));
        return answer;
    };
    let (level, pose) = (best.alternative.level, best.alternative.map_from_clip);
    answer.level = level;
    answer.coverage = on_level(targets, level).map(|target| score::coverage(&pose, hits, target));
    answer.loss_m = Some(best.alternative.loss_m);
    answer.inliers = Some(best.alternative.inliers);
    answer.covariance = Some(best.covariance.into());
    answer.alternatives = ranked.into_iter().map(|r| r.alternative).collect();
    score::set_probabilities(&mut answer, doubts);
    if let Some(found) = cut_short {
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
