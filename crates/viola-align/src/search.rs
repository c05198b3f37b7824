//! Finds the global optimum of the likelihood over the whole map, with a certificate (Olson, 2009; Hess et
//! al., 2016).
//!
//! The score of a pose is the weighted mean likelihood of the cells that its hits fall into. A node of the
//! search is one rotation and a square of translations; its bound takes, for each hit, the largest
//! likelihood that the square lets it reach, from a pyramid of maxima. Nodes are opened best first, so poses
//! come out in the order of their scores, and the first one is the optimum. All sums are integers: neither
//! threads nor the order of the hits change a bit.
//!
//! Translations are those of the clip's origin, the first camera. If it stands outside of the hits, it may stand outside of
//! the map, and the translations are those of the hits' middle.

mod pyramid;
mod space;

pub(crate) use space::Likelihood;

use super::AlignError;
use super::scan::Hit;
use super::search::space::{Node, Space};
use super::target::Target;
use rayon::prelude::*;
use std::collections::BinaryHeap;
use std::sync::Arc;
use viola_geometry::progress::{self, Progress};
use viola_geometry::{Point2, Pose2};

/// Poses nearer than this, and turned by less than `APART_RAD` from each other, are one mode.
pub(crate) const APART_M: f64 = 0.25;
pub(crate) const APART_RAD: f64 = 8f64.to_radians();

/// A pose worth refining.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    pub map_from_clip: Pose2,
    /// Weighted mean likelihood of the hits, 0..1.
    pub score: f64,
}

/// Limits at which a search ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchLimits {
    /// Maximum number of modes.
    pub modes: usize,
    /// Minimum score of a mode, as a fraction of the best score.
    pub min_score_ratio: f64,
}

/// Parameters of the search.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchParams {
    pub rotations: usize,
    /// Maximum number of hits; more are subsampled evenly, so that clutter keeps its fraction.
    pub hits: usize,
    /// Height of the pyramid: squares of up to `2^levels` cells; more on maps larger than a home.
    pub levels: u32,
    /// Limits of the first search.
    pub first: SearchLimits,
    /// Limits of the resumed search if the answer is in doubt, which is worth the time.
    pub resumed: SearchLimits,
    /// Maximum number of opened nodes, after which the certificate is incomplete. A count and not a time, so
    /// that the answer is the same on a slow machine.
    pub max_nodes: usize,
}

impl Default for SearchParams {
    fn default() -> Self {
        SearchParams {
            rotations: 360,
            hits: 128,
            levels: 5,
            first: SearchLimits { modes: 40, min_score_ratio: 0.8 },
            resumed: SearchLimits { modes: 100, min_score_ratio: 0.7 },
            max_nodes: 1_500_000,
        }
    }
}

/// The modes, best first, and the certificate.
#[derive(Debug, Clone, PartialEq)]
pub struct Modes {
    pub modes: Vec<Candidate>,
    /// No pose outside the neighbourhoods of the modes scores above this. If the first mode's score is at
    /// least this, it is the global optimum.
    pub open_bound: f64,
    pub nodes: usize,
    /// True if the search ended by itself and not by its budget.
    pub complete: bool,
}

/// A search over all poses with the pivot of the hits in the map. It can be resumed.
pub struct Search<'a> {
    params: &'a SearchParams,
    space: Space<'a>,
    pivot: Point2,
    open: BinaryHeap<Node>,
    dived: Option<Node>,
    /// Nodes with a bound up to this are dropped.
    hopeless: u32,
    /// Poses of the pivot.
    modes: Vec<Candidate>,
    nodes: usize,
}

impl<'a> Search<'a> {
    pub fn new(hits: &[Hit], target: &Target, params: &'a SearchParams) -> Search<'a> {
        let likelihood = Likelihood::new(target, reach_m(hits), params);
        Search::sharing(&Arc::new(likelihood), hits, params)
    }

    /// Starts a search in a likelihood that other searches share, as [`Search::sharing`]. The likelihood is its own if that
    /// has finer cells, so the modes are those of [`Search::new`].
    pub(crate) fn sharing_as_fine(
        likelihood: &Arc<Likelihood>,
        hits: &[Hit],
        target: &Target,
        params: &'a SearchParams,
    ) -> Search<'a> {
        if likelihood.is_as_fine_as_for(target, reach_m(hits), params) {
            Search::sharing(likelihood, hits, params)
        } else {
            Search::new(hits, target, params)
        }
    }

    /// Starts a search in a likelihood that other searches share. Its reach includes all of their hits.
    pub(crate) fn sharing(
        likelihood: &Arc<Likelihood>,
        hits: &[Hit],
        params: &'a SearchParams,
    ) -> Search<'a> {
        let pivot = pivot(hits);
        let hits = about(&pivot, &thin(hits, params.hits));
        let space = Space::new(&hits, Arc::clone(likelihood), params);
        let roots = space.roots();
        // Nodes that cannot reach the lowest ratio to this leaf are dropped.
        let dived = space.dive(&roots);
        let lowest = params.first.min_score_ratio.min(params.resumed.min_score_ratio);
        let hopeless = (lowest * f64::from(dived.map_or(0, |leaf| leaf.bound))) as u32;
        let open = roots.into_iter().filter(|node| node.bound > hopeless).collect();
        Search { params, space, pivot, open, dived, hopeless, modes: Vec::new(), nodes: 0 }
    }

    /// Resumes until `reach`; returns all modes so far, best first. Pauses do not change the result.
    pub fn run(&mut self, reach: &SearchLimits, progress: &dyn Progress) -> Result<Modes, AlignError> {
        let least = |best: Option<&Candidate>| reach.min_score_ratio * best.map_or(0.0, |best| best.score);
        self.resume(reach.modes, least, progress)
    }

    /// Resumes until it has `modes` modes, or no other pose scores `least`; returns all modes so far, best first.
    pub(crate) fn run_down_to(
        &mut self,
        least: f64,
        modes: usize,
        progress: &dyn Progress,
    ) -> Result<Modes, AlignError> {
        self.resume(modes, |_| least, progress)
    }

    /// Drops the nodes that score less than `least`.
    pub(crate) fn drop_below(&mut self, least: f64) {
        self.hopeless = self.hopeless.max(self.space.bound_below(least));
        self.open.retain(|node| node.bound > self.hopeless);
    }

    /// Returns the best score that is known: a lower bound of the optimum.
    pub(crate) fn known_score(&self) -> f64 {
        let dived = self.dived.map_or(0.0, |leaf| self.space.fraction(leaf.bound));
        self.modes.first().map_or(dived, |best| best.score)
    }

    /// Resumes until it has `modes` modes, or no open node scores at least what `least` returns for the best mode; returns
    /// all modes so far, best first.
    fn resume(
        &mut self,
        modes: usize,
        least: impl Fn(Option<&Candidate>) -> f64,
        progress: &dyn Progress,
    ) -> Result<Modes, AlignError> {
        while let Some(top) = self.open.peek() {
            let enough = self.modes.len() >= modes || self.nodes >= self.params.max_nodes;
            if enough || self.space.fraction(top.bound) < least(self.modes.first()) {
                break;
            }
            if top.level == 0 {
                let Some(leaf) = self.open.pop() else { break };
                let pose = self.space.pose(&leaf);
                if !self.modes.iter().any(|mode| is_close(&mode.map_from_clip, &pose)) {
                    self.modes
                        .push(Candidate { map_from_clip: pose, score: self.space.fraction(leaf.bound) });
                }
                continue;
            }
            progress::check(progress)?;
            let (space, modes) = (&self.space, &self.modes);
            let batch = pop_batch(&mut self.open, |node| space.is_taken(node, modes));
            self.nodes += batch.len();
            let children: Vec<[Node; 4]> =
                batch.par_iter().with_min_len(32).map(|node| space.children(node)).collect();
            self.open.extend(children.into_iter().flatten().filter(|child| child.bound > self.hopeless));
        }
        Ok(self.found())
    }

    fn found(&self) -> Modes {
        let mut modes = self.modes.clone();
        if let (true, Some(leaf)) = (modes.is_empty(), self.dived) {
            // The budget ended before the first proof; the fallback is the best known leaf.
            let map_from_clip = self.space.pose(&leaf);
            modes.push(Candidate { map_from_clip, score: self.space.fraction(leaf.bound) });
        }
        let pivot_from_clip = Pose2::new(-self.pivot.x, -self.pivot.y, 0.0);
        for mode in &mut modes {
            mode.map_from_clip = mode.map_from_clip.compose(&pivot_from_clip);
        }
        let open_bound = self.space.fraction(self.open.peek().map_or(self.hopeless, |top| top.bound));
        Modes { modes, open_bound, nodes: self.nodes, complete: self.nodes < self.params.max_nodes }
    }
}

/// Returns the clip's origin if it lies in the box around the hits, else their weighted middle. Hits that no map of a home
/// reaches do not count.
fn pivot(hits: &[Hit]) -> Point2 {
    const MAX_RANGE_M: f64 = 100.0;
    // Integers, so that the order of the hits does not matter.
    const UNITS: f64 = 1024.0;
    let near = || hits.iter().filter(|hit| hit.point_m.coords.norm() <= MAX_RANGE_M);
    let is_around = |axis: usize| {
        near().any(|hit| hit.point_m[axis] <= 0.0) && near().any(|hit| hit.point_m[axis] >= 0.0)
    };
    if is_around(0) && is_around(1) {
        return Point2::origin();
    }
    let (mut sum, mut weights) = ([0i64; 2], 0i64);
    for hit in near() {
        let weight = i64::from(space::weight(hit));
        for (sum, value) in sum.iter_mut().zip([hit.point_m.x, hit.point_m.y]) {
            *sum += weight * (value * UNITS).round() as i64;
        }
        weights += weight;
    }
    Point2::from(sum.map(|sum| sum as f64 / UNITS / weights.max(1) as f64))
}

fn about(pivot: &Point2, hits: &[Hit]) -> Vec<Hit> {
    hits.iter().map(|hit| Hit { point_m: Point2::from(hit.point_m - pivot), ..*hit }).collect()
}

/// Returns the largest distance of a hit from the pivot of all.
pub(crate) fn reach_m(hits: &[Hit]) -> f64 {
    let pivot = pivot(hits);
    hits.iter().map(|hit| (hit.point_m - pivot).norm()).fold(0.0, f64::max)
}

fn thin(hits: &[Hit], most: usize) -> Vec<Hit> {
    let kept = most.min(hits.len());
    (0..kept).map(|i| hits[i * hits.len() / kept]).collect()
}

/// Pops the best inner nodes, up to the first leaf. The number is fixed, so as not to depend on threads.
fn pop_batch(open: &mut BinaryHeap<Node>, is_taken: impl Fn(&Node) -> bool) -> Vec<Node> {
    const BATCH: usize = 128;
    let mut batch = Vec::with_capacity(BATCH);
    while batch.len() < BATCH && open.peek().is_some_and(|node| node.level > 0) {
        match open.pop() {
            Some(node) if !is_taken(&node) => batch.push(node),
            Some(_) => {}
            None => break,
        }
    }
    batch
}

fn is_close(a: &Pose2, b: &Pose2) -> bool {
    a.is_within(b, APART_M, APART_RAD)
}

#[cfg(test)]
mod tests;
