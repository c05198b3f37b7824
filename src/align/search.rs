//! The global optimum of the likelihood over the whole map, with a certificate (Olson, 2009; Hess et al., 2016).
//!
//! The score of a pose is the weighted mean likelihood of the cells that its hits fall into. A node of the
//! search is one rotation and a square of translations; its bound takes, for each hit, the largest
//! likelihood that the square lets it reach, from a pyramid of maxima. Nodes are opened best first, so poses
//! come out in the order of their scores, and the first one is the optimum. All sums are integers: neither
//! threads nor the order of the hits change a bit.

use super::AlignError;
use super::pyramid::Pyramid;
use super::raycast::Hit;
use super::target::Target;
use crate::geometry::{GridFrame, Point2, Pose2, angle_between};
use crate::progress::{self, Progress};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A pose worth refining.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    pub map_from_clip: Pose2,
    /// Weighted mean likelihood of the hits, 0..1.
    pub score: f64,
}

/// How the search runs.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchParams {
    /// Translations are multiples of this.
    pub cell_m: f64,
    pub rotations: usize,
    /// Scale of the likelihood that a hit belongs to a map point, by their distance.
    pub sigma_m: f64,
    /// Hits used; of more, every so many-th is taken, so that clutter keeps its share and no more.
    pub hits: usize,
    /// The clip's origin may lie this far outside the box around the map.
    pub margin_m: f64,
    /// Height of the pyramid: squares of up to `2^levels` cells.
    pub levels: u32,
    /// Modes returned ...
    pub modes: usize,
    /// ... as long as they reach this share of the best score.
    pub bar: f64,
    /// Poses nearer than this, and turned less than `apart_rad` from each other, are one mode.
    pub apart_m: f64,
    pub apart_rad: f64,
    /// Nodes opened before the search stops early and says so in the certificate. A count and not a time,
    /// so that the answer is the same on a slow machine.
    pub max_nodes: usize,
}

impl Default for SearchParams {
    fn default() -> Self {
        SearchParams {
            cell_m: 0.05,
            rotations: 360,
            sigma_m: 0.10,
            hits: 128,
            margin_m: 0.3,
            levels: 5,
            modes: 40,
            bar: 0.8,
            apart_m: 0.25,
            apart_rad: 8f64.to_radians(),
            max_nodes: 1_500_000,
        }
    }
}

/// The modes, best first, and what is proven about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Modes {
    pub modes: Vec<Candidate>,
    /// No pose outside the neighbourhoods of the modes scores above this. When the first mode's score is at
    /// least this, it is the global optimum.
    pub open_bound: f64,
    pub nodes: usize,
    /// Whether the search ended by itself and not by its budget.
    pub complete: bool,
}

/// Searches all poses whose origin lies in the map.
pub fn search(
    hits: &[Hit],
    target: &Target,
    params: &SearchParams,
    progress: &dyn Progress,
) -> Result<Modes, AlignError> {
    let hits = thin(hits, params.hits);
    let space = Space::new(&hits, target, params);
    let roots = space.roots();
    // What cannot reach the bar even of this need not be remembered.
    let dived = space.dive(&roots);
    let hopeless = (params.bar * f64::from(dived.map_or(0, |leaf| leaf.bound))) as u32;
    let mut open: BinaryHeap<Node> = roots.into_iter().filter(|node| node.bound > hopeless).collect();
    let mut modes: Vec<Candidate> = Vec::new();
    let mut nodes = 0;
    while let Some(top) = open.peek() {
        let enough = modes.len() == params.modes || nodes >= params.max_nodes;
        let low = modes.first().is_some_and(|best| space.share(top.bound) < params.bar * best.score);
        if enough || low {
            break;
        }
        if top.level == 0 {
            let Some(leaf) = open.pop() else { break };
            let pose = space.pose(&leaf);
            if !modes.iter().any(|mode| is_close(&mode.map_from_clip, &pose, params)) {
                modes.push(Candidate { map_from_clip: pose, score: space.share(leaf.bound) });
            }
            continue;
        }
        progress::check(progress)?;
        let batch = pop_batch(&mut open, |node| space.is_taken(node, &modes));
        nodes += batch.len();
        let children: Vec<[Node; 4]> =
            batch.par_iter().with_min_len(32).map(|node| space.children(node)).collect();
        open.extend(children.into_iter().flatten().filter(|child| child.bound > hopeless));
    }
    if let (true, Some(leaf)) = (modes.is_empty(), dived) {
        // The budget ended before the first proof: the best that is known is better than nothing.
        modes.push(Candidate { map_from_clip: space.pose(&leaf), score: space.share(leaf.bound) });
    }
    let open_bound = space.share(open.peek().map_or(hopeless, |top| top.bound));
    Ok(Modes { modes, open_bound, nodes, complete: nodes < params.max_nodes })
}

fn thin(hits: &[Hit], most: usize) -> Vec<Hit> {
    let kept = most.min(hits.len());
    (0..kept).map(|i| hits[i * hits.len() / kept]).collect()
}

/// The best inner nodes, up to the first leaf. The number is fixed: it must not depend on threads.
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

fn is_close(a: &Pose2, b: &Pose2, params: &SearchParams) -> bool {
    a.distance_m(b) < params.apart_m && angle_between(a.yaw_rad, b.yaw_rad) < params.apart_rad
}

/// One rotation and the translations `x..x + 2^level`, `y..y + 2^level`, in cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Node {
    bound: u32,
    level: u32,
    rotation: u32,
    x: i32,
    y: i32,
}

impl Ord for Node {
    /// By bound; among equals the smaller square, then the lower place, so that the order is total.
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |n: &Node| (n.bound, std::cmp::Reverse((n.level, n.rotation, n.y, n.x)));
        key(self).cmp(&key(other))
    }
}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// A hit at some rotation, as a step between places of the pyramid.
#[derive(Clone, Copy)]
struct Offset {
    step: i32,
    weight: u32,
}

struct Space<'a> {
    params: &'a SearchParams,
    frame: GridFrame,
    pyramid: Pyramid,
    /// For each rotation, the hits.
    offsets: Vec<Vec<Offset>>,
    /// The score of a perfect match.
    full: f64,
}

impl<'a> Space<'a> {
    fn new(hits: &[Hit], target: &Target, params: &'a SearchParams) -> Space<'a> {
        let field = target.field.frame();
        let max_m = [
            field.origin_m[0] + field.width as f64 * field.cell_m,
            field.origin_m[1] + field.height as f64 * field.cell_m,
        ];
        let frame = GridFrame::covering(field.origin_m, max_m, 0.0, params.cell_m);
        let likelihood = |x: usize, y: usize| {
            let distance_m = target.field.value(&frame.centre(x, y));
            (255.0 * (-0.5 * (distance_m / params.sigma_m).powi(2)).exp()).round() as u8
        };
        let reach_m = hits.iter().map(|hit| hit.point_m.coords.norm()).fold(0.0, f64::max);
        let border = (reach_m / params.cell_m) as usize + 2 + (1 << params.levels);
        let pyramid = Pyramid::new(frame.width, frame.height, border, params.levels, likelihood);
        // Weights in sixteenths.
        let weight = |hit: &Hit| ((hit.weight * 16.0).round() as u32).max(1);
        let offsets: Vec<Vec<Offset>> = (0..params.rotations)
            .into_par_iter()
            .map(|rotation| {
                let turn = Pose2::new(0.0, 0.0, yaw_rad(rotation as u32, params));
                let cells = |v: f64| (v / params.cell_m).round() as i32;
                let step = |p: Point2| cells(p.y) * pyramid.stride as i32 + cells(p.x);
                hits.iter()
                    .map(|hit| Offset { step: step(turn.apply(&hit.point_m)), weight: weight(hit) })
                    .collect()
            })
            .collect();
        let full = 255.0 * f64::from(hits.iter().map(weight).sum::<u32>().max(1));
        Space { params, frame, pyramid, offsets, full }
    }

    /// Squares of the top level that together hold every place the origin may have.
    fn roots(&self) -> Vec<Node> {
        let level = self.params.levels;
        let side = 1i32 << level;
        // The field reaches a metre beyond the map's points.
        let inset = ((1.0 - self.params.margin_m) / self.params.cell_m).max(0.0) as i32;
        let (width, height) = (self.frame.width as i32 - inset, self.frame.height as i32 - inset);
        (0..self.params.rotations as u32)
            .into_par_iter()
            .flat_map_iter(|rotation| {
                let places = (inset..height)
                    .step_by(side as usize)
                    .flat_map(move |y| (inset..width).step_by(side as usize).map(move |x| (x, y)));
                places.map(move |(x, y)| self.node(rotation, level, x, y))
            })
            .filter(|node| node.bound > 0)
            .collect()
    }

    fn node(&self, rotation: u32, level: u32, x: i32, y: i32) -> Node {
        let maxima = &self.pyramid.levels[level as usize];
        let place = self.pyramid.place(x, y) as i32;
        let sum = |o: &Offset| o.weight * u32::from(maxima[(place + o.step) as usize]);
        let bound = self.offsets[rotation as usize].iter().map(sum).sum();
        Node { bound, level, rotation, x, y }
    }

    /// The four quarters, summed together because their cells lie together.
    fn children(&self, node: &Node) -> [Node; 4] {
        let level = node.level - 1;
        let half = 1i32 << level;
        let maxima = &self.pyramid.levels[level as usize];
        let place = self.pyramid.place(node.x, node.y) as i32;
        let above = half as usize * self.pyramid.stride;
        let mut sums = [0u32; 4];
        for offset in &self.offsets[node.rotation as usize] {
            let at = (place + offset.step) as usize;
            let corners = [at, at + half as usize, at + above, at + above + half as usize];
            for (sum, corner) in sums.iter_mut().zip(corners) {
                *sum += offset.weight * u32::from(maxima[corner]);
            }
        }
        let quarter = |i: usize, dx: i32, dy: i32| Node {
            bound: sums[i],
            level,
            rotation: node.rotation,
            x: node.x + dx,
            y: node.y + dy,
        };
        [quarter(0, 0, 0), quarter(1, half, 0), quarter(2, 0, half), quarter(3, half, half)]
    }

    /// The best leaf under the most promising roots: what the optimum reaches at least.
    fn dive(&self, roots: &[Node]) -> Option<Node> {
        const DIVES: usize = 64;
        let mut best: Vec<&Node> = roots.iter().collect();
        best.sort_unstable_by(|a, b| b.cmp(a));
        best.truncate(DIVES);
        best.into_par_iter()
            .map(|root| {
                let mut node = *root;
                while node.level > 0 {
                    node = self.children(&node).into_iter().max().unwrap_or(node);
                }
                node
            })
            .max()
    }

    fn pose(&self, leaf: &Node) -> Pose2 {
        let x_m = self.frame.origin_m[0] + (f64::from(leaf.x) + 0.5) * self.frame.cell_m;
        let y_m = self.frame.origin_m[1] + (f64::from(leaf.y) + 0.5) * self.frame.cell_m;
        Pose2::new(x_m, y_m, yaw_rad(leaf.rotation, self.params))
    }

    fn share(&self, bound: u32) -> f64 {
        f64::from(bound) / self.full
    }

    /// Whether every pose of a node belongs to the neighbourhood of one mode.
    fn is_taken(&self, node: &Node, modes: &[Candidate]) -> bool {
        let last = f64::from((1i32 << node.level) - 1) * self.frame.cell_m;
        let corner = self.pose(node);
        modes.iter().any(|mode| {
            let pose = &mode.map_from_clip;
            angle_between(pose.yaw_rad, corner.yaw_rad) < self.params.apart_rad
                && [(0.0, 0.0), (last, 0.0), (0.0, last), (last, last)].iter().all(|(dx, dy)| {
                    (corner.x_m + dx - pose.x_m).hypot(corner.y_m + dy - pose.y_m) < self.params.apart_m
                })
        })
    }
}

fn yaw_rad(rotation: u32, params: &SearchParams) -> f64 {
    f64::from(rotation) * std::f64::consts::TAU / params.rotations as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{DistanceField, Grid, Vector2};
    use crate::progress::Silent;
    use proptest::prelude::*;

    fn target(walls: &[(usize, usize)]) -> Target {
        let frame = GridFrame { origin_m: [-1.0, 0.5], cell_m: 0.05, width: 56, height: 50 };
        let mut occupied = Grid::filled(frame, false);
        for &(x, y) in walls {
            occupied.set(20 + x % 16, 20 + y % 10, true);
        }
        let points_m: Vec<Point2> =
            walls.iter().map(|&(x, y)| frame.centre(20 + x % 16, 20 + y % 10)).collect();
        Target {
            thinned_m: points_m,
            points_m: Vec::new(),
            cells: None,
            field: DistanceField::new(&occupied),
        }
    }

    fn hit(x: f64, y: f64) -> Hit {
        Hit {
            point_m: Point2::new(x, y),
            normal: Vector2::x(),
            weight: 1.0,
            extent_m: 1.0,
            at_vacuum_height: true,
            from_m: Point2::origin(),
        }
    }

    fn small() -> SearchParams {
        SearchParams { rotations: 24, levels: 3, modes: 1, ..SearchParams::default() }
    }

    /// The best score over every rotation and cell, without a pyramid.
    fn brute_force(hits: &[Hit], target: &Target, params: &SearchParams) -> f64 {
        let space = Space::new(hits, target, params);
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
            let found = search(&hits, &target, &small(), &Silent).unwrap();
            let best = found.modes.first().map_or(0.0, |mode| mode.score);
            prop_assert_eq!(best, brute_force(&hits, &target, &small()));
            prop_assert!(found.open_bound <= best);
        }

        #[test]
        fn the_order_of_hits_does_not_matter(points in prop::collection::vec((-0.6..0.6f64, -0.6..0.6f64), 3..25)) {
            let target = target(&[(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (9, 7)]);
            let params = SearchParams { modes: 10, ..small() };
            let hits: Vec<Hit> = points.iter().map(|&(x, y)| hit(x, y)).collect();
            let mut turned = hits.clone();
            turned.reverse();
            prop_assert_eq!(
                search(&hits, &target, &params, &Silent).unwrap(),
                search(&turned, &target, &params, &Silent).unwrap()
            );
        }
    }

    #[test]
    fn a_budget_ends_the_search_and_says_so() {
        let target = target(&[(0, 0), (5, 3), (9, 7), (12, 1)]);
        let hits: Vec<Hit> =
            (0..12).map(|i| hit(0.1 * f64::from(i) - 0.6, 0.05 * f64::from(i % 5))).collect();
        let found = search(&hits, &target, &SearchParams { max_nodes: 128, ..small() }, &Silent).unwrap();
        assert!(found.nodes <= 256);
        assert!(!found.complete && found.modes.len() == 1, "{found:?}");
        assert!(found.open_bound >= found.modes[0].score, "{found:?}");
    }
}
