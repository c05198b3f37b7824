//! Joint refinement of the poses of overlapping clips.
//!
//! A clip's pose is solved in the pose graph of the clip and the clips that it overlaps. Each clip has a
//! prior from its own alignment and floor; each overlap is an edge. Clips further away are excluded, so a
//! pose depends only on its neighbours, and a new clip moves only the clips that it overlaps.

use super::overlap::{Overlap, moved};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Vector6};
use viola_geometry::{Pose3, Vector3};

/// Added to an alignment's standard deviations: errors of the map, common to all hits.
const MAP_M: f64 = 0.015;
const MAP_RAD: f64 = 0.3f64.to_radians();
/// Standard deviations of a clip's floor height and tilt.
const FLOOR_M: f64 = 0.02;
const FLOOR_RAD: f64 = 0.6f64.to_radians();
const STEPS: usize = 8;
/// Scale of the edges' robust kernel, in standard deviations.
pub(super) const FADE: f64 = 3.0;

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

/// Returns the first clip's refined pose. `fade`: scale of the edges' robust kernel, in standard deviations.
pub(super) fn settle(clips: &[Prior], edges: &[Edge], fade: f64) -> Option<Pose3> {
    let first = clips.first()?;
    if edges.is_empty() {
        return Some(first.map_from_clip);
    }
    let mut poses: Vec<Pose3> = clips.iter().map(|clip| clip.map_from_clip).collect();
    for _ in 0..STEPS {
        let mut graph = Graph::new(poses.len());
        for (i, clip) in clips.iter().enumerate() {
            graph.hold(i, &poses[i], clip);
        }
        for edge in edges {
            graph.edge(edge, &poses, fade);
        }
        let step = graph.solve()?;
        for (i, pose) in poses.iter_mut().enumerate() {
            *pose = moved(pose, &step.fixed_rows::<6>(6 * i).into_owned());
        }
        if step.amax() < 1e-7 {
            break;
        }
    }
    poses.first().copied().filter(|pose| pose.translation.vector.iter().all(|c| c.is_finite()))
}

struct Graph {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// Returns the error of `pose` against `at`: translation, then rotation vector, in their common frame.
fn error(pose: &Pose3, at: &Pose3) -> Vector6<f64> {
    let shift = pose.translation.vector - at.translation.vector;
    let turn = (pose.rotation * at.rotation.inverse()).scaled_axis();
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

impl Graph {
    fn new(clips: usize) -> Graph {
        Graph { information: DMatrix::zeros(6 * clips, 6 * clips), gradient: DVector::zeros(6 * clips) }
    }

    /// Adds a clip's prior: its own alignment and floor.
    fn hold(&mut self, i: usize, pose: &Pose3, clip: &Prior) {
        let plane = match &clip.covariance {
            None => Matrix3::identity() * 1e12,
            Some(covariance) => {
                let map = Vector3::new(MAP_M, MAP_M, MAP_RAD).map(|s| s * s);
                let sum = covariance + Matrix3::from_diagonal(&map);
                sum.try_inverse().unwrap_or_else(Matrix3::identity)
            }
        };
        let mut information = Matrix6::zeros();
        // x, y and yaw.
        let places = [0, 1, 5];
        for (r, &row) in places.iter().enumerate() {
            for (c, &column) in places.iter().enumerate() {
                information[(row, column)] = plane[(r, c)];
            }
        }
        information[(2, 2)] = FLOOR_M.powi(-2);
        information[(3, 3)] = FLOOR_RAD.powi(-2);
        information[(4, 4)] = FLOOR_RAD.powi(-2);
        self.add(&[(i, Matrix6::identity())], &error(pose, &clip.map_from_clip), &information);
    }

    /// Adds the edge of an overlap.
    fn edge(&mut self, edge: &Edge, poses: &[Pose3], fade: f64) {
        let (a, b) = (&poses[edge.a], &poses[edge.b]);
        let error = error(&(b.inverse() * a), &edge.overlap.b_from_a);
        let information = Matrix6::from_fn(|r, c| edge.overlap.information[r][c]);
        let far = (error.transpose() * information * error)[0].max(0.0).sqrt() / fade;
        let share = 1.0 / (1.0 + far * far);
        let b_from_map = b.rotation.inverse().to_rotation_matrix().into_inner();
        let between = (a.translation.vector - b.translation.vector).cross_matrix();
        let mut by_a = Matrix6::zeros();
        by_a.fixed_view_mut::<3, 3>(0, 0).copy_from(&b_from_map);
        by_a.fixed_view_mut::<3, 3>(3, 3).copy_from(&b_from_map);
        let mut by_b = -by_a;
        by_b.fixed_view_mut::<3, 3>(0, 3).copy_from(&(b_from_map * between));
        self.add(&[(edge.a, by_a), (edge.b, by_b)], &error, &(information * (share * share)));
    }

    fn add(&mut self, slopes: &[(usize, Matrix6<f64>)], error: &Vector6<f64>, information: &Matrix6<f64>) {
        for (i, slope) in slopes {
            let weighted = slope.transpose() * information;
            let mut part = self.gradient.fixed_rows_mut::<6>(6 * i);
            part += weighted * error;
            for (j, other) in slopes {
                let mut block = self.information.fixed_view_mut::<6, 6>(6 * i, 6 * j);
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

    fn sure(b_from_a: Pose3, information: f64) -> Overlap {
        let row = |i: usize| std::array::from_fn(|j| if i == j { information } else { 0.0 });
        Overlap { b_from_a, information: std::array::from_fn(row), found: 500 }
    }

    fn prior(map_from_clip: Pose3, sigma: f64) -> Prior {
        Prior { map_from_clip, covariance: Some(Matrix3::identity() * sigma * sigma) }
    }

    fn pose(x: f64, y: f64, yaw: f64) -> Pose3 {
        Pose3::new(Vector3::new(x, y, 0.0), Vector3::new(0.0, 0.0, yaw))
    }

    fn distance_m(a: &Pose3, b: &Pose3) -> f64 {
        (a.translation.vector - b.translation.vector).norm()
    }

    /// Two clips with equal priors meet half way.
    #[test]
    fn two_clips_meet_half_way() {
        let mut second = pose(1.04, 2.0, 0.5);
        second.translation.z = 0.02;
        let clips = [prior(pose(1.0, 2.0, 0.5), 0.05), prior(second, 0.05)];
        let overlap = sure(Pose3::identity(), 1e8);
        let edges = [Edge { a: 0, b: 1, overlap: &overlap }];
        let settled = settle(&clips, &edges, 1e9).unwrap();
        let half = Pose3::from_parts(Vector3::new(1.02, 2.0, 0.01).into(), clips[0].map_from_clip.rotation);
        assert!(distance_m(&settled, &half) < 1e-4, "{settled:?}");
    }

    /// The Jacobians match the error's change under small motions.
    #[test]
    fn consistent_clips_stay() {
        let tilted = Pose3::new(Vector3::new(3.0, -1.0, 0.02), Vector3::new(0.01, -0.02, 3.0));
        let poses = [pose(1.0, 2.0, 0.5), pose(-0.5, 1.0, -2.0), tilted];
        let clips: Vec<Prior> = poses.iter().map(|pose| prior(*pose, 0.05)).collect();
        let between = |a: usize, b: usize| sure(poses[b].inverse() * poses[a], 1e5);
        let (ab, ac, bc) = (between(0, 1), between(0, 2), between(1, 2));
        let edges = [
            Edge { a: 0, b: 1, overlap: &ab },
            Edge { a: 0, b: 2, overlap: &ac },
            Edge { a: 1, b: 2, overlap: &bc },
        ];
        let settled = settle(&clips, &edges, FADE).unwrap();
        assert!(distance_m(&settled, &poses[0]) < 1e-9);
        // Displaced, strong edges to two fixed clips bring it back.
        let mut moved = clips.clone();
        moved[0].map_from_clip = poses[0] * Pose3::new(Vector3::new(0.05, -0.03, 0.0), Vector3::z() * 0.02);
        moved[1].covariance = None;
        moved[2].covariance = None;
        let settled = settle(&moved, &edges, 1e9).unwrap();
        assert!(distance_m(&settled, &poses[0]) < 3e-3, "{settled:?}");
    }

    #[test]
    fn what_a_person_chose_stays_in_the_plane() {
        let clips =
            [Prior { covariance: None, ..prior(pose(1.0, 2.0, 0.5), 0.1) }, prior(pose(2.0, 2.0, 0.5), 0.1)];
        let overlap = sure(Pose3::identity(), 1e8);
        let edges = [Edge { a: 0, b: 1, overlap: &overlap }];
        let settled = settle(&clips, &edges, FADE).unwrap();
        assert!(distance_m(&settled, &clips[0].map_from_clip) < 1e-3);
    }
}
