//! Refines all candidates at once, continuously, on the map's distance field (paper III-C).

mod mean;
mod scale;

pub use mean::{Mean, Spread, mean};
pub use scale::{Rescaled, refine_with_scale, spread_of_scale};

use super::scan::Hit;
use super::target::Target;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use viola_geometry::{Point2, Pose2};

/// Scales of the robust kernel, wide to narrow; a hit this far from the map has a quarter of its weight.
const KERNEL_M: [f64; 3] = [0.4, 0.15, 0.05];
/// Maximum number of steps at each scale.
const STEPS: usize = 6;

/// A pose at a minimum of the robust distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refined {
    pub map_from_clip: Pose2,
    /// Covariance of (x_m, y_m, yaw_rad).
    pub covariance: Matrix3<f64>,
}

/// Refines every pose; the order is kept. Gauss-Newton with the annealed Geman-McClure kernel minimises the
/// one-directional distance of hits to the map; hits without a counterpart fade out.
///
/// Descents that have met continue as one, from the first start of the bunch.
pub fn refine(starts: &[Pose2], hits: &[Hit], target: &Target) -> Vec<Refined> {
    // A quarter of the hits finds the right valley; all of them find its bottom.
    let hits: Vec<Weighted> = hits.iter().map(Weighted::from).collect();
    let some: Vec<Weighted> = hits.iter().step_by((hits.len() / 100).clamp(1, 4)).copied().collect();
    let mut bunches = Bunches::new(starts);
    for (i, &kernel_m) in KERNEL_M.iter().enumerate() {
        // Before the last scale, a few millimetres do not matter.
        let last = i + 1 == KERNEL_M.len();
        let (hits, still_m, still_rad) = if last { (&hits, 4e-4, 1e-4) } else { (&some, 3e-3, 1e-3) };
        let params = DescentParams { kernel_m, steps: STEPS, still_m, still_rad };
        let leaders = &mut bunches.leaders;
        leaders.par_iter_mut().for_each(|pose| *pose = descend(*pose, hits, target, &params));
        if !last {
            bunches.join();
        }
    }
    let kernel_m = KERNEL_M.last().copied().unwrap_or(0.1);
    let settle = |pose: &Pose2| Refined {
        map_from_clip: *pose,
        covariance: covariance(pose, &hits, target, kernel_m),
    };
    let refined: Vec<Refined> = bunches.leaders.par_iter().map(settle).collect();
    bunches.of_start.iter().map(|&leader| refined[leader]).collect()
}

/// The used part of a hit, packed, so that all hits stay in the fastest cache.
#[derive(Clone, Copy)]
struct Weighted {
    x_m: f64,
    y_m: f64,
    weight: f64,
}

impl From<&Hit> for Weighted {
    fn from(hit: &Hit) -> Weighted {
        Weighted { x_m: hit.point_m.x, y_m: hit.point_m.y, weight: hit.weight }
    }
}

/// The distinct poses of a refinement, and the pose of each start.
struct Bunches {
    leaders: Vec<Pose2>,
    of_start: Vec<usize>,
}

impl Bunches {
    fn new(starts: &[Pose2]) -> Bunches {
        Bunches { leaders: starts.to_vec(), of_start: (0..starts.len()).collect() }
    }

    /// Joins poses that lie closer together than the narrowest kernel can resolve.
    fn join(&mut self) {
        const MET_M: f64 = 0.02;
        const MET_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
        let mut kept: Vec<Pose2> = Vec::new();
        let mut now = Vec::with_capacity(self.leaders.len());
        for pose in &self.leaders {
            let met = |kept: &Pose2| kept.is_within(pose, MET_M, MET_RAD);
            now.push(kept.iter().position(met).unwrap_or_else(|| {
                kept.push(*pose);
                kept.len() - 1
            }));
        }
        for leader in &mut self.of_start {
            *leader = now[*leader];
        }
        self.leaders = kept;
    }
}

/// The scale of the kernel in a descent, and where the descent ends.
struct DescentParams {
    kernel_m: f64,
    /// Maximum number of steps.
    steps: usize,
    /// A step that moves and turns the pose by less is the last one.
    still_m: f64,
    still_rad: f64,
}

/// Descends at one scale.
fn descend(start: Pose2, hits: &[Weighted], target: &Target, params: &DescentParams) -> Pose2 {
    let mut pose = start;
    let mut normal = Normal::gather(&pose, hits, target, params.kernel_m);
    let mut damping = 1e-3;
    for _ in 0..params.steps {
        let Some(step) = normal.step(damping) else { break };
        let moved = Pose2::new(pose.x_m + step.x, pose.y_m + step.y, pose.yaw_rad + step.z);
        let there = Normal::gather(&moved, hits, target, params.kernel_m);
        if there.cost < normal.cost {
            (pose, normal) = (moved, there);
            damping = f64::max(damping * 0.3, 1e-6);
        } else {
            damping *= 10.0;
        }
        if step.xy().norm() < params.still_m && step.z.abs() < params.still_rad {
            break;
        }
    }
    pose
}

/// The normal equations of one pose.
struct Normal {
    /// Upper triangle, row by row.
    information: [f64; 6],
    gradient: Vector3<f64>,
    cost: f64,
}

impl Normal {
    fn gather(pose: &Pose2, hits: &[Weighted], target: &Target, kernel_m: f64) -> Normal {
        let mut information = [0.0; 6];
        let mut gradient = [0.0; 3];
        let mut cost = 0.0;
        let (sin, cos) = pose.yaw_rad.sin_cos();
        let c2 = kernel_m * kernel_m;
        for hit in hits {
            let (x, y) = (hit.x_m, hit.y_m);
            let (rx, ry) = (cos * x - sin * y, sin * x + cos * y);
            let (d, slope) = target.field.value_and_gradient(&Point2::new(rx + pose.x_m, ry + pose.y_m));
            let kernel_weight = c2 / (c2 + d * d);
            let bent = hit.weight * kernel_weight;
            let weight = bent * kernel_weight;
            let turn = slope.y * rx - slope.x * ry;
            let (wx, wy, wt) = (weight * slope.x, weight * slope.y, weight * turn);
            information[0] += wx * slope.x;
            information[1] += wx * slope.y;
            information[2] += wx * turn;
            information[3] += wy * slope.y;
            information[4] += wy * turn;
            information[5] += wt * turn;
            gradient[0] += wx * d;
            gradient[1] += wy * d;
            gradient[2] += wt * d;
            cost += bent * d * d;
        }
        Normal { information, gradient: gradient.into(), cost }
    }

    fn information(&self) -> Matrix3<f64> {
        let [xx, xy, xt, yy, yt, tt] = self.information;
        Matrix3::new(xx, xy, xt, xy, yy, yt, xt, yt, tt)
    }

    fn step(&self, damping: f64) -> Option<Vector3<f64>> {
        let mut damped = self.information();
        for i in 0..3 {
            damped[(i, i)] += damping * damped[(i, i)] + 1e-9;
        }
        damped.cholesky().map(|c| -c.solve(&self.gradient))
    }
}

/// Returns the cost that the descents minimise.
fn cost(pose: &Pose2, hits: &[Weighted], target: &Target, kernel_m: f64) -> f64 {
    let c2 = kernel_m * kernel_m;
    let (sin, cos) = pose.yaw_rad.sin_cos();
    let of_hit = |hit: &Weighted| {
        let (rx, ry) = (cos * hit.x_m - sin * hit.y_m, sin * hit.x_m + cos * hit.y_m);
        let (d, _) = target.field.value_and_gradient(&Point2::new(rx + pose.x_m, ry + pose.y_m));
        hit.weight * d * d * c2 / (c2 + d * d)
    };
    hits.iter().map(of_hit).sum()
}

/// Returns the variance of one hit's distance from the map at a pose. Neighbouring hits share the map's and
/// the fusion's errors, so only one in `CORRELATED_HITS` counts as an independent observation.
fn variance_m2(pose: &Pose2, hits: &[Weighted], target: &Target, kernel_m: f64) -> f64 {
    const CORRELATED_HITS: f64 = 5.0;
    const FLOOR_M: f64 = 0.01;
    let c2 = kernel_m * kernel_m;
    let (mut squared, mut weights) = (0.0, 0.0);
    for hit in hits {
        let d = target.field.value(&pose.apply(&Point2::new(hit.x_m, hit.y_m)));
        let kernel_weight = c2 / (c2 + d * d);
        squared += hit.weight * kernel_weight * kernel_weight * d * d;
        weights += hit.weight * kernel_weight * kernel_weight;
    }
    let variance = if weights > 0.0 { squared / weights } else { 1.0 };
    variance.max(FLOOR_M * FLOOR_M) * CORRELATED_HITS
}

/// Returns [`variance_m2`] times the inverse information.
fn covariance(pose: &Pose2, hits: &[Weighted], target: &Target, kernel_m: f64) -> Matrix3<f64> {
    // An unconstrained direction gets a deviation of a metre (a radian), not infinity.
    let information = Normal::gather(pose, hits, target, kernel_m).information()
        / variance_m2(pose, hits, target, kernel_m)
        + Matrix3::identity();
    let inverse = information.try_inverse().unwrap_or_else(Matrix3::identity);
    (inverse + inverse.transpose()) * 0.5
}
