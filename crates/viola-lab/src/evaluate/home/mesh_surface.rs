//! Compares the mesh of a home's map with the true surface.

use super::instances::LabelledMesh;
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::TriMesh;
use rayon::prelude::*;
use serde::Serialize;
use viola_geometry::{Point3, Pose2};
use viola_home::Mesh;

/// Maximum distance of matching surfaces.
const NEAR_M: f64 = 0.03;

/// Accuracy and completeness of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeshScore {
    pub triangles: usize,
    pub glb_bytes: usize,
    /// Fraction of its vertices within 3 cm of the true mesh.
    pub accuracy: f64,
    /// Number of true vertices at which a frame's depth is right to 10 cm.
    pub seen_vertices: usize,
    /// Fraction of those within 3 cm of the mesh.
    pub completeness: f64,
}

/// Compares a mesh with the true one. `seen` marks the true vertices that the frames measured.
pub fn score_mesh(mesh: &Mesh, truth: &LabelledMesh, seen: &[bool], map_from_world: &Pose2) -> MeshScore {
    let in_map = |vertex: &Point3| Vector::from(truth.in_map(vertex, map_from_world));
    let vertices: Vec<Vector> = truth.mesh.vertices_m.iter().map(in_map).collect();
    let ours: Vec<Vector> =
        mesh.positions_m().map(|position_m| Vector::from(position_m.map(f64::from))).collect();
    let wanted: Vec<Vector> =
        vertices.iter().zip(seen).filter(|(_, seen)| **seen).map(|(vertex, _)| *vertex).collect();
    MeshScore {
        triangles: mesh.triangles(),
        glb_bytes: mesh.glb().len(),
        accuracy: fraction_near(&ours, vertices, &truth.mesh.triangles),
        seen_vertices: wanted.len(),
        completeness: fraction_near(&wanted, ours.clone(), mesh.corners()),
    }
}

/// Returns the fraction of points within [`NEAR_M`] of a surface; 0 without a surface.
fn fraction_near(points: &[Vector], vertices: Vec<Vector>, triangles: &[[u32; 3]]) -> f64 {
    let Ok(surface) = TriMesh::new(vertices, triangles.to_vec()) else { return 0.0 };
    let near = points
        .par_iter()
        .filter(|point| surface.project_local_point_with_max_dist(**point, false, NEAR_M).is_some());
    near.count() as f64 / points.len().max(1) as f64
}

impl MeshScore {
    pub fn markdown(&self) -> String {
        format!(
            "| triangles of the mesh | GLB | vertices within 3 cm of the true mesh | true vertices measured | within 3 cm of the mesh |\n\
             |---|---|---|---|---|\n| {} | {:.1} MB | {:.1} % | {} | {:.1} % |\n",
            self.triangles,
            self.glb_bytes as f64 / 1e6,
            100.0 * self.accuracy,
            self.seen_vertices,
            100.0 * self.completeness
        )
    }
}
