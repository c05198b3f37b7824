//! The space of poses that the search divides: rotations and squares of translations, with upper bounds of
//! their scores.

use super::pyramid::Pyramid;
use super::{APART_M, APART_RAD, Candidate, SearchParams};
use crate::scan::Hit;
use crate::target::Target;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::sync::Arc;
use viola_geometry::{GridFrame, Point2, Pose2, angle_between};

/// Translations are multiples of this.
const CELL_M: f64 = 0.05;

/// Scale of the likelihood that a hit belongs to a map point, by their distance.
const SIGMA_M: f64 = 0.10;
/// Maximum distance of the pivot outside the box around the map.
const MARGIN_M: f64 = 0.3;

/// One rotation and the translations `x..x + 2^level`, `y..y + 2^level`, in cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Node {
    pub(super) bound: u32,
    pub(super) level: u32,
    pub(super) rotation: u32,
    pub(super) x: i32,
    pub(super) y: i32,
}

impl Ord for Node {
    /// Orders by bound; among equals the smaller square, then the lower place, so that the order is total.
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

/// Maximum bytes of the pyramid. Beyond, the search's cells get coarser.
const MAX_BYTES: usize = 128 << 20;
/// Maximum number of squares of the top level over all rotations. Beyond, these squares get larger.
const MAX_ROOTS: usize = 4 << 20;

/// The raster of the search, of bounded cost for any map and any hits.
struct Raster {
    frame: GridFrame,
    /// Maximum distance of a hit that can fall into the map from the pivot, in cells along each axis.
    reach: [usize; 2],
    levels: u32,
}

impl Raster {
    fn new(field: &GridFrame, reach_m: f64, params: &SearchParams) -> Raster {
        let mut cell_m = CELL_M;
        loop {
            let raster = Raster::of_cells(field, reach_m, cell_m, params);
            if raster.bytes() <= MAX_BYTES {
                return raster;
            }
            cell_m *= 2.0;
        }
    }

    fn of_cells(field: &GridFrame, reach_m: f64, cell_m: f64, params: &SearchParams) -> Raster {
        let max_m = [
            field.origin_m[0] + field.width as f64 * field.cell_m,
            field.origin_m[1] + field.height as f64 * field.cell_m,
        ];
        let frame = GridFrame::covering(field.origin_m, max_m, 0.0, cell_m);
        let roots = |levels: u32| {
            params.rotations * frame.width.div_ceil(1 << levels) * frame.height.div_ceil(1 << levels)
        };
        let mut levels = params.levels;
        while roots(levels) > MAX_ROOTS {
            levels += 1;
        }
        // Rounded up, as the hits' cells may be.
        let reach = ((reach_m / cell_m) as usize).saturating_add(1);
        let reach = [frame.width, frame.height].map(|cells| reach.min(cells + (1 << levels)));
        Raster { frame, reach, levels }
    }

    /// Returns the border. A square that begins in the map, moved by the reach, stays within it.
    fn border(&self) -> [usize; 2] {
        self.reach.map(|reach| reach + 1 + (1 << self.levels))
    }

    fn bytes(&self) -> usize {
        let [beside, below] = self.border();
        let cells = (self.frame.width + 2 * beside).saturating_mul(self.frame.height + 2 * below);
        cells.saturating_mul(self.levels as usize + 1)
    }

    /// Returns a step of whole cells; `None` if it leads out of the map from everywhere in it.
    fn step(&self, to: &Point2) -> Option<[i32; 2]> {
        let step = [to.x, to.y].map(|v| (v / self.frame.cell_m).round() as i32);
        let is_near = (0..2).all(|axis| step[axis].unsigned_abs() as usize <= self.reach[axis]);
        is_near.then_some(step)
    }
}

/// The likelihood of a hit at each place of a map, with its maxima over squares. Searches of the same map share it.
pub(crate) struct Likelihood {
    raster: Raster,
    pyramid: Pyramid,
}

impl Likelihood {
    /// Computes the likelihood for hits up to `reach_m` from their pivot.
    pub(crate) fn new(target: &Target, reach_m: f64, params: &SearchParams) -> Likelihood {
        let raster = Raster::new(target.field.frame(), reach_m, params);
        let frame = raster.frame;
        let likelihood = |x: usize, y: usize| {
            let distance_m = target.field.value(&frame.centre(x, y));
            (255.0 * (-0.5 * (distance_m / SIGMA_M).powi(2)).exp()).round() as u8
        };
        let pyramid = Pyramid::new(frame.width, frame.height, raster.border(), raster.levels, likelihood);
        Likelihood { raster, pyramid }
    }

    /// Returns whether its cells are those of a likelihood for a smaller reach.
    pub(super) fn is_as_fine_as_for(&self, target: &Target, reach_m: f64, params: &SearchParams) -> bool {
        self.raster.frame == Raster::new(target.field.frame(), reach_m, params).frame
    }
}

/// Returns the weight of a hit in sixteenths.
pub(super) fn weight(hit: &Hit) -> u32 {
    ((hit.weight * 16.0).round() as u32).max(1)
}

pub(super) struct Space<'a> {
    params: &'a SearchParams,
    likelihood: Arc<Likelihood>,
    /// For each rotation, the hits that can fall into the map.
    offsets: Vec<Vec<Offset>>,
    /// The score of a perfect match.
    full: f64,
}

impl<'a> Space<'a> {
    pub(super) fn new(hits: &[Hit], likelihood: Arc<Likelihood>, params: &'a SearchParams) -> Space<'a> {
        let Likelihood { raster, pyramid } = &*likelihood;
        let offsets: Vec<Vec<Offset>> = (0..params.rotations)
            .into_par_iter()
            .map(|rotation| {
                let turn = Pose2::new(0.0, 0.0, yaw_rad(rotation as u32, params));
                let offset = |hit: &Hit| {
                    let [x, y] = raster.step(&turn.apply(&hit.point_m))?;
                    Some(Offset { step: y * pyramid.stride as i32 + x, weight: weight(hit) })
                };
                hits.iter().filter_map(offset).collect()
            })
            .collect();
        let full = 255.0 * f64::from(hits.iter().map(weight).sum::<u32>().max(1));
        Space { params, likelihood, offsets, full }
    }

    fn frame(&self) -> &GridFrame {
        &self.likelihood.raster.frame
    }

    /// Returns the squares of the top level that together hold every possible pivot.
    pub(super) fn roots(&self) -> Vec<Node> {
        let level = self.likelihood.raster.levels;
        let side = 1i32 << level;
        let frame = self.frame();
        // The field reaches a metre beyond the map's points.
        let inset = ((1.0 - MARGIN_M) / frame.cell_m).max(0.0) as i32;
        let (width, height) = (frame.width as i32 - inset, frame.height as i32 - inset);
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

    pub(super) fn node(&self, rotation: u32, level: u32, x: i32, y: i32) -> Node {
        let pyramid = &self.likelihood.pyramid;
        let maxima = &pyramid.levels[level as usize];
        let place = pyramid.place(x, y) as i32;
        let sum = |o: &Offset| o.weight * u32::from(maxima[(place + o.step) as usize]);
        let bound = self.offsets[rotation as usize].iter().map(sum).sum();
        Node { bound, level, rotation, x, y }
    }

    /// Returns the four quarters, summed together because their cells lie together.
    pub(super) fn children(&self, node: &Node) -> [Node; 4] {
        let level = node.level - 1;
        let half = 1i32 << level;
        let pyramid = &self.likelihood.pyramid;
        let maxima = &pyramid.levels[level as usize];
        let place = pyramid.place(node.x, node.y) as i32;
        let above = half as usize * pyramid.stride;
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

    /// Returns the best leaf under the most promising roots, a lower bound of the optimum.
    pub(super) fn dive(&self, roots: &[Node]) -> Option<Node> {
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

    pub(super) fn pose(&self, leaf: &Node) -> Pose2 {
        let GridFrame { origin_m, cell_m, .. } = *self.frame();
        let x_m = origin_m[0] + (f64::from(leaf.x) + 0.5) * cell_m;
        let y_m = origin_m[1] + (f64::from(leaf.y) + 0.5) * cell_m;
        Pose2::new(x_m, y_m, yaw_rad(leaf.rotation, self.params))
    }

    pub(super) fn fraction(&self, bound: u32) -> f64 {
        f64::from(bound) / self.full
    }

    /// Returns the largest bound that is less than a score.
    pub(super) fn bound_below(&self, score: f64) -> u32 {
        ((score * self.full).ceil() - 1.0).max(0.0) as u32
    }

    /// Returns whether every pose of a node belongs to the neighbourhood of one mode.
    pub(super) fn is_taken(&self, node: &Node, modes: &[Candidate]) -> bool {
        let last = f64::from((1i32 << node.level) - 1) * self.frame().cell_m;
        let corner = self.pose(node);
        modes.iter().any(|mode| {
            let pose = &mode.map_from_clip;
            angle_between(pose.yaw_rad, corner.yaw_rad) < APART_RAD
                && [(0.0, 0.0), (last, 0.0), (0.0, last), (last, last)]
                    .iter()
                    .all(|(dx, dy)| (corner.x_m + dx - pose.x_m).hypot(corner.y_m + dy - pose.y_m) < APART_M)
        })
    }
}

fn yaw_rad(rotation: u32, params: &SearchParams) -> f64 {
    f64::from(rotation) * std::f64::consts::TAU / params.rotations as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(width_m: f64, height_m: f64) -> GridFrame {
        GridFrame::covering([0.0, 0.0], [width_m, height_m], 1.0, 0.05)
    }

    #[test]
    fn no_map_and_no_hits_cost_more_than_the_bound() {
        let params = SearchParams::default();
        for (width_m, height_m) in [(4.0, 3.0), (150.0, 150.0), (250.0, 250.0), (250.0, 1.0), (0.0, 250.0)] {
            for reach_m in [0.0, 5.0, 60.0, 500.0, 1e5, 1e300] {
                let raster = Raster::new(&field(width_m, height_m), reach_m, &params);
                assert!(raster.bytes() <= MAX_BYTES, "{width_m} {height_m} {reach_m}: {}", raster.bytes());
                let squares =
                    [raster.frame.width, raster.frame.height].map(|n| n.div_ceil(1 << raster.levels));
                assert!(params.rotations * squares[0] * squares[1] <= MAX_ROOTS, "{width_m} {height_m}");
            }
        }
    }

    #[test]
    fn a_home_is_searched_at_the_wanted_resolution() {
        let params = SearchParams::default();
        for (side_m, reach_m) in [(10.0, 8.0), (10.0, 1e5), (80.0, 40.0), (150.0, 15.0), (180.0, 5.0)] {
            let raster = Raster::new(&field(side_m, side_m), reach_m, &params);
            assert_eq!(raster.frame.cell_m, CELL_M, "{side_m} {reach_m}");
            assert_eq!(raster.levels == params.levels, side_m < 170.0, "{side_m} {reach_m}");
        }
    }

    #[test]
    fn only_hits_that_fall_into_the_map_from_nowhere_are_left_out() {
        let raster = Raster::new(&field(2.0, 3.0), 1e5, &SearchParams::default());
        // The map is 4 by 5 m with its margins, and a square of the top level 1.6 m wide.
        for (x, y, is_near) in [(5.5, -6.5, true), (5.8, 0.0, false), (0.0, -6.8, false), (1e5, -1e5, false)]
        {
            assert_eq!(raster.step(&Point2::new(x, y)).is_some(), is_near, "{x} {y}");
        }
    }
}
