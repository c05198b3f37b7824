//! Ranks poses by how well they explain the clip (paper IV-A).

use super::evidence::{INLIER_M, PoseScorer};
use super::model::{LossWeights, MODEL};
use crate::Alternative;
use crate::refine::Refined;
use crate::scan::{Hit, VirtualScan};
use crate::target::Target;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use viola_geometry::{Point2, Pose2, cell_of, cells_around};

/// Parameters of the ranking; the experiments vary them.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreParams {
    pub weights: LossWeights,
    /// Cost of a hit without a counterpart in unknown cells of the map, as a fraction of the truncation.
    pub unknown_fraction: f64,
    /// Maximum number of explanations in an answer.
    pub alternatives: usize,
}

impl Default for ScoreParams {
    fn default() -> Self {
        ScoreParams { weights: MODEL.loss, unknown_fraction: 0.6, alternatives: 8 }
    }
}

/// Poses nearer than this to a better one are not listed again.
const SAME_M: f64 = 0.15;
const SAME_RAD: f64 = 5f64.to_radians();

/// An explanation with its covariance of (x_m, y_m, yaw_rad).
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked {
    /// Index of the floor hypothesis.
    pub hypothesis: usize,
    pub alternative: Alternative,
    pub covariance: nalgebra::Matrix3<f64>,
}

/// The refined poses above one floor, in the map of one level.
pub struct Candidates<'a> {
    /// Index of the floor hypothesis.
    pub hypothesis: usize,
    pub hits: &'a [Hit],
    pub scan: &'a VirtualScan,
    pub target: &'a Target,
    pub refined: &'a [Refined],
}

/// Returns the refined poses above all floors and on all levels by how well they explain the clip, the best
/// first, without duplicates. Losses are means over the hits, and use the same kinds of evidence in all maps, so they can
/// be compared.
pub fn rank(candidates: &[Candidates], params: &ScoreParams) -> Vec<Ranked> {
    let of = |one: &Candidates| -> Vec<Ranked> {
        let scorer = PoseScorer::new(one.hits, one.scan, params.unknown_fraction)
            .comparing(candidates.iter().map(|other| other.target));
        one.refined.par_iter().map(|pose| ranked(pose, one, &scorer, params)).collect()
    };
    let mut ranked: Vec<Ranked> = candidates.iter().flat_map(of).collect();
    ranked.sort_by(|a, b| a.alternative.loss_m.total_cmp(&b.alternative.loss_m));
    distinct(ranked, params.alternatives)
}

fn ranked(pose: &Refined, candidates: &Candidates, scorer: &PoseScorer, params: &ScoreParams) -> Ranked {
    let target = candidates.target;
    let evidence = scorer.evidence(&pose.map_from_clip, target);
    let alternative = Alternative {
        misplaced: target.rooms.as_ref().map(|_| evidence.misplaced),
        ..Alternative::of(target.level, pose.map_from_clip, &evidence, &params.weights)
    };
    Ranked { hypothesis: candidates.hypothesis, alternative, covariance: pose.covariance }
}

fn is_same(a: &Alternative, b: &Alternative) -> bool {
    a.level == b.level && a.map_from_clip.is_within(&b.map_from_clip, SAME_M, SAME_RAD)
}

fn distinct(sorted: Vec<Ranked>, most: usize) -> Vec<Ranked> {
    let mut kept: Vec<Ranked> = Vec::new();
    for ranked in sorted {
        let known = kept.iter().any(|k| is_same(&k.alternative, &ranked.alternative));
        if !known {
            kept.push(ranked);
            if kept.len() == most {
                break;
            }
        }
    }
    kept
}

/// Returns the fraction of the map's points with a hit beside them: the paper's coverage, at this pose.
pub fn coverage(map_from_clip: &Pose2, hits: &[Hit], target: &Target) -> f64 {
    let mut placed: FxHashMap<[i32; 2], Vec<Point2>> = FxHashMap::default();
    for hit in hits {
        let point = map_from_clip.apply(&hit.point_m);
        placed.entry(cell_of(&point, INLIER_M)).or_default().push(point);
    }
    let covered = |point: &Point2| {
        cells_around(cell_of(point, INLIER_M)).any(|key| {
            placed.get(&key).is_some_and(|near| near.iter().any(|p| (p - point).norm() < INLIER_M))
        })
    };
    let count = target.points_m.iter().filter(|p| covered(p)).count();
    count as f64 / target.points_m.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use viola_formats::lidar::Cell;
    use viola_geometry::{Grid, GridFrame, Vector2};

    /// The map of one wall on two levels, as cells and as bare points.
    #[test]
    fn a_map_of_cells_and_one_of_bare_points_are_compared_by_the_same_evidence() {
        let frame = GridFrame::covering([0.0, 0.0], [4.0, 4.0], 0.0, 0.05);
        let wall: Vec<Point2> = (0..frame.height).map(|y| frame.centre(40, y)).collect();
        let mut cells = Grid::filled(frame, Cell::Free);
        (0..frame.height).for_each(|y| cells.set(40, y, Cell::Occupied));
        let level = |name: &str, cells: Option<Grid<Cell>>| {
            let mut target = Target::from_points(wall.clone(), Some(0.05), cells).unwrap();
            target.level = name.parse().unwrap();
            target
        };
        let (cells, bare) = (level("main", Some(cells)), level("upper", None));
        // A third of the hits lies on free floor.
        let hit = |i: i32| {
            let x_m = if i % 3 == 0 { 1.0 } else { wall[0].x };
            Hit::standing(Point2::new(x_m, 0.05 * f64::from(i)), Vector2::new(-1.0, 0.0))
        };
        let hits: Vec<Hit> = (0..60).map(hit).collect();
        let scan = VirtualScan::default();
        let refined = [Refined { map_from_clip: Pose2::IDENTITY, covariance: Matrix3::identity() }];
        let losses = |targets: &[&Target]| -> Vec<f64> {
            let candidates: Vec<Candidates> = targets
                .iter()
                .map(|&target| Candidates {
                    hypothesis: 0,
                    hits: &hits,
                    scan: &scan,
                    target,
                    refined: &refined,
                })
                .collect();
            let ranked = rank(&candidates, &ScoreParams::default());
            ranked.iter().map(|ranked| ranked.alternative.loss_m).collect()
        };
        let of_bare = losses(&[&bare])[0];
        assert_eq!(losses(&[&cells, &bare]), [of_bare; 2]);
        assert!(losses(&[&cells])[0] > of_bare + 0.02, "cells contradict hits on free floor");
    }
}
