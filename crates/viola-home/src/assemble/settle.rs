//! Pose graph: refines the poses of overlapping clips jointly.
//!
//! Each clip has a prior from its own alignment and floor; each overlap is an edge. Every connected component
//! is solved as a whole and by itself, so the poses agree along chains of clips, and a clip does not affect
//! the clips that no chain of overlaps connects to it.

mod normal;

use super::overlap::{Overlap, moved};
use nalgebra::Matrix3;
use normal::NormalEquations;
use rayon::prelude::*;
use std::collections::BTreeMap;
use viola_geometry::Pose3;

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
}

/// An overlap of two clips, by their indices in the graph.
#[derive(Debug, Clone)]
pub(super) struct Edge<'a> {
    pub a: usize,
    pub b: usize,
    pub overlap: &'a Overlap,
}

/// Returns the refined poses. Clips of a component that cannot be solved keep their priors.
pub(super) fn settle(clips: &[Prior], edges: &[Edge], kernels: &[f64]) -> Vec<Pose3> {
    let mut poses: Vec<Pose3> = clips.iter().map(|clip| clip.map_from_clip).collect();
    let solved = components(clips.len(), edges).into_par_iter().filter_map(|component| {
        let poses = component.solve(clips, kernels)?;
        Some((component.clips, poses))
    });
    for (members, refined) in solved.collect::<Vec<_>>() {
        for (clip, pose) in members.into_iter().zip(refined) {
            poses[clip] = pose;
        }
    }
    poses
}

/// Clips connected by overlaps, and these overlaps with indices into `clips`.
#[derive(Default)]
struct Component<'a> {
    clips: Vec<usize>,
    edges: Vec<Edge<'a>>,
}

/// Returns the connected components with at least two clips.
fn components<'a>(count: usize, edges: &[Edge<'a>]) -> Vec<Component<'a>> {
    let mut parents: Vec<usize> = (0..count).collect();
    for edge in edges {
        let (a, b) = (root(&mut parents, edge.a), root(&mut parents, edge.b));
        parents[a.max(b)] = a.min(b);
    }
    // By the component's first clip, which is its root.
    let mut components: BTreeMap<usize, Component> = BTreeMap::new();
    let mut places = Vec::with_capacity(count);
    for clip in 0..count {
        let component = components.entry(root(&mut parents, clip)).or_default();
        places.push(component.clips.len());
        component.clips.push(clip);
    }
    for edge in edges {
        let component = components.entry(root(&mut parents, edge.a)).or_default();
        component.edges.push(Edge { a: places[edge.a], b: places[edge.b], overlap: edge.overlap });
    }
    components.into_values().filter(|component| !component.edges.is_empty()).collect()
}

/// Returns the root of a clip's tree, and shortens the way to it.
fn root(parents: &mut [usize], mut clip: usize) -> usize {
    while parents[clip] != clip {
        parents[clip] = parents[parents[clip]];
        clip = parents[clip];
    }
    clip
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
                for edge in &self.edges {
                    normal.add_edge(edge, &poses, *kernel);
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
