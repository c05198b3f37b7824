//! Stages 7-9: registers a virtual scan to the maps of all levels, and returns one ranked answer with a
//! probability.
//!
//! Each assumed floor and each level is searched on its own; all poses are ranked together, so a pose above
//! another floor or on another level is a rival like any other.

use crate::answer::{Alignment, AlignmentState, Alternative};
use crate::observe::{Observation, ScanView};
use crate::refine::{self, Mean, Refined};
use crate::scan::Hit;
use crate::score::{self, Candidates, ProbabilityCaps, Ranked};
use crate::search::{Likelihood, Modes, Search, SearchLimits, reach_m};
use crate::{AlignError, AlignParams, Target};
use std::sync::Arc;
use viola_geometry::progress::{self, Progress, Stage};
use viola_geometry::{LevelName, Pose2};
use viola_reconstruct::Reason;

/// Minimum number of hits: a metre of wall.
pub(crate) const MIN_HITS: usize = 30;

/// Registers an observation. `targets` are the maps of the levels that have a point.
pub fn register(
    observation: &Observation,
    targets: &[&Target],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Alignment, AlignError> {
    let mut answer = Alignment {
        hits: observation.scan.hits.len(),
        key_frames: observation.key_frames,
        labels: observation.labels.clone(),
        floor: observation.floor.clone(),
        reference_camera: observation.floor.as_ref().and_then(|floor| observation.reference_camera(floor)),
        reasons: observation.reasons.clone(),
        ..Alignment::failed()
    };
    if let Some(scale) = &observation.scale {
        (answer.scale, answer.scale_std) = (Some(scale.metres_per_unit), Some(scale.std));
        answer.scale_rival_gaps_m = scale.rival_gaps_m.clone();
    }
    if targets.is_empty() {
        answer.reasons.push(Reason::new("map_empty", "the LiDAR map has no occupied point"));
        return Ok(answer);
    }
    let views = observation.views().map(|view| Hypothesis::new(view, params));
    let (hypotheses, poor): (Vec<Hypothesis>, Vec<Hypothesis>) =
        views.partition(|hypothesis| hypothesis.hits.len() >= MIN_HITS);
    if hypotheses.is_empty() {
        if let Some(hits) = poor.iter().map(|hypothesis| hypothesis.hits.len()).max() {
            answer.reasons.push(too_few(hits));
        }
        return Ok(answer);
    }
    let mut answer = Registration::new(&hypotheses, targets, params).run(answer, progress)?;
    answer.reference_camera = answer.floor.as_ref().and_then(|floor| observation.reference_camera(floor));
    if let Some(floor) = answer.floor.as_ref().filter(|floor| floor.assumed) {
        let height_m = floor.camera_height_m;
        answer.reasons.push(Reason::new(
            "floor_assumed",
            format!(
                "gravity is known, so several heights of the camera were tried; {height_m:.2} m fits best"
            ),
        ));
    }
    Ok(answer)
}

fn too_few(hits: usize) -> Reason {
    Reason::new(
        "too_few_hits",
        format!(
            "the clip shows {hits} standing points on walls and furniture and {MIN_HITS} are needed; film more of the room, and its lower half"
        ),
    )
}

/// The scan above one floor, seen or assumed, with weighted hits.
struct Hypothesis<'a> {
    view: ScanView<'a>,
    hits: Vec<Hit>,
}

impl<'a> Hypothesis<'a> {
    fn new(view: ScanView<'a>, params: &AlignParams) -> Hypothesis<'a> {
        let hits = score::hit_weights(&view.scan.hits, &params.hit_weights);
        Hypothesis { view, hits }
    }
}

/// The search of one hypothesis in the map of one level.
struct LevelSearch<'a> {
    hypothesis: usize,
    target: &'a Target,
    search: Search<'a>,
    refined: Vec<Refined>,
}

impl LevelSearch<'_> {
    /// Refines the modes that are new since the last call.
    fn refine(&mut self, found: &Modes, hits: &[Hit]) {
        let new: Vec<_> =
            found.modes.iter().skip(self.refined.len()).map(|mode| mode.map_from_clip).collect();
        self.refined.extend(refine::refine(&new, hits, self.target));
    }
}

/// An answer of the search.
struct Placed {
    answer: Alignment,
    /// Index of the answer's hypothesis.
    hypothesis: usize,
    /// True if no search ended at its budget.
    complete: bool,
}

/// Search, refinement, ranking, confidence and verdict over all hypotheses and levels.
struct Registration<'a> {
    hypotheses: &'a [Hypothesis<'a>],
    targets: &'a [&'a Target],
    params: &'a AlignParams,
    searches: Vec<LevelSearch<'a>>,
}

impl<'a> Registration<'a> {
    fn new(
        hypotheses: &'a [Hypothesis<'a>],
        targets: &'a [&'a Target],
        params: &'a AlignParams,
    ) -> Registration<'a> {
        let reach_m = hypotheses.iter().map(|one| reach_m(&one.hits)).fold(0.0, f64::max);
        let likelihood = |target: &&Target| Arc::new(Likelihood::new(target, reach_m, &params.search));
        let likelihoods: Vec<Arc<Likelihood>> = targets.iter().map(likelihood).collect();
        let search = |hypothesis: usize, level: usize| {
            let (hits, target) = (&hypotheses[hypothesis].hits, targets[level]);
            let search = Search::sharing_as_fine(&likelihoods[level], hits, target, &params.search);
            LevelSearch { hypothesis, target, search, refined: Vec::new() }
        };
        let searches = (0..hypotheses.len())
            .flat_map(|hypothesis| (0..targets.len()).map(move |level| search(hypothesis, level)))
            .collect();
        Registration { hypotheses, targets, params, searches }
    }

    /// Returns the answer; an answer in doubt resumes the search. `blank` has the facts that do not depend on
    /// the pose.
    fn run(&mut self, blank: Alignment, progress: &dyn Progress) -> Result<Alignment, AlignError> {
        let limits = &self.params.search;
        let mut placed = self.place(&limits.first, &blank, progress)?;
        if placed.answer.state != AlignmentState::Aligned && placed.complete {
            // The right pose may score below the first limits. An incomplete resumed search is discarded: its unlisted poses
            // may outrank its listed ones.
            let resumed = self.place(&limits.resumed, &blank, progress)?;
            if resumed.complete {
                placed = resumed;
            }
        }
        let Placed { mut answer, hypothesis, .. } = placed;
        if let (Some(target), Some(map_from_clip), Some(covariance)) =
            (on_level(self.targets, answer.level), answer.map_from_clip, answer.covariance)
        {
            let best = Refined { map_from_clip, covariance: covariance.into() };
            let Mean { map_from_clip, spread } =
                refine::mean(&best, &self.hypotheses[hypothesis].hits, target);
            answer.map_from_clip = Some(map_from_clip);
            let of_middle = score::MODEL.covariance.calibrated(&spread.covariance);
            answer.covariance = Some(spread.at_origin(&of_middle, &map_from_clip).into());
            answer.spread = Some(spread);
            // Its rank stays that of the minimum, as for the other alternatives.
            if let Some(best) = answer.alternatives.first_mut() {
                best.map_from_clip = map_from_clip;
            }
        }
        Ok(answer)
    }

    /// Resumes the searches until `limits`.
    fn place(
        &mut self,
        limits: &SearchLimits,
        blank: &Alignment,
        progress: &dyn Progress,
    ) -> Result<Placed, AlignError> {
        progress::begin(progress, Stage::Search)?;
        let found = self.searches.iter_mut().map(|level| level.search.run(limits, progress));
        let found: Vec<Modes> = found.collect::<Result<_, AlignError>>()?;
        progress::begin(progress, Stage::Refine)?;
        for (level, found) in self.searches.iter_mut().zip(&found) {
            level.refine(found, &self.hypotheses[level.hypothesis].hits);
        }
        progress::begin(progress, Stage::Decide)?;
        let candidates = self.searches.iter().map(|level| {
            let Hypothesis { view, hits } = &self.hypotheses[level.hypothesis];
            let (hypothesis, target, refined) = (level.hypothesis, level.target, &level.refined);
            Candidates { hypothesis, hits, scan: view.scan, target, refined }
        });
        let candidates: Vec<Candidates> = candidates.collect();
        let ranked = score::rank(&candidates, &self.params.score);
        let hypothesis = ranked.first().map_or(0, |best| best.hypothesis);
        let Hypothesis { view, hits } = &self.hypotheses[hypothesis];
        let mut answer =
            Alignment { hits: view.scan.hits.len(), floor: Some(view.floor.clone()), ..blank.clone() };
        if view.scale_cut_short {
            let detail = "the search for the clip's scale ended at its budget; other scales may explain the clip as well";
            answer.reasons.push(Reason::new("search_incomplete", detail));
        }
        // A search that ended at its budget matters if an open pose may score as high as a mode that counts.
        let best = found.iter().filter_map(|found| found.modes.first()).map(|mode| mode.score);
        let least = limits.min_score_ratio * best.fold(0.0, f64::max);
        let cut_short = found.iter().find(|found| !found.complete && found.open_bound >= least);
        let caps = ProbabilityCaps {
            search_incomplete: cut_short.is_some() || view.scale_cut_short,
            sparse_track: view.sparse_track,
        };
        let complete = cut_short.is_none();
        let answer = self.decide(ranked, cut_short, hits, answer, caps);
        Ok(Placed { answer, hypothesis, complete })
    }

    /// Turns ranked poses into an answer with probabilities and a state. `cut_short` is a search that ended at its
    /// budget.
    fn decide(
        &self,
        ranked: Vec<Ranked>,
        cut_short: Option<&Modes>,
        hits: &[Hit],
        mut answer: Alignment,
        caps: ProbabilityCaps,
    ) -> Alignment {
        let Some(best) = ranked.first() else {
            let detail = "the search found no place in the map where the clip could lie";
            answer.reasons.push(Reason::new("no_candidate", detail));
            return answer;
        };
        let (level, pose) = (best.alternative.level, best.alternative.map_from_clip);
        answer.level = level;
        let target = on_level(self.targets, level);
        answer.coverage = target.map(|target| score::coverage(&pose, hits, target));
        answer.loss_m = Some(best.alternative.loss_m);
        answer.inliers = Some(best.alternative.inliers);
        answer.covariance = Some(best.covariance.into());
        let camera_height_m = |of: usize| self.hypotheses[of].view.floor.camera_height_m;
        let answer_m = camera_height_m(best.hypothesis);
        let listed = |one: Ranked| Alternative {
            rise_m: camera_height_m(one.hypothesis) - answer_m,
            ..one.alternative
        };
        answer.alternatives = ranked.into_iter().map(listed).collect();
        let mut uncapped = score::set_probabilities(&mut answer, caps);
        if let Some(target) = target.filter(|_| answer.scale.is_none() && score::is_sure(&answer)) {
            let on_level = answer.alternatives.iter().filter(|other| other.level == level);
            let poses: Vec<Pose2> = on_level.map(|other| other.map_from_clip).collect();
            answer.better_scale = score::better_scale(&poses, hits, target, &self.params.score);
            uncapped = score::set_probabilities(&mut answer, caps);
        }
        if let Some(found) = cut_short {
            let detail = format!(
                "the search ended at its budget of {} nodes; poses that score up to {:.2} may be missing",
                found.nodes, found.open_bound
            );
            answer.reasons.push(Reason::new("search_incomplete", detail));
        }
        score::set_state(&mut answer, uncapped);
        if answer.state != AlignmentState::Failed {
            answer.map_from_clip = Some(pose);
        } else {
            (answer.covariance, answer.probability) = (None, None);
            answer.alternatives.iter_mut().for_each(|one| one.probability = None);
        }
        answer
    }
}

fn on_level<'a>(targets: &[&'a Target], level: LevelName) -> Option<&'a Target> {
    targets.iter().find(|target| target.level == level).copied()
}
