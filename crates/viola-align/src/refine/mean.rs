//! The pose of the answer: the mean of the poses around a minimum, weighted by their likelihood.
//!
//! Within the thickness of a map's walls, and between narrow minima, the best pose jumps by centimetres if
//! the clip changes by millimetres. The mean moves as little as the clip, and has the least squared error.

use super::{Refined, Weighted, cost, variance_m2};
use crate::refine::KERNEL_M;
use crate::scan::Hit;
use crate::target::Target;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};
use viola_geometry::{Point2, Pose2, Vector2};

/// Each round draws from the distribution fitted by the previous one (population Monte Carlo; Cappe et al.,
/// 2004).
const ROUNDS: usize = 3;
const PAIRS: u32 = 48;
/// Standard deviations of the prior around the minimum, and in later rounds around the mean of the round before: a pose
/// further away belongs to another minimum, or the clip is unconstrained.
const AROUND_M: f64 = 0.05;
const AROUND_RAD: f64 = 1.5 * PI / 180.0;
/// Factor of the draws' variances over the fitted ones, and a constant added to them.
const WIDER: f64 = 2.0;
const MIN_VARIANCES: [f64; 3] = [1e-6, 1e-6, 1e-7];

/// The mean of the poses around a minimum, and their spread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    pub map_from_clip: Pose2,
    pub spread: Spread,
}

/// Uncertainty of a pose by the likelihood of its hits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Weighted mean of the hits. Position and heading are nearly independent there.
    pub middle_in_clip: Point2,
    /// Covariance of (x_m, y_m, yaw_rad) of the middle, without calibration.
    pub covariance: Matrix3<f64>,
}

impl Spread {
    /// Returns a covariance of the middle as that of the clip's origin at this pose.
    pub fn at_origin(&self, of_middle: &Matrix3<f64>, map_from_clip: &Pose2) -> Matrix3<f64> {
        let arm = map_from_clip.rotate(&self.middle_in_clip.coords);
        let moved = Matrix3::new(1.0, 0.0, arm.y, 0.0, 1.0, -arm.x, 0.0, 0.0, 1.0);
        moved * of_middle * moved.transpose()
    }
}

/// Returns the mean of the poses around a refined one.
pub fn mean(refined: &Refined, hits: &[Hit], target: &Target) -> Mean {
    let kernel_m = KERNEL_M[KERNEL_M.len() - 1];
    let hits: Vec<Weighted> = hits.iter().map(Weighted::from).collect();
    let around = Around::new(refined.map_from_clip, &hits);
    let variance_m2 = variance_m2(&refined.map_from_clip, &hits, target, kernel_m);
    let near = Vector3::new(AROUND_M, AROUND_M, AROUND_RAD).map(|sigma| 1.0 / (sigma * sigma));
    let log_likelihood =
        |offset: &Vector3<f64>| -cost(&around.pose(offset), &hits, target, kernel_m) / (2.0 * variance_m2);
    let known = around.of_middle(&refined.covariance).try_inverse().unwrap_or_else(Matrix3::zeros);
    let mut spread = (known + Matrix3::from_diagonal(&near)).try_inverse().unwrap_or_else(Matrix3::zeros);
    let mut centre = Vector3::zeros();
    let draws = draws();
    for _ in 0..ROUNDS {
        let Some(root) = (spread * WIDER + Matrix3::from_diagonal(&MIN_VARIANCES.into())).cholesky() else {
            break;
        };
        let offsets: Vec<Vector3<f64>> = draws.iter().map(|draw| centre + root.l() * draw).collect();
        let logs: Vec<f64> = draws
            .iter()
            .zip(&offsets)
            .map(|(draw, offset)| {
                let off = offset - centre;
                log_likelihood(offset) - 0.5 * off.component_mul(&off).dot(&near) + 0.5 * draw.norm_squared()
            })
            .collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs.iter().map(|log| (log - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let weighed = || offsets.iter().zip(weights.iter().map(|weight| weight / sum));
        centre = weighed().map(|(offset, weight)| offset * weight).sum();
        let middle = centre;
        let off = |offset: &Vector3<f64>| (offset - middle) * (offset - middle).transpose();
        spread = weighed().map(|(offset, weight)| off(offset) * weight).sum();
    }
    let spread = Spread { middle_in_clip: around.middle_in_clip, covariance: without_prior(&spread, &near) };
    Mean { map_from_clip: around.pose(&centre), spread }
}

/// Removes the prior's information from a covariance. A direction that the hits do not constrain gets 20 times the
/// prior's deviation: 1 m, or 30 degrees.
fn without_prior(spread: &Matrix3<f64>, prior: &Vector3<f64>) -> Matrix3<f64> {
    const MIN_INFORMATION: f64 = 1.0;
    let scale = prior.map(f64::sqrt);
    // In units of the prior's deviations, so that metres and radians can be compared.
    let unit = |m: &Matrix3<f64>| m.component_mul(&(scale * scale.transpose()));
    let information = (unit(spread) + Matrix3::from_diagonal(&MIN_VARIANCES.into())).try_inverse();
    let information = information.unwrap_or_else(Matrix3::identity) - Matrix3::identity();
    let mut eigen = ((information + information.transpose()) * 0.5).symmetric_eigen();
    let least = MIN_INFORMATION / prior.x;
    eigen.eigenvalues.apply(|value| *value = 1.0 / value.max(least));
    eigen.recompose().component_div(&(scale * scale.transpose()))
}

/// Poses as offsets from one of them, rotated about the middle of the hits: about the clip's origin, rotation
/// and translation would compensate each other.
struct Around {
    mode: Pose2,
    middle_in_clip: Point2,
    middle_in_map: Point2,
}

impl Around {
    fn new(mode: Pose2, hits: &[Weighted]) -> Around {
        let sum: Vector3<f64> = hits.iter().map(|hit| Vector3::new(hit.x_m, hit.y_m, 1.0) * hit.weight).sum();
        let middle_in_clip = Point2::from(sum.xy() / sum.z.max(f64::MIN_POSITIVE));
        Around { mode, middle_in_clip, middle_in_map: mode.apply(&middle_in_clip) }
    }

    /// Returns the pose at an offset of (x_m, y_m, yaw_rad).
    fn pose(&self, offset: &Vector3<f64>) -> Pose2 {
        let turned = Pose2::new(0.0, 0.0, self.mode.yaw_rad + offset.z);
        let at: Vector2 = self.middle_in_map.coords + offset.xy() - turned.apply(&self.middle_in_clip).coords;
        Pose2::new(at.x, at.y, turned.yaw_rad)
    }

    /// Returns the covariance of a pose as that of offsets.
    fn of_middle(&self, covariance: &Matrix3<f64>) -> Matrix3<f64> {
        let arm = self.middle_in_map.coords - Vector2::new(self.mode.x_m, self.mode.y_m);
        let moved = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
        moved * covariance * moved.transpose()
    }
}

/// Returns evenly spread draws of a standard normal, in pairs around zero: the sequence of Halton (1960)
/// through the transform of Box and Muller (1958).
fn draws() -> Vec<Vector3<f64>> {
    let normal = |index: u32, bases: [u32; 2]| {
        let [u, v] = bases.map(|base| radical_inverse(index, base));
        let (sin, cos) = (TAU * v).sin_cos();
        [cos, sin].map(|axis| (-2.0 * u.ln()).sqrt() * axis)
    };
    let draw = |index| {
        let ([x, y], [z, _]) = (normal(index, [2, 3]), normal(index, [5, 7]));
        Vector3::new(x, y, z)
    };
    (1..=PAIRS).map(draw).flat_map(|draw| [draw, -draw]).collect()
}

/// Returns the digits of a number behind the point, the last one first; in (0, 1) for numbers from 1 on.
fn radical_inverse(mut number: u32, base: u32) -> f64 {
    let (mut value, mut place) = (0.0, 1.0);
    while number > 0 {
        place /= f64::from(base);
        value += place * f64::from(number % base);
        number /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::super::refine;
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Returns the walls of a room of 4 by 3 metres, three cells of 5 cm thick.
    fn room() -> Target {
        let mut points = Vec::new();
        for depth in -1..=1 {
            let out = 0.05 * f64::from(depth);
            for i in 0..=80 {
                let along = 0.05 * f64::from(i);
                points.extend([Point2::new(along, -out), Point2::new(along, 3.0 + out)]);
                if along <= 3.0 {
                    points.extend([Point2::new(-out, along), Point2::new(4.0 + out, along)]);
                }
            }
        }
        Target::from_points(points, Some(0.05), None).unwrap()
    }

    /// Returns hits on the room's walls, up to 2 cm off at random, seen from a pose in it.
    fn hits(map_from_clip: &Pose2) -> Vec<Hit> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut off = || 0.04 * (rng.random::<f64>() - 0.5);
        let clip_from_map = map_from_clip.inverse();
        let walls = (0..100).flat_map(|i| {
            let t = f64::from(i) / 99.0;
            [(4.0 * t, 0.0), (4.0 * t, 3.0), (0.0, 3.0 * t), (4.0, 3.0 * t)]
        });
        walls
            .map(|(x, y)| Point2::new(x + off(), y + off()))
            .map(|at| Hit::standing(clip_from_map.apply(&at), Vector2::x()))
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// A descent ends somewhere in the thickness of the walls; the mean is their middle from anywhere.
        #[test]
        fn lies_in_the_middle_of_thick_walls_wherever_a_descent_ended(
            x in 1.0..3.0f64, y in 1.0..2.0f64, yaw in -3.1..3.1f64,
            dx in -0.06..0.06f64, dy in -0.06..0.06f64, turn in -0.02..0.02f64,
        ) {
            let truth = Pose2::new(x, y, yaw);
            let (hits, target) = (hits(&truth), room());
            let start = Pose2::new(x + dx, y + dy, yaw + turn);
            let refined = refine(&[start], &hits, &target)[0];
            let found = mean(&refined, &hits, &target).map_from_clip;
            let turned = found.inverse().compose(&truth).yaw_rad.abs();
            // Poses up to 3 cm off fit as well: distances are zero within 5 cm of a wall's middle.
            prop_assert!(found.distance_m(&truth) < 0.015, "{refined:?} {found:?} {truth:?}");
            prop_assert!(turned < 0.3f64.to_radians(), "{refined:?} {found:?} {truth:?}");
        }

        /// The likelihood alone remains of a product of two normal distributions.
        #[test]
        fn the_prior_is_taken_out(a in 0.5..3.0f64, b in 0.5..3.0f64, c in 0.5..3.0f64, turn in -0.5..0.5f64) {
            let prior = Vector3::new(400.0, 400.0, 1500.0);
            let root = Matrix3::new(a, turn, 0.0, 0.0, b, turn, 0.0, 0.0, c) * 100.0;
            let likelihood = root * root.transpose();
            let spread = (likelihood + Matrix3::from_diagonal(&prior)).try_inverse().unwrap();
            let want = likelihood.try_inverse().unwrap();
            let got = without_prior(&spread, &prior);
            prop_assert!((got - want).norm() < 0.05 * want.norm() + 2e-6, "{got} {want}");
        }

        /// Offsets and the covariance about the middle agree with the pose.
        #[test]
        fn turns_about_the_middle_of_the_hits(
            yaw in -3.1..3.1f64, x in -0.1..0.1f64, y in -0.1..0.1f64, turn in -0.1..0.1f64,
        ) {
            let mode = Pose2::new(2.0, -1.0, yaw);
            let hits = [[3.0, 1.0], [4.0, -2.0]].map(|[x_m, y_m]| Weighted { x_m, y_m, weight: 0.5 });
            let around = Around::new(mode, &hits);
            let moved = around.pose(&Vector3::new(x, y, turn));
            let middle = Point2::new(3.5, -0.5);
            let at = moved.apply(&middle) - mode.apply(&middle);
            prop_assert!((at - Vector2::new(x, y)).norm() < 1e-12);
            prop_assert!((moved.inverse().compose(&mode).yaw_rad + turn).abs() < 1e-9);
            // Only a rotation about the middle is uncertain.
            let arm = mode.apply(&middle).coords - Vector2::new(2.0, -1.0);
            let turning = Vector3::new(arm.y, -arm.x, 1.0);
            let of_middle = around.of_middle(&(turning * turning.transpose()));
            prop_assert!((of_middle - Matrix3::from_diagonal(&Vector3::z())).norm() < 1e-9, "{of_middle}");
            let spread = Spread { middle_in_clip: around.middle_in_clip, covariance: of_middle };
            let back = spread.at_origin(&of_middle, &mode);
            prop_assert!((back - turning * turning.transpose()).norm() < 1e-9, "{back}");
        }
    }
}
