//! Continuous refinement of all candidates at once on the map's distance field (paper III-C).

use super::raycast::Hit;
use super::target::Target;
use crate::geometry::{Point2, Pose2};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// How poses are refined.
#[derive(Debug, Clone, PartialEq)]
pub struct RefineParams {
    /// Scales of the robust kernel, wide to narrow; a hit this far from the map counts a quarter.
    pub kernel_m: Vec<f64>,
    /// Steps at each scale.
    pub steps: usize,
}

impl Default for RefineParams {
    fn default() -> Self {
        RefineParams { kernel_m: vec![0.4, 0.2, 0.1, 0.05], steps: 8 }
    }
}

/// A pose at a minimum of the robust distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refined {
    pub map_from_clip: Pose2,
    /// Of (x_m, y_m, yaw_rad).
    pub covariance: Matrix3<f64>,
}

/// Refines every pose by itself; the order is kept.
pub fn refine(starts: &[Pose2], hits: &[Hit], target: &Target, params: &RefineParams) -> Vec<Refined> {
    // A quarter of the hits leads to the right valley; all of them find its bottom.
    let some: Vec<Hit> = hits.iter().step_by((hits.len() / 100).clamp(1, 4)).copied().collect();
    starts.par_iter().map(|start| refine_one(start, &some, hits, target, params)).collect()
}

/// Gauss-Newton with the Geman-McClure kernel, annealed: the one-directional distance of hits to the map,
/// with hits that have no counterpart fading out.
fn refine_one(start: &Pose2, some: &[Hit], hits: &[Hit], target: &Target, params: &RefineParams) -> Refined {
    let mut pose = *start;
    let last = params.kernel_m.len().saturating_sub(1);
    for (i, &kernel_m) in params.kernel_m.iter().enumerate() {
        // On the way to the last scale a few millimetres do not matter.
        let (hits, still_m, still_rad) = if i < last { (some, 3e-3, 1e-3) } else { (hits, 1e-4, 2e-5) };
        pose = descend(pose, hits, target, kernel_m, params.steps, still_m, still_rad);
    }
    let kernel_m = params.kernel_m.last().copied().unwrap_or(0.1);
    let covariance = Normal::gather(&pose, hits, target, kernel_m).covariance();
    Refined { map_from_clip: pose, covariance }
}

/// Steps at one scale, until a step moves less than `still_m` and `still_rad`.
fn descend(
    start: Pose2,
    hits: &[Hit],
    target: &Target,
    kernel_m: f64,
    steps: usize,
    still_m: f64,
    still_rad: f64,
) -> Pose2 {
    let mut pose = start;
    let mut normal = Normal::gather(&pose, hits, target, kernel_m);
    let mut damping = 1e-3;
    for _ in 0..steps {
        let Some(step) = normal.step(damping) else { break };
        let moved = Pose2::new(pose.x_m + step.x, pose.y_m + step.y, pose.yaw_rad + step.z);
        let there = Normal::gather(&moved, hits, target, kernel_m);
        if there.cost < normal.cost {
            (pose, normal) = (moved, there);
            damping = f64::max(damping * 0.3, 1e-6);
        } else {
            damping *= 10.0;
        }
        if step.xy().norm() < still_m && step.z.abs() < still_rad {
            break;
        }
    }
    pose
}

/// The normal equations of one pose.
struct Normal {
    information: Matrix3<f64>,
    gradient: Vector3<f64>,
    cost: f64,
    squared: f64,
    weight: f64,
}

impl Normal {
    fn gather(pose: &Pose2, hits: &[Hit], target: &Target, kernel_m: f64) -> Normal {
        let mut normal = Normal {
            information: Matrix3::zeros(),
            gradient: Vector3::zeros(),
            cost: 0.0,
            squared: 0.0,
            weight: 0.0,
        };
        let (sin, cos) = pose.yaw_rad.sin_cos();
        let c2 = kernel_m * kernel_m;
        for hit in hits {
            let (x, y) = (hit.point_m.x, hit.point_m.y);
            let (rx, ry) = (cos * x - sin * y, sin * x + cos * y);
            let (d, slope) = target.field.value_and_gradient(&Point2::new(rx + pose.x_m, ry + pose.y_m));
            let share = c2 / (c2 + d * d);
            let weight = hit.weight * share * share;
            let jacobian = Vector3::new(slope.x, slope.y, slope.y * rx - slope.x * ry);
            normal.information += jacobian * jacobian.transpose() * weight;
            normal.gradient += jacobian * (weight * d);
            normal.cost += hit.weight * d * d * share;
            normal.squared += weight * d * d;
            normal.weight += weight;
        }
        normal
    }

    fn step(&self, damping: f64) -> Option<Vector3<f64>> {
        let mut damped = self.information;
        for i in 0..3 {
            damped[(i, i)] += damping * self.information[(i, i)] + 1e-9;
        }
        damped.cholesky().map(|c| -c.solve(&self.gradient))
    }

    /// Residual variance times the inverse information. Neighbouring hits share the map's and the fusion's
    /// errors, so only one in [`CORRELATED_HITS`] counts as an observation of its own.
    fn covariance(&self) -> Matrix3<f64> {
        const CORRELATED_HITS: f64 = 5.0;
        const FLOOR_M: f64 = 0.01;
        let variance = if self.weight > 0.0 { self.squared / self.weight } else { 1.0 };
        let variance = variance.max(FLOOR_M * FLOOR_M) * CORRELATED_HITS;
        // A direction that nothing holds gets a metre (a radian) of doubt, not infinity.
        let information = self.information / variance + Matrix3::identity();
        let inverse = information.try_inverse().unwrap_or_else(Matrix3::identity);
        (inverse + inverse.transpose()) * 0.5
    }
}
