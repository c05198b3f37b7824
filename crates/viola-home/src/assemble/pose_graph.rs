//! Pose graph: refines the poses of overlapping clips jointly.
//!
//! Each clip has a prior from its own alignment and floor; each overlap is an edge. Every connected component
//! is solved as a whole and by itself, so the poses agree along chains of clips, and a clip does not affect
//! the clips that no chain of overlaps connects to it. Fixed clips do not move; they divide the components.

mod normal;

use super::overlap::{Overlap, moved};
use nalgebra::Matrix3;
use normal::NormalEquations;
use rayon::prelude::*;
use std::collections::BTreeMap;
use viola_geometry::{Pose3, groups};

/// Scales of the edges' robust kernel, in standard deviations, wide to narrow. Overlaps are known to
/// millimetres and alignments to centimetres, so a narrow kernel would reject every edge at the start.
pub(super) const KERNELS: [f64; 4] = [48.0, 12.0, 6.0, 3.0];
/// Gauss-Newton steps at each scale.
const STEPS: usize = 8;

/// A clip's prior in the graph.
#[derive(Debug, Clone)]
pub(super) struct Prior {
    pub map_from_clip: Pose3,
    /// Of (x_m, y_m, yaw_rad); none for a pose fixed by a person.
    pub covariance: Option<Matrix3<f64>>,
    /// True for a clip that does not move.
    pub is_fixed: bool,
}

/// An overlap of two clips, by their indices in the graph.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge<'a> {
    pub a: usize,
    pub b: usize,
    pub overlap: &'a Overlap,
}

/// Returns the refined poses. Clips of a component that cannot be solved keep their priors.
pub(super) fn refine_poses(clips: &[Prior], edges: &[Edge], kernels: &[f64]) -> Vec<Pose3> {
    let mut poses: Vec<Pose3> = clips.iter().map(|clip| clip.map_from_clip).collect();
    let solved = components(clips, edges).into_par_iter().filter_map(|component| {
        let poses = component.solve(clips, kernels)?;
        Some((component.clips, poses))
    });
    for (members, refined) in solved.collect::<Vec<_>>() {
        let refined = members.into_iter().zip(refined);
        refined.filter(|(clip, _)| !clips[*clip].is_fixed).for_each(|(clip, pose)| poses[clip] = pose);
    }
    poses
}

/// Clips connected by overlaps, and these overlaps with indices into `clips`.
#[derive(Default)]
struct Component<'a> {
    clips: Vec<usize>,
    edges: Vec<Edge<'a>>,
}

/// Returns the connected components with at least one edge, each with the fixed clips that it is joined to.
fn components<'a>(clips: &[Prior], edges: &[Edge<'a>]) -> Vec<Component<'a>> {
    let is_open = |clip: &usize| !clips[*clip].is_fixed;
    let mut parents: Vec<u32> = (0..clips.len() as u32).collect();
    for edge in edges.iter().filter(|edge| is_open(&edge.a) && is_open(&edge.b)) {
        groups::join(&mut parents, edge.a as u32, edge.b as u32);
    }
    // By the component's first clip, which is its root.
    let mut components: BTreeMap<u32, Component> = BTreeMap::new();
    for edge in edges {
        let ends = [edge.a, edge.b];
        let Some(open) = ends.into_iter().find(is_open) else { continue };
        let component = components.entry(groups::root(&mut parents, open as u32)).or_default();
        component.clips.extend(ends);
        component.edges.push(*edge);
    }
    for component in components.values_mut() {
        component.clips.sort_unstable();
        component.clips.dedup();
        let place = |clip: usize| component.clips.binary_search(&clip).unwrap_or_default();
        component.edges.iter_mut().for_each(|edge| (edge.a, edge.b) = (place(edge.a), place(edge.b)));
    }
    components.into_values().collect()
}

impl Component<'_> {
    fn solve(&self, clips: &[Prior], kernels: &[f64]) -> Option<Vec<Pose3>> {
        let priors: Vec<&Prior> = self.clips.iter().map(|clip| &clips[*clip]).collect();
        let mut poses: Vec<Pose3> = priors.iter().map(|prior| prior.map_from_clip).collect();
        for kernel in kernels {
            for _ in 0..STEPS {
                let mut normal = NormalEquations::new(poses.len());
                for (i, prior) in priors.iter().enumerate() {
                    normal.add_prior(i, &poses[i], prior);
                }
                let is_fixed = |i: usize| priors[i].is_fixed;
                for edge in &self.edges {
                    normal.add_edge(edge, &poses, *kernel, is_fixed);
                }
                let steps = normal.solve()?;
                for (pose, step) in poses.iter_mut().zip(&steps) {
                    *pose = moved(pose, step);
                }
                if steps.iter().all(|step| step.amax() < 1e-7) {
                    break;
                }
            }
        }
        poses.iter().all(|pose| pose.translation.vector.iter().all(|c| c.is_finite())).then_some(poses)
    }
}

#[cfg(test)]
mod tests;
