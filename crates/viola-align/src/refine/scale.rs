//! Refines poses together with the scale of the hits, for clips whose unit is unknown.

use super::{DescentParams, KERNEL_M, STEPS, Weighted, cost, descend, variance_m2};
use crate::scan::Hit;
use crate::target::Target;
use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;
use viola_geometry::{Point2, Pose2};

/// A pose, and a factor of the hits, at a minimum of the robust distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rescaled {
    pub map_from_clip: Pose2,
    pub factor: f64,
}

/// Distribution of the logarithm of a scale by the likelihood of the hits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogScale {
    pub mean: f64,
    /// Without calibration.
    pub std: f64,
    /// Root mean squared distance of the hits from their middle.
    pub radius_m: f64,
}

/// Refines every pose with a factor of its own, at most `most_log` from 1; the order is kept. The descent is
/// that of [`super::refine`] with a fourth parameter.
pub fn refine_with_scale(starts: &[Pose2], hits: &[Hit], target: &Target, most_log: f64) -> Vec<Rescaled> {
    let hits: Vec<Weighted> = hits.iter().map(Weighted::from).collect();
    let some: Vec<Weighted> = hits.iter().step_by((hits.len() / 100).clamp(1, 4)).copied().collect();
    let refined = |start: &Pose2| {
        let mut at = Rescaled { map_from_clip: *start, factor: 1.0 };
        for (i, &kernel_m) in KERNEL_M.iter().enumerate() {
            let hits = if i + 1 == KERNEL_M.len() { &hits } else { &some };
            at = descend_with_scale(at, hits, target, kernel_m, most_log);
        }
        at
    };
    starts.par_iter().map(refined).collect()
}

fn descend_with_scale(
    start: Rescaled,
    hits: &[Weighted],
    target: &Target,
    kernel_m: f64,
    most_log: f64,
) -> Rescaled {
    const STILL: f64 = 4e-4;
    let mut at = start;
    let mut normal = Normal::gather(&at, hits, target, kernel_m);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let Some(step) = normal.step(damping) else { break };
        let pose = &at.map_from_clip;
        let moved = Rescaled {
            map_from_clip: Pose2::new(pose.x_m + step.x, pose.y_m + step.y, pose.yaw_rad + step.z),
            factor: (at.factor.ln() + step.w).clamp(-most_log, most_log).exp(),
        };
        let there = Normal::gather(&moved, hits, target, kernel_m);
        if there.cost < normal.cost {
            (at, normal) = (moved, there);
            damping = f64::max(damping * 0.3, 1e-6);
        } else {
            damping *= 10.0;
        }
        if step.amax() < STILL {
            break;
        }
    }
    at
}

/// The normal equations of one pose and factor, in (x, y, yaw, logarithm of the factor).
struct Normal {
    information: Matrix4<f64>,
    gradient: Vector4<f64>,
    cost: f64,
}

impl Normal {
    fn gather(at: &Rescaled, hits: &[Weighted], target: &Target, kernel_m: f64) -> Normal {
        let mut normal = Normal { information: Matrix4::zeros(), gradient: Vector4::zeros(), cost: 0.0 };
        let pose = &at.map_from_clip;
        let (sin, cos) = pose.yaw_rad.sin_cos();
        let (sin, cos) = (sin * at.factor, cos * at.factor);
        let c2 = kernel_m * kernel_m;
        for hit in hits {
            let (rx, ry) = (cos * hit.x_m - sin * hit.y_m, sin * hit.x_m + cos * hit.y_m);
            let (d, slope) = target.field.value_and_gradient(&Point2::new(rx + pose.x_m, ry + pose.y_m));
            let kernel_weight = c2 / (c2 + d * d);
            let bent = hit.weight * kernel_weight;
            let jacobian =
                Vector4::new(slope.x, slope.y, slope.y * rx - slope.x * ry, slope.x * rx + slope.y * ry);
            let weighted = jacobian * (bent * kernel_weight);
            normal.information += weighted * jacobian.transpose();
            normal.gradient += weighted * d;
            normal.cost += bent * d * d;
        }
        normal
    }

    fn step(&self, damping: f64) -> Option<Vector4<f64>> {
        let mut damped = self.information;
        for i in 0..4 {
            damped[(i, i)] += damping * damped[(i, i)] + 1e-9;
        }
        damped.cholesky().map(|c| -c.solve(&self.gradient))
    }
}

/// Steps of the profile on each side, and their width in the logarithm of the scale.
const PROFILE_STEPS: i32 = 20;
const PROFILE_STEP: f64 = 0.0025;

/// Returns the distribution of the logarithm of a factor of the hits by its profile likelihood: at each factor the
/// pose is the best one near `pose`.
///
/// The mean of the profile is steadier than its minimum, because all factors within the thickness of the map's
/// walls fit alike.
pub fn spread_of_scale(pose: &Pose2, hits: &[Hit], target: &Target) -> LogScale {
    let kernel_m = KERNEL_M[KERNEL_M.len() - 1];
    let hits: Vec<Weighted> = hits.iter().map(Weighted::from).collect();
    let variance_m2 = variance_m2(pose, &hits, target, kernel_m);
    let params = DescentParams { kernel_m, steps: STEPS, still_m: 4e-4, still_rad: 1e-4 };
    let mut profile = Vec::new();
    for side in [-1, 1] {
        let mut pose = *pose;
        for step in i32::from(side > 0)..=PROFILE_STEPS {
            let log = f64::from(side * step) * PROFILE_STEP;
            let scaled = scaled(&hits, log.exp());
            pose = descend(pose, &scaled, target, &params);
            profile.push((log, cost(&pose, &scaled, target, kernel_m)));
        }
    }
    let least = profile.iter().map(|(_, cost)| *cost).fold(f64::INFINITY, f64::min);
    let weight = |cost: f64| (-(cost - least) / (2.0 * variance_m2)).exp();
    let sum =
        |of: &dyn Fn(f64) -> f64| profile.iter().map(|(log, cost)| of(*log) * weight(*cost)).sum::<f64>();
    let total = sum(&|_| 1.0);
    let mean = sum(&|log| log) / total;
    let variance = sum(&|log| (log - mean).powi(2)) / total;
    LogScale { mean, std: variance.sqrt(), radius_m: radius_m(&hits) }
}

fn scaled(hits: &[Weighted], factor: f64) -> Vec<Weighted> {
    let scaled = |hit: &Weighted| Weighted { x_m: hit.x_m * factor, y_m: hit.y_m * factor, ..*hit };
    hits.iter().map(scaled).collect()
}

/// Returns the root mean squared distance of the hits from their middle.
fn radius_m(hits: &[Weighted]) -> f64 {
    let weight = hits.iter().map(|hit| hit.weight).sum::<f64>().max(f64::MIN_POSITIVE);
    let mean = |of: fn(&Weighted) -> f64| hits.iter().map(|hit| hit.weight * of(hit)).sum::<f64>() / weight;
    let (x_m, y_m) = (mean(|hit| hit.x_m), mean(|hit| hit.y_m));
    let squared = mean(|hit| hit.x_m * hit.x_m + hit.y_m * hit.y_m) - x_m * x_m - y_m * y_m;
    squared.max(0.01).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::l_shaped_room;
    use viola_geometry::Vector2;

    #[test]
    fn finds_pose_and_scale_of_a_room() {
        let target = Target::from_points(l_shaped_room(), None, None).unwrap();
        let truth = Pose2::new(1.2, 1.7, 0.6);
        for factor in [0.97, 0.99, 1.0, 1.015, 1.03] {
            let in_clip = |p: &Point2| truth.inverse().apply(p) / factor;
            let hits: Vec<Hit> =
                l_shaped_room().iter().map(|p| Hit::standing(in_clip(p), Vector2::x())).collect();
            let start = Pose2::new(1.23, 1.66, 0.61);
            let found = refine_with_scale(&[start], &hits, &target, 0.05)[0];
            assert!((found.factor / factor - 1.0).abs() < 0.003, "{factor} {found:?}");
            assert!(found.map_from_clip.distance_m(&truth) < 0.01, "{factor} {found:?}");
            let spread = spread_of_scale(&truth, &hits, &target);
            assert!((spread.mean - factor.ln()).abs() < 0.005, "{factor} {spread:?}");
            assert!(spread.std < 0.02 && spread.radius_m > 1.0, "{factor} {spread:?}");
        }
    }
}
