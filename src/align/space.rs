//! The space of poses that the search divides: rotations, squares of translations, and what each can score at
//! best.

use super::pyramid::Pyramid;
use super::raycast::Hit;
use super::search::{Candidate, SearchParams};
use super::target::Target;
use crate::geometry::{GridFrame, Point2, Pose2, angle_between};
use rayon::prelude::*;
use std::cmp::Ordering;

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

pub(super) struct Space<'a> {
    params: &'a SearchParams,
    frame: GridFrame,
    pyramid: Pyramid,
    /// For each rotation, the hits.
    offsets: Vec<Vec<Offset>>,
    /// The score of a perfect match.
    full: f64,
}

impl<'a> Space<'a> {
    pub(super) fn new(hits: &[Hit], target: &Target, params: &'a SearchParams) -> Space<'a> {
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
    pub(super) fn roots(&self) -> Vec<Node> {
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

    pub(super) fn node(&self, rotation: u32, level: u32, x: i32, y: i32) -> Node {
        let maxima = &self.pyramid.levels[level as usize];
        let place = self.pyramid.place(x, y) as i32;
        let sum = |o: &Offset| o.weight * u32::from(maxima[(place + o.step) as usize]);
        let bound = self.offsets[rotation as usize].iter().map(sum).sum();
        Node { bound, level, rotation, x, y }
    }

    /// The four quarters, summed together because their cells lie together.
    pub(super) fn children(&self, node: &Node) -> [Node; 4] {
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
        let x_m = self.frame.origin_m[0] + (f64::from(leaf.x) + 0.5) * self.frame.cell_m;
        let y_m = self.frame.origin_m[1] + (f64::from(leaf.y) + 0.5) * self.frame.cell_m;
        Pose2::new(x_m, y_m, yaw_rad(leaf.rotation, self.params))
    }

    pub(super) fn share(&self, bound: u32) -> f64 {
        f64::from(bound) / self.full
    }

    /// Whether every pose of a node belongs to the neighbourhood of one mode.
    pub(super) fn is_taken(&self, node: &Node, modes: &[Candidate]) -> bool {
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
