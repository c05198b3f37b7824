//! The motion in the plane, with a change of height, that most matches of two clips agree with.
//!
//! Every two matches propose a motion: with a few hundred proposals no sampling is needed.

use super::matching::{Match, matches};
use crate::assemble::surface::cell;
use rustc_hash::FxHashSet;
use serde::{Deserialize, Serialize};
use viola_geometry::{Point2, Point3, Pose2, Vector2, angle_between, wrap_angle};
use viola_reconstruct::Feature;

/// Minimum distance of two matches that propose a motion, and the maximum difference of their distances in the
/// clips.
const APART_M: f64 = 0.3;
const STRETCH_M: f64 = 0.1;
/// Maximum distances of an inlier in the plane and in height.
const NEAR_M: f64 = 0.12;
const RISE_M: f64 = 0.1;
/// Maximum difference of a motion's rotation from that of a match: patches that face the camera turn with it.
const FACING_RAD: f64 = 50f64.to_radians();
/// Features of each clip that are compared first, the most reliable, and the places that they must agree in: most
/// pairs of clips show different places, and are dropped here.
const FIRST: usize = 150;
const MIN_FIRST_PLACES: usize = 5;
/// Minimum number of inliers at different places.
const MIN_PLACES: usize = 8;
/// Inliers in one cell of this side are one place.
const PLACE_M: f64 = 0.1;

/// Motion of clip `a` to clip `b` by their features, and its support.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    pub b_from_a: Pose2,
    /// Height of `a`'s floor above that of `b`.
    pub rise_m: f64,
    /// Places that both clips show, and their RMS distance from their middle.
    pub places: usize,
    pub spread_m: f64,
}

/// Returns the motion between two clips that show the same place; none if too few features agree.
pub(super) fn motion(a: &[Feature], b: &[Feature]) -> Option<Motion> {
    let first = |features: &[Feature]| features.len().min(FIRST);
    fitting(&matches(&a[..first(a)], &b[..first(b)]), MIN_FIRST_PLACES)?;
    fitting(&matches(a, b), MIN_PLACES)
}

/// Returns the motion with the most inliers; none if they are at fewer places than `least`.
fn fitting(matches: &[Match], least: usize) -> Option<Motion> {
    let mut best: Option<(usize, Pose2, f64)> = None;
    for (i, one) in matches.iter().enumerate() {
        for other in &matches[i + 1..] {
            let Some((pose, rise_m)) = proposed(one, other) else { continue };
            let count = inliers(matches, &pose, rise_m).count();
            if best.as_ref().is_none_or(|(most, ..)| count > *most) {
                best = Some((count, pose, rise_m));
            }
        }
    }
    let (_, mut pose, mut rise_m) = best?;
    for _ in 0..2 {
        (pose, rise_m) = fitted(&inliers(matches, &pose, rise_m).copied().collect::<Vec<Match>>())?;
    }
    let last: Vec<Match> = inliers(matches, &pose, rise_m).copied().collect();
    let places = distinct(last.iter().map(|one| &one.a)).min(distinct(last.iter().map(|one| &one.b)));
    let spread_m = spread_m(&last);
    (places >= least && spread_m > APART_M / 2.0).then_some(Motion {
        b_from_a: pose,
        rise_m,
        places,
        spread_m,
    })
}

/// Returns the motion that two matches propose; none if their distances or directions do not fit.
fn proposed(one: &Match, other: &Match) -> Option<(Pose2, f64)> {
    let (in_a, in_b) = (other.a - one.a, other.b - one.b);
    let (flat_a, flat_b) = (in_a.xy(), in_b.xy());
    let fits = flat_a.norm() > APART_M
        && (flat_a.norm() - flat_b.norm()).abs() < STRETCH_M
        && (in_a.z - in_b.z).abs() < RISE_M;
    if !fits {
        return None;
    }
    let yaw_rad = wrap_angle(flat_b.y.atan2(flat_b.x) - flat_a.y.atan2(flat_a.x));
    let faces = |one: &Match| angle_between(one.yaw_rad, yaw_rad) < FACING_RAD;
    if !faces(one) || !faces(other) {
        return None;
    }
    let (a, b) = (nalgebra::center(&one.a, &other.a), nalgebra::center(&one.b, &other.b));
    Some((with_yaw(yaw_rad, &a.xy(), &b.xy()), b.z - a.z))
}

/// Returns the motion with a rotation that takes one point to another.
fn with_yaw(yaw_rad: f64, a: &Point2, b: &Point2) -> Pose2 {
    let turned = Pose2::new(0.0, 0.0, yaw_rad).apply(a);
    Pose2::new(b.x - turned.x, b.y - turned.y, yaw_rad)
}

fn inliers<'a>(matches: &'a [Match], pose: &Pose2, rise_m: f64) -> impl Iterator<Item = &'a Match> {
    let pose = *pose;
    let (sin, cos) = pose.yaw_rad.sin_cos();
    matches.iter().filter(move |one| {
        let (x, y) = (cos * one.a.x - sin * one.a.y + pose.x_m, sin * one.a.x + cos * one.a.y + pose.y_m);
        (x - one.b.x).hypot(y - one.b.y) < NEAR_M
            && (one.b.z - one.a.z - rise_m).abs() < RISE_M
            && angle_between(one.yaw_rad, pose.yaw_rad) < FACING_RAD
    })
}

/// Returns the motion with the least squared distances.
fn fitted(matches: &[Match]) -> Option<(Pose2, f64)> {
    if matches.len() < 2 {
        return None;
    }
    let count = matches.len() as f64;
    let mean = |of: fn(&Match) -> Point3| -> Point3 {
        (matches.iter().map(|one| of(one).coords).sum::<nalgebra::Vector3<f64>>() / count).into()
    };
    let (a, b) = (mean(|one| one.a), mean(|one| one.b));
    let (mut dot, mut cross) = (0.0, 0.0);
    for one in matches {
        let (p, q): (Vector2, Vector2) = ((one.a - a).xy(), (one.b - b).xy());
        dot += p.dot(&q);
        cross += p.perp(&q);
    }
    Some((with_yaw(cross.atan2(dot), &a.xy(), &b.xy()), b.z - a.z))
}

fn distinct<'a>(points: impl Iterator<Item = &'a Point3>) -> usize {
    let cells: FxHashSet<[i32; 3]> = points.map(|point| cell(point, PLACE_M)).collect();
    cells.len()
}

fn spread_m(matches: &[Match]) -> f64 {
    let count = matches.len().max(1) as f64;
    let middle = matches.iter().map(|one| one.a.coords.xy()).sum::<Vector2>() / count;
    (matches.iter().map(|one| (one.a.coords.xy() - middle).norm_squared()).sum::<f64>() / count).sqrt()
}
