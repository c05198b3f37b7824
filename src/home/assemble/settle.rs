//! The poses of clips that overlap, refined together.
//!
//! A clip's pose is the solution, for that clip, of the pose graph of itself and the clips that it overlaps: every clip
//! is held to the map by its own alignment and to its neighbours by their overlaps. Nothing further away takes part. So
//! a pose depends on the set of the neighbours alone, and a new clip moves those that it overlaps and no others.

use super::overlap::Overlap;
use crate::geometry::{Pose2, Vector2, wrap_angle};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// How poses are held.
#[derive(Debug, Clone, PartialEq)]
pub struct SettleParams {
    /// Added to what an alignment says of itself: the map's own errors, which its hits share.
    pub map_m: f64,
    pub map_rad: f64,
    pub steps: usize,
    /// Terms that disagree by more than this many standard deviations fade out.
    pub fade: f64,
    /// A clip's neighbours that take part at most, those first that share most with it.
    pub max_neighbours: usize,
}

impl Default for SettleParams {
    fn default() -> Self {
        SettleParams { map_m: 0.015, map_rad: 0.3f64.to_radians(), steps: 8, fade: 3.0, max_neighbours: 24 }
    }
}

/// A clip in the graph.
#[derive(Debug, Clone)]
pub(super) struct Held {
    pub map_from_clip: Pose2,
    /// Of (x_m, y_m, yaw_rad); none when a person has put it there and it stays.
    pub covariance: Option<Matrix3<f64>>,
}

/// An overlap between two clips of the graph, by their places in it.
#[derive(Debug, Clone)]
pub(super) struct Tie<'a> {
    pub a: usize,
    pub b: usize,
    pub overlap: &'a Overlap,
}

/// The refined pose of the first clip.
pub(super) fn settle(clips: &[Held], ties: &[Tie], params: &SettleParams) -> Option<Pose2> {
    let first = clips.first()?;
    if first.covariance.is_none() || ties.is_empty() {
        return Some(first.map_from_clip);
    }
    let mut poses: Vec<Pose2> = clips.iter().map(|clip| clip.map_from_clip).collect();
    for _ in 0..params.steps {
        let mut graph = Graph::new(poses.len());
        for (i, clip) in clips.iter().enumerate() {
            graph.hold(i, &poses[i], clip, params);
        }
        for tie in ties {
            graph.tie(tie, &poses, params);
        }
        let step = graph.solve()?;
        for (i, pose) in poses.iter_mut().enumerate() {
            let by = step.fixed_rows::<3>(3 * i);
            *pose = Pose2::new(pose.x_m + by[0], pose.y_m + by[1], pose.yaw_rad + by[2]);
        }
        if step.amax() < 1e-7 {
            break;
        }
    }
    poses.first().copied().filter(Pose2::is_finite)
}

struct Graph {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Graph {
    fn new(clips: usize) -> Graph {
        Graph { information: DMatrix::zeros(3 * clips, 3 * clips), gradient: DVector::zeros(3 * clips) }
    }

    /// A clip is where its alignment has it.
    fn hold(&mut self, i: usize, pose: &Pose2, clip: &Held, params: &SettleParams) {
        let at = &clip.map_from_clip;
        let error = Vector3::new(pose.x_m - at.x_m, pose.y_m - at.y_m, wrap_angle(pose.yaw_rad - at.yaw_rad));
        let information = match &clip.covariance {
            None => Matrix3::identity() * 1e12,
            Some(covariance) => {
                let map = Vector3::new(params.map_m, params.map_m, params.map_rad).map(|s| s * s);
                let sum = covariance + Matrix3::from_diagonal(&map);
                sum.try_inverse().unwrap_or_else(Matrix3::identity)
            }
        };
        self.add(&[(i, Matrix3::identity())], &error, &information);
    }

    /// Two clips lie to each other as their overlap has it.
    fn tie(&mut self, tie: &Tie, poses: &[Pose2], params: &SettleParams) {
        let (a, b) = (&poses[tie.a], &poses[tie.b]);
        let b_from_a = b.inverse().compose(a);
        let measured = &tie.overlap.b_from_a;
        let error = Vector3::new(
            b_from_a.x_m - measured.x_m,
            b_from_a.y_m - measured.y_m,
            wrap_angle(b_from_a.yaw_rad - measured.yaw_rad),
        );
        let information = Matrix3::from_fn(|r, c| tie.overlap.information[r][c]);
        let far = (error.transpose() * information * error)[0].max(0.0).sqrt() / params.fade;
        let share = 1.0 / (1.0 + far * far);
        let (sin, cos) = b.yaw_rad.sin_cos();
        let between = Vector2::new(a.x_m - b.x_m, a.y_m - b.y_m);
        let by_a = Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0);
        let by_b = Matrix3::new(
            -cos,
            -sin,
            -sin * between.x + cos * between.y,
            sin,
            -cos,
            -cos * between.x - sin * between.y,
            0.0,
            0.0,
            -1.0,
        );
        self.add(&[(tie.a, by_a), (tie.b, by_b)], &error, &(information * (share * share)));
    }

    fn add(&mut self, slopes: &[(usize, Matrix3<f64>)], error: &Vector3<f64>, information: &Matrix3<f64>) {
        for (i, slope) in slopes {
            let weighted = slope.transpose() * information;
            let mut part = self.gradient.fixed_rows_mut::<3>(3 * i);
            part += weighted * error;
            for (j, other) in slopes {
                let mut block = self.information.fixed_view_mut::<3, 3>(3 * i, 3 * j);
                block += weighted * other;
            }
        }
    }

    fn solve(self) -> Option<DVector<f64>> {
        Some(-self.information.cholesky()?.solve(&self.gradient))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sure(found: usize, b_from_a: Pose2, information: f64) -> Overlap {
        let row = |i: usize| [0, 1, 2].map(|j| if i == j { information } else { 0.0 });
        Overlap { b_from_a, information: [row(0), row(1), row(2)], found }
    }

    fn held(map_from_clip: Pose2, sigma: f64) -> Held {
        Held { map_from_clip, covariance: Some(Matrix3::identity() * sigma * sigma) }
    }

    /// Two clips that are held alike meet half way.
    #[test]
    fn two_clips_meet_half_way() {
        let clips = [held(Pose2::new(1.0, 2.0, 0.5), 0.05), held(Pose2::new(1.04, 2.0, 0.5), 0.05)];
        let overlap = sure(500, Pose2::IDENTITY, 1e8);
        let ties = [Tie { a: 0, b: 1, overlap: &overlap }];
        let pose = settle(&clips, &ties, &SettleParams { fade: 1e9, ..SettleParams::default() }).unwrap();
        assert!((pose.x_m - 1.02).abs() < 1e-4 && (pose.y_m - 2.0).abs() < 1e-4, "{pose:?}");
    }

    /// The slopes agree with what small moves do to the error.
    #[test]
    fn consistent_clips_stay() {
        let poses = [Pose2::new(1.0, 2.0, 0.5), Pose2::new(-0.5, 1.0, -2.0), Pose2::new(3.0, -1.0, 3.0)];
        let clips: Vec<Held> = poses.iter().map(|pose| held(*pose, 0.05)).collect();
        let between = |a: usize, b: usize| sure(300, poses[b].inverse().compose(&poses[a]), 1e5);
        let (ab, ac, bc) = (between(0, 1), between(0, 2), between(1, 2));
        let ties =
            [Tie { a: 0, b: 1, overlap: &ab }, Tie { a: 0, b: 2, overlap: &ac }, Tie { a: 1, b: 2, overlap: &bc }];
        let settled = settle(&clips, &ties, &SettleParams::default()).unwrap();
        assert!(settled.distance_m(&poses[0]) < 1e-9);
        // Moved away from it, strong ties to two clips that stay bring it back.
        let mut moved = clips.clone();
        moved[0].map_from_clip = poses[0].compose(&Pose2::new(0.05, -0.03, 0.02));
        moved[1].covariance = None;
        moved[2].covariance = None;
        let params = SettleParams { fade: 1e9, ..SettleParams::default() };
        let settled = settle(&moved, &ties, &params).unwrap();
        assert!(settled.distance_m(&poses[0]) < 2e-3, "{settled:?}");
    }

    #[test]
    fn what_a_person_chose_stays() {
        let clips =
            [Held { covariance: None, ..held(Pose2::new(1.0, 2.0, 0.5), 0.1) }, held(Pose2::new(2.0, 2.0, 0.5), 0.1)];
        let overlap = sure(500, Pose2::IDENTITY, 1e8);
        let ties = [Tie { a: 0, b: 1, overlap: &overlap }];
        assert_eq!(settle(&clips, &ties, &SettleParams::default()), Some(clips[0].map_from_clip));
    }
}
