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
struct Component<'a> {
    clips: Vec<usize>,
    edges: Vec<Edge<'a>>,
}

/// Returns the connected components with at least two clips.
fn components<'a>(count: usize, edges: &[Edge<'a>]) -> Vec<Component<'a>> {
    let mut first: Vec<usize> = (0..count).collect();
    fn root(first: &mut [usize], mut clip: usize) -> usize {
        while first[clip] != clip {
            first[clip] = first[first[clip]];
            clip = first[clip];
        }
        clip
    }
    for edge in edges {
        let (a, b) = (root(&mut first, edge.a), root(&mut first, edge.b));
        first[a.max(b)] = a.min(b);
    }
    let mut of_root = vec![None; count];
    let mut place = vec![0; count];
    let mut components: Vec<Component> = Vec::new();
    for clip in 0..count {
        let root = root(&mut first, clip);
        let number = *of_root[root].get_or_insert(components.len());
        if number == components.len() {
            components.push(Component { clips: Vec::new(), edges: Vec::new() });
        }
        place[clip] = components[number].clips.len();
        components[number].clips.push(clip);
    }
    for edge in edges {
        let root = root(&mut first, edge.a);
        if let Some(number) = of_root[root] {
            let (a, b) = (place[edge.a], place[edge.b]);
            components[number].edges.push(Edge { a, b, overlap: edge.overlap });
        }
    }
    components.retain(|component| !component.edges.is_empty());
    components
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
