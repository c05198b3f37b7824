//! Finds the global optimum of the likelihood over the whole map, with a certificate (Olson, 2009; Hess et
//! al., 2016).
//!
//! The score of a pose is the weighted mean likelihood of the cells that its hits fall into. A node of the
//! search is one rotation and a square of translations; its bound takes, for each hit, the largest
//! likelihood that the square lets it reach, from a pyramid of maxima. Nodes are opened best first, so poses
//! come out in the order of their scores, and the first one is the optimum. All sums are integers: neither
//! threads nor the order of the hits change a bit.
//!
//! Translations are those of the middle of the hits, which lies in the map: the first camera may stand outside of it.

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
use viola_geometry::{Point2, Pose2, angle_between};

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
    pub bar: f64,
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
    pub in_doubt: SearchLimits,
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
            first: SearchLimits { modes: 40, bar: 0.8 },
            in_doubt: SearchLimits { modes: 100, bar: 0.7 },
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

/// A search over all poses with the middle of the hits in the map. It can be resumed.
pub struct Search<'a> {
    params: &'a SearchParams,
    space: Space<'a>,
    middle: Point2,
    open: BinaryHeap<Node>,
    dived: Option<Node>,
    /// Nodes with a bound up to this are dropped.
    hopeless: u32,
    /// Modes of the middle of the hits.
    modes: Vec<Candidate>,
    nodes: usize,
}

impl<'a> Search<'a> {
    pub fn new(hits: &[Hit], target: &Target, params: &'a SearchParams) -> Search<'a> {
        let likelihood = Likelihood::new(target, reach_m(hits), params);
        Search::sharing(&Arc::new(likelihood), hits, params)
    }

    /// Starts a search in a likelihood that other searches share. Its reach includes all of their hits.
    pub(crate) fn sharing(
        likelihood: &Arc<Likelihood>,
        hits: &[Hit],
        params: &'a SearchParams,
    ) -> Search<'a> {
        let middle = middle(hits);
        let hits = about(&middle, &thin(hits, params.hits));
        let space = Space::new(&hits, Arc::clone(likelihood), params);
        let roots = space.roots();
        // Nodes that cannot reach the lowest bar relative to this leaf are dropped.
        let dived = space.dive(&roots);
        let lowest = params.first.bar.min(params.in_doubt.bar);
        let hopeless = (lowest * f64::from(dived.map_or(0, |leaf| leaf.bound))) as u32;
        let open = roots.into_iter().filter(|node| node.bound > hopeless).collect();
        Search { params, space, middle, open, dived, hopeless, modes: Vec::new(), nodes: 0 }
    }

    /// Resumes until `reach`; returns all modes so far, best first. Pauses do not change the result.
    pub fn run(&mut self, reach: &SearchLimits, progress: &dyn Progress) -> Result<Modes, AlignError> {
        self.resume(reach.modes, |best| reach.bar * best.map_or(0.0, |best| best.score), progress)?;
        Ok(self.found())
    }

    /// Resumes until it has `modes` modes, or no other pose scores `least`; returns all modes so far, best first.
    pub(crate) fn run_down_to(
        &mut self,
        least: f64,
        modes: usize,
        progress: &dyn Progress,
    ) -> Result<Modes, AlignError> {
        self.resume(modes, |_| least, progress)?;
        Ok(self.found())
    }

    /// Drops the nodes that score less than `least`.
    pub(crate) fn drop_below(&mut self, least: f64) {
        self.hopeless = self.hopeless.max(self.space.bound_below(least));
        self.open.retain(|node| node.bound > self.hopeless);
    }

    /// Returns the best score that is known: a lower bound of the optimum.
    pub(crate) fn known_score(&self) -> f64 {
        let dived = self.dived.map_or(0.0, |leaf| self.space.share(leaf.bound));
        self.modes.first().map_or(dived, |best| best.score)
    }

    /// Resumes until it has `modes` modes, or no open node scores at least what `least` returns for the best mode.
    fn resume(
        &mut self,
        modes: usize,
        least: impl Fn(Option<&Candidate>) -> f64,
        progress: &dyn Progress,
    ) -> Result<(), AlignError> {
        while let Some(top) = self.open.peek() {
            let enough = self.modes.len() >= modes || self.nodes >= self.params.max_nodes;
            if enough || self.space.share(top.bound) < least(self.modes.first()) {
                break;
            }
            if top.level == 0 {
                let Some(leaf) = self.open.pop() else { break };
                let pose = self.space.pose(&leaf);
                if !self.modes.iter().any(|mode| is_close(&mode.map_from_clip, &pose)) {
                    self.modes.push(Candidate { map_from_clip: pose, score: self.space.share(leaf.bound) });
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
        Ok(())
    }

    fn found(&self) -> Modes {
        let mut modes = self.modes.clone();
        if let (true, Some(leaf)) = (modes.is_empty(), self.dived) {
            // The budget ended before the first proof; the fallback is the best known leaf.
            let map_from_clip = self.space.pose(&leaf);
            modes.push(Candidate { map_from_clip, score: self.space.share(leaf.bound) });
        }
        let middle_from_clip = Pose2::new(-self.middle.x, -self.middle.y, 0.0);
        for mode in &mut modes {
            mode.map_from_clip = mode.map_from_clip.compose(&middle_from_clip);
        }
        let open_bound = self.space.share(self.open.peek().map_or(self.hopeless, |top| top.bound));
        Modes { modes, open_bound, nodes: self.nodes, complete: self.nodes < self.params.max_nodes }
    }
}

/// Returns the weighted middle of the hits, without those that no map of a home reaches.
fn middle(hits: &[Hit]) -> Point2 {
    const MOST_M: f64 = 100.0;
    // Integers, so that the order of the hits does not matter.
    const UNITS: f64 = 1024.0;
    let (mut sum, mut weights) = ([0i64; 2], 0i64);
    for hit in hits.iter().filter(|hit| hit.point_m.coords.norm() <= MOST_M) {
        let weight = i64::from(space::weight(hit));
        for (sum, value) in sum.iter_mut().zip([hit.point_m.x, hit.point_m.y]) {
            *sum += weight * (value * UNITS).round() as i64;
        }
        weights += weight;
    }
    Point2::from(sum.map(|sum| sum as f64 / UNITS / weights.max(1) as f64))
}

fn about(middle: &Point2, hits: &[Hit]) -> Vec<Hit> {
    hits.iter().map(|hit| Hit { point_m: Point2::from(hit.point_m - middle), ..*hit }).collect()
}

/// Returns the largest distance of a hit from the middle of all.
pub(crate) fn reach_m(hits: &[Hit]) -> f64 {
    let middle = middle(hits);
    hits.iter().map(|hit| (hit.point_m - middle).norm()).fold(0.0, f64::max)
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
    a.distance_m(b) < APART_M && angle_between(a.yaw_rad, b.yaw_rad) < APART_RAD
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_geometry::progress::Silent;
    use viola_geometry::{DistanceField, Grid, GridFrame, Vector2};

    fn target(walls: &[(usize, usize)]) -> Target {
        let frame = GridFrame { origin_m: [-1.0, 0.5], cell_m: 0.05, width: 56, height: 50 };
        let mut occupied = Grid::filled(frame, false);
        for &(x, y) in walls {
            occupied.set(20 + x % 16, 20 + y % 10, true);
        }
        let points_m: Vec<Point2> =
            walls.iter().map(|&(x, y)| frame.centre(20 + x % 16, 20 + y % 10)).collect();
        // The walls lie on a frame of their own, wider than the one around the points.
        let mut target = Target::from_points(points_m.clone(), Some(0.05), None).unwrap();
        target.field = DistanceField::new(&occupied);
        target.thinned_m = points_m;
        target.points_m = Vec::new();
        target
    }

    fn hit(x: f64, y: f64) -> Hit {
        Hit::standing(Point2::new(x, y), Vector2::x())
    }

    fn small() -> SearchParams {
        let first = SearchLimits { modes: 1, bar: 0.8 };
        SearchParams { rotations: 24, levels: 3, first, ..SearchParams::default() }
    }

    fn search(hits: &[Hit], target: &Target, params: &SearchParams) -> Modes {
        Search::new(hits, target, params).run(&params.first, &Silent).unwrap()
    }

    /// Returns the best score over every rotation and cell, without a pyramid.
    fn brute_force(hits: &[Hit], target: &Target, params: &SearchParams) -> f64 {
        let likelihood = Likelihood::new(target, reach_m(hits), params);
        let space = Space::new(&about(&middle(hits), hits), Arc::new(likelihood), params);
        let roots = space.roots();
        let side = 1i32 << params.levels;
        let leaves = roots.iter().flat_map(|root| {
            (0..side * side).map(|i| space.node(root.rotation, 0, root.x + i % side, root.y + i / side))
        });
        leaves.map(|leaf| space.share(leaf.bound)).fold(0.0, f64::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn finds_what_brute_force_finds(
            walls in prop::collection::vec((0usize..16, 0usize..10), 5..30),
            points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25),
        ) {
            let target = target(&walls);
            let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
            let found = search(&hits, &target, &small());
            let best = found.modes.first().map_or(0.0, |mode| mode.score);
            prop_assert_eq!(best, brute_force(&hits, &target, &small()));
            prop_assert!(found.open_bound <= best);
        }

        #[test]
        fn the_order_of_hits_does_not_matter(points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25)) {
            let target = target(&[(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (9, 7)]);
            let params = SearchParams { first: SearchLimits { modes: 10, bar: 0.8 }, ..small() };
            let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
            let mut turned = hits.clone();
            turned.reverse();
            prop_assert_eq!(
                search(&hits, &target, &params),
                search(&turned, &target, &params)
            );
        }

        #[test]
        fn a_search_that_goes_on_finds_what_one_that_never_paused_does(
            walls in prop::collection::vec((0usize..16, 0usize..10), 5..30),
            points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25),
        ) {
            let target = target(&walls);
            let params = SearchParams { in_doubt: SearchLimits { modes: 12, bar: 0.5 }, ..small() };
            let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
            let mut paused = Search::new(&hits, &target, &params);
            paused.run(&params.first, &Silent).unwrap();
            let mut straight = Search::new(&hits, &target, &params);
            prop_assert_eq!(
                paused.run(&params.in_doubt, &Silent).unwrap(),
                straight.run(&params.in_doubt, &Silent).unwrap()
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn a_search_down_to_a_score_finds_the_modes_that_reach_it(
            walls in prop::collection::vec((0usize..16, 0usize..10), 5..30),
            points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25),
        ) {
            let target = target(&walls);
            let params = SearchParams { in_doubt: SearchLimits { modes: 12, bar: 0.5 }, ..small() };
            let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
            let all = Search::new(&hits, &target, &params).run(&params.in_doubt, &Silent).unwrap();
            let least = 0.8 * all.modes[0].score;
            let likelihood = Arc::new(Likelihood::new(&target, reach_m(&hits) + 0.5, &params));
            let mut search = Search::sharing(&likelihood, &hits, &params);
            prop_assert!(search.known_score() <= all.modes[0].score);
            search.run_down_to(all.modes[0].score, 12, &Silent).unwrap();
            search.drop_below(least);
            let found = search.run_down_to(least, 12, &Silent).unwrap();
            let wanted: Vec<Candidate> = all.modes.into_iter().filter(|mode| mode.score >= least).collect();
            prop_assert_eq!(found.modes, wanted);
        }
    }

    /// The same room is found from outside of the map, wherever the clip begins.
    #[test]
    fn a_clip_that_begins_outside_of_the_map_is_found() {
        let walls: Vec<(usize, usize)> =
            (0..16).map(|x| (x, 0)).chain((0..10).map(|y| (0, y))).chain((4..9).map(|x| (x, 9))).collect();
        let target = target(&walls);
        let params = SearchParams { rotations: 360, ..small() };
        for [x, y] in [[3.0, 0.0], [-3.0, 0.5], [0.0, 3.0], [0.2, -3.0]] {
            let map_from_clip = Pose2::new(x, y, 0.7);
            let clip_from_map = map_from_clip.inverse();
            let seen = |point: &Point2| {
                let point = clip_from_map.apply(point);
                hit(point.x, point.y)
            };
            let hits: Vec<Hit> = target.thinned_m.iter().map(seen).collect();
            let found = search(&hits, &target, &params).modes[0];
            let off = clip_from_map.compose(&found.map_from_clip);
            assert!(found.score > 0.9 && off.translation().norm() < 0.15, "{x} {y} {found:?}");
        }
    }

    /// Hits beyond the map cost the same score everywhere.
    #[test]
    fn hits_far_away_change_no_mode() {
        let target = target(&[(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (9, 7)]);
        let params = SearchParams { first: SearchLimits { modes: 10, bar: 0.8 }, ..small() };
        let mut hits: Vec<Hit> =
            (0..16).map(|i| hit(0.05 * f64::from(i % 4), 0.05 * f64::from(i / 4))).collect();
        let alone = search(&hits, &target, &params);
        hits.extend((0..16).map(|i| hit(9e4 - f64::from(i), 40.0 * f64::from(i) - 500.0)));
        let with_far_hits = search(&hits, &target, &params);
        assert_eq!(with_far_hits.nodes, alone.nodes);
        let poses = |found: &Modes| found.modes.iter().map(|mode| mode.map_from_clip).collect::<Vec<_>>();
        assert_eq!(poses(&with_far_hits), poses(&alone));
        assert_eq!(with_far_hits.modes[0].score, alone.modes[0].score / 2.0);
    }

    #[test]
    fn a_budget_ends_the_search_and_says_so() {
        let target = target(&[(0, 0), (5, 3), (9, 7), (12, 1)]);
        let hits: Vec<Hit> =
            (0..12).map(|i| hit(0.1 * f64::from(i) - 0.6, 0.05 * f64::from(i % 5))).collect();
        let found = search(&hits, &target, &SearchParams { max_nodes: 128, ..small() });
        assert!(found.nodes <= 256);
        assert!(!found.complete && found.modes.len() == 1, "{found:?}");
        assert!(found.open_bound >= found.modes[0].score, "{found:?}");
    }
}
