//! How well each pose explains the clip (paper IV-A).

use super::evidence::{EvidenceParams, Witness};
use super::raycast::{Hit, VirtualScan};
use super::refine::Refined;
use super::target::Target;
use super::{Alternative, FreeSpace};
use crate::geometry::{Point2, Pose2, angle_between};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// How poses are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct DecideParams {
    pub evidence: EvidenceParams,
    /// What a scan whose rays are all blocked adds to the loss, and likewise below. The weights are near those of
    /// a conditional logit on the refined modes of simulated clips (seeds 0-129; `evaluate/weights`): that the true one is
    /// the best of them.
    pub blocked_m: f64,
    pub hits_on_floor_m: f64,
    pub unseen_sides_m: f64,
    pub walls_on_floor_m: f64,
    pub misplaced_m: f64,
    /// More than this share misplaced costs no more: rooms may have other names than they deserve, and networks err.
    pub most_misplaced: f64,
    /// Poses nearer than this to a better one are not listed again.
    pub same_m: f64,
    pub same_rad: f64,
    pub alternatives: usize,
    /// Share of hits that must have a counterpart.
    pub min_inliers: f64,
    /// Probability from which a clip is called aligned.
    pub sure: f64,
}

impl Default for DecideParams {
    fn default() -> Self {
        DecideParams {
            evidence: EvidenceParams::default(),
            blocked_m: 0.025,
            hits_on_floor_m: 0.06,
            unseen_sides_m: 0.02,
            walls_on_floor_m: 0.17,
            misplaced_m: 0.2,
            most_misplaced: 0.15,
            same_m: 0.15,
            same_rad: 5f64.to_radians(),
            alternatives: 8,
            min_inliers: 0.3,
            sure: 0.9,
        }
    }
}

/// An explanation with its covariance of (x_m, y_m, yaw_rad).
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked {
    pub alternative: Alternative,
    pub covariance: nalgebra::Matrix3<f64>,
}

/// The refined poses by how well they explain the clip, the best first, no two of them the same.
pub fn rank(
    refined: &[Refined],
    hits: &[Hit],
    scan: &VirtualScan,
    target: &Target,
    params: &DecideParams,
) -> Vec<Ranked> {
    let witness = Witness::new(hits, scan, &params.evidence);
    let mut ranked: Vec<Ranked> =
        refined.par_iter().map(|pose| judge(pose, &witness, target, params)).collect();
    ranked.sort_by(|a, b| a.alternative.loss_m.total_cmp(&b.alternative.loss_m));
    distinct(ranked, params)
}

fn judge(pose: &Refined, witness: &Witness, target: &Target, params: &DecideParams) -> Ranked {
    let evidence = witness.examine(&pose.map_from_clip, target);
    let loss_m = evidence.distance_m
        + params.blocked_m * evidence.blocked_rays
        + params.hits_on_floor_m * evidence.hits_on_floor
        + params.unseen_sides_m * evidence.unseen_sides
        + params.walls_on_floor_m * evidence.walls_on_floor
        + params.misplaced_m * evidence.misplaced.min(params.most_misplaced);
    let alternative = Alternative {
        map_from_clip: pose.map_from_clip,
        loss_m,
        inliers: evidence.inliers,
        free_space: Some(FreeSpace {
            blocked_rays: evidence.blocked_rays,
            hits_on_floor: evidence.hits_on_floor,
            unseen_sides: evidence.unseen_sides,
            walls_on_floor: evidence.walls_on_floor,
        }),
        misplaced: target.rooms.as_ref().map(|_| evidence.misplaced),
        probability: None,
    };
    Ranked { alternative, covariance: pose.covariance }
}

fn is_close(a: &Pose2, b: &Pose2, distance_m: f64, angle_rad: f64) -> bool {
    a.distance_m(b) < distance_m && angle_between(a.yaw_rad, b.yaw_rad) < angle_rad
}

fn distinct(sorted: Vec<Ranked>, params: &DecideParams) -> Vec<Ranked> {
    let mut kept: Vec<Ranked> = Vec::new();
    for ranked in sorted {
        let pose = &ranked.alternative.map_from_clip;
        let known =
            kept.iter().any(|k| is_close(&k.alternative.map_from_clip, pose, params.same_m, params.same_rad));
        if !known {
            kept.push(ranked);
            if kept.len() == params.alternatives {
                break;
            }
        }
    }
    kept
}

/// The share of the map's points with a hit beside them (the paper's coverage, at the estimated pose).
pub fn coverage(map_from_clip: &Pose2, hits: &[Hit], target: &Target, near_m: f64) -> f64 {
    let cell = |p: &Point2| [p.x, p.y].map(|c| (c / near_m).floor() as i32);
    let mut placed: FxHashMap<[i32; 2], Vec<Point2>> = FxHashMap::default();
    for hit in hits {
        let point = map_from_clip.apply(&hit.point_m);
        placed.entry(cell(&point)).or_default().push(point);
    }
    let covered = |point: &Point2| {
        let [x, y] = cell(point);
        (-1..=1)
            .flat_map(|dy| (-1..=1).map(move |dx| [x + dx, y + dy]))
            .any(|key| placed.get(&key).is_some_and(|near| near.iter().any(|p| (p - point).norm() < near_m)))
    };
    let count = target.points_m.iter().filter(|p| covered(p)).count();
    count as f64 / target.points_m.len().max(1) as f64
}
