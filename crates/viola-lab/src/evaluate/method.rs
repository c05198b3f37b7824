//! Alignment methods to compare: rows of the table.

use super::Sample;
use crate::paper::{self, PaperParams, Refiner};
use std::borrow::Cow;
use viola_align as align;
use viola_align::complete::{Imagination, Take, ViewStrategy};
use viola_align::{Activation, AlignError, AlignParams, Alignment, CompleteParams, Completion, Observation};
use viola_geometry::progress::Progress;

/// A row of the table.
#[derive(Debug, Clone)]
pub struct Method {
    pub name: String,
    pub kind: MethodKind,
    /// True if clips that are right without completion are not completed.
    pub by_truth: bool,
}

#[derive(Debug, Clone)]
pub enum MethodKind {
    Viola(Box<AlignParams>),
    Paper(PaperParams),
    /// The paper's registration, completion and criterion of ambiguity.
    PaperComplete(PaperParams, Box<AlignParams>),
}

/// Ablation of evidence: the name after `viola-without-`, and the function that switches it off. The
/// probability remains the one fitted with all evidence.
type Ablation = (&'static str, fn(&mut AlignParams));
const ABLATIONS: &[Ablation] = &[
    ("free-space", |params| {
        let weights = &mut params.score.weights;
        weights.blocked_m = 0.0;
        weights.hits_on_floor_m = 0.0;
        weights.unseen_sides_m = 0.0;
        weights.walls_on_floor_m = 0.0;
    }),
    // Low obstacles count as much as tall ones.
    ("structure", |params| params.hit_weights.low_weight = 1.0),
    // A bed by the network may be in any room.
    ("named-rooms", |params| params.score.weights.misplaced_m = 0.0),
    ("upper-walls", |params| params.hit_weights.upper_weight = 0.0),
    // A hit on unknown cells costs as much as one on free floor.
    ("unknown-cells", |params| params.score.unknown_fraction = 1.0),
];

/// A completion variant.
struct Way {
    /// Name after `complete-`.
    name: &'static str,
    when: Activation,
    /// True to project walls seen only above the vacuum's height down, and to extend walls to each other.
    structure: bool,
    /// View strategy of the networks; none without networks.
    views: Option<ViewStrategy>,
    /// True if only wrong first answers are completed, as judged by the truth.
    by_truth: bool,
}

const fn way(name: &'static str, when: Activation, structure: bool, views: Option<ViewStrategy>) -> Way {
    Way { name, when, structure, views, by_truth: false }
}

/// Another minimum within the margin of the paper's own loss.
const PAPER_CRITERION: Activation = Activation::SeveralMinima { margin_m: paper::MARGIN_LOSS_M };

/// The paper's two tables, and structure variants. `base` uses only points at the vacuum's height.
const WAYS: &[Way] = {
    use Activation::{Always, Never, Unsure};
    const FRONTIER: Option<ViewStrategy> = Some(ViewStrategy::Frontier);
    &[
        way("base", Never, false, None),
        way("all", Always, false, FRONTIER),
        way("gated", Unsure, false, FRONTIER),
        way("gated-by-minima", Activation::SeveralMinima { margin_m: 0.01 }, false, FRONTIER),
        Way { by_truth: true, ..way("by-truth", Always, false, FRONTIER) },
        way("step-back", Unsure, false, Some(ViewStrategy::StepBack)),
        way("vacuum-height", Unsure, false, Some(ViewStrategy::VacuumHeight)),
        way("upper-walls", Never, true, None),
        way("structure", Unsure, true, None),
        way("structure-all", Always, true, None),
        Way { by_truth: true, ..way("structure-by-truth", Always, true, None) },
        way("structure-then-imagination", Unsure, true, FRONTIER),
    ]
};

/// Error for an unavailable method.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoMethod {
    #[error("there is no method '{0}'; there are {all}", all = Method::names().join(", "))]
    Unknown(String),
    #[error(
        "the method '{0}' needs networks for inpainting and depth; install them with `viola models fetch migan` and `fastdepth`, and name their folder by --models"
    )]
    NeedsNetworks(String),
}

impl Method {
    pub fn viola(params: AlignParams) -> Method {
        Method { name: "viola".into(), kind: MethodKind::Viola(Box::new(params)), by_truth: false }
    }

    /// Returns the named method with its default parameters; `imagination` provides the networks for those
    /// that need them.
    pub fn named(name: &str, seed: u64, imagination: Option<&Imagination>) -> Result<Method, NoMethod> {
        let unknown = || NoMethod::Unknown(name.to_owned());
        let mut params = AlignParams { seed, ..AlignParams::default() };
        let mut by_truth = false;
        let kind = match name {
            "viola" => return Ok(Method::viola(params)),
            "paper" => MethodKind::Paper(PaperParams::default()),
            "paper-complete" => {
                let way = way("all", PAPER_CRITERION, false, Some(ViewStrategy::Frontier));
                way.set(&mut params, imagination).ok_or(NoMethod::NeedsNetworks(name.to_owned()))?;
                MethodKind::PaperComplete(PaperParams::default(), Box::new(params))
            }
            "paper-icp" => MethodKind::Paper(PaperParams { refiner: Refiner::Icp, ..PaperParams::default() }),
            _ => {
                if let Some(evidence) = name.strip_prefix("viola-without-") {
                    let known = ABLATIONS.iter().find(|(known, _)| *known == evidence);
                    known.ok_or_else(unknown)?.1(&mut params);
                } else {
                    let wanted = name.strip_prefix("complete-").ok_or_else(unknown)?;
                    let way = WAYS.iter().find(|way| way.name == wanted).ok_or_else(unknown)?;
                    by_truth = way.by_truth;
                    way.set(&mut params, imagination).ok_or(NoMethod::NeedsNetworks(name.to_owned()))?;
                }
                MethodKind::Viola(Box::new(params))
            }
        };
        Ok(Method { name: name.to_owned(), kind, by_truth })
    }

    /// Lists all refined modes as alternatives: weights must be learned from all of them, because the weights
    /// themselves choose the best few.
    pub fn list_all(&mut self) {
        if let MethodKind::Viola(params) = &mut self.kind {
            params.score.alternatives = params.search.first.modes.max(params.search.resumed.modes);
        }
    }

    /// Returns all names that [`Method::named`] accepts.
    pub fn names() -> Vec<String> {
        let ablations = ABLATIONS.iter().map(|(evidence, _)| format!("viola-without-{evidence}"));
        let ways = WAYS.iter().map(|way| format!("complete-{}", way.name));
        let names = ["viola", "paper", "paper-icp", "paper-complete"].map(String::from).into_iter();
        names.chain(ablations).chain(ways).collect()
    }

    /// Aligns a sample.
    pub fn register(&self, sample: &Sample, progress: &dyn Progress) -> Result<Alignment, AlignError> {
        match &self.kind {
            MethodKind::Viola(params) => {
                let targets = sample.targets();
                if self.by_truth {
                    let alone = align::register(&sample.observation, &targets, params, progress)?;
                    if sample.is_success(&alone) {
                        return Ok(alone);
                    }
                }
                Ok(align::register_completing(&sample.observation, &targets, params, progress)?.0)
            }
            // The paper's method has no levels: it gets the right one.
            MethodKind::Paper(params) => {
                paper::register(&sample.observation, sample.target.as_deref(), params, progress)
                    .map(|answer| Alignment { level: sample.level, ..answer })
            }
            MethodKind::PaperComplete(paper, params) => {
                let register: align::complete::Registrar = &|observation, completion, progress| {
                    let seen = with_completed(observation, completion);
                    paper::register(&seen, sample.target.as_deref(), paper, progress)
                };
                let (answer, _) = align::completing(&sample.observation, params, progress, register)?;
                Ok(Alignment { level: sample.level, ..answer })
            }
        }
    }
}

/// Returns the observation with the completed points, which the paper's rays hit like any others.
fn with_completed<'a>(observation: &'a Observation, completion: Option<&Completion>) -> Cow<'a, Observation> {
    let Some(completion) = completion else { return Cow::Borrowed(observation) };
    let mut completed = observation.clone();
    completed.cloud_in_clip.points.extend_from_slice(&completion.cloud_in_clip.points);
    Cow::Owned(completed)
}

impl Way {
    /// Sets the parameters; none if required networks are missing.
    fn set(&self, params: &mut AlignParams, imagination: Option<&Imagination>) -> Option<()> {
        params.complete = CompleteParams { when: self.when, ..CompleteParams::default() };
        // As in the paper. With `Unsure` the probability also chooses between the two answers.
        if self.when != Activation::Unsure {
            params.complete.take = Take::After;
        }
        if !self.structure {
            params.hit_weights.upper_weight = 0.0;
            params.complete.structure = false;
        }
        if let Some(views) = self.views {
            params.complete.imagination = Some(Imagination { views, ..imagination?.clone() });
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_a_method_of_its_own() {
        let needs_networks =
            |name: &String| matches!(Method::named(name, 3, None), Err(NoMethod::NeedsNetworks(_)));
        let (with, without): (Vec<String>, Vec<String>) =
            Method::names().into_iter().partition(needs_networks);
        // Besides these, the paper's whole method needs them.
        assert_eq!(with.len(), WAYS.iter().filter(|way| way.views.is_some()).count() + 1);
        let methods: Vec<Method> =
            without.iter().map(|name| Method::named(name, 3, None).expect(name)).collect();
        let what = |method: &Method| format!("{:?}", (&method.kind, method.by_truth));
        for (i, a) in methods.iter().enumerate() {
            for b in &methods[..i] {
                // The default of `viola` is also a row of the completion table.
                let alike = (a.name.as_str(), b.name.as_str()) == ("complete-structure", "viola");
                assert_eq!(what(a) == what(b), alike, "{} {}", a.name, b.name);
            }
        }
        assert_eq!(
            Method::named("viola-without-luck", 0, None).unwrap_err(),
            NoMethod::Unknown("viola-without-luck".into())
        );
    }
}
