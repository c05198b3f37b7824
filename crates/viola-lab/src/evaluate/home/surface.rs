//! Compares the fused map with the true surface.

use super::instances::LabelledMesh;
use crate::evaluate::cells::Cells;
use serde::Serialize;
use std::ops::Range;
use viola_formats::clip::{Clip, ClipError, Frame};
use viola_geometry::{Point3, Pose2, Vector3};
use viola_home::MapPoint;
use viola_reconstruct::label::seen_at;

/// Maximum distance of matching surfaces.
pub const NEAR_M: f64 = 0.05;

/// Accuracy and completeness of a fused map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurfaceScore {
    pub points: usize,
    /// Fraction of the fused points within 5 cm of the mesh.
    pub accuracy: f64,
    /// Number of mesh vertices that the frames see.
    pub seen_vertices: usize,
    /// Fraction of those with a fused point within 5 cm.
    pub completeness: f64,
}

/// Compares a fused map with the mesh. `seen` marks the vertices that the clips' frames see.
pub fn compare(map: &[MapPoint], mesh: &LabelledMesh, seen: &[bool], map_from_world: &Pose2) -> SurfaceScore {
    let vertices: Vec<Point3> =
        mesh.mesh.vertices_m.iter().map(|v| Point3::from(mesh.in_map(v, map_from_world))).collect();
    // Vertices are a few centimetres apart: each one indexes its adjacent faces.
    let by_vertex = Cells::new(NEAR_M, vertices.iter().copied().zip(0u32..));
    let mut faces_of: Vec<Vec<u32>> = vec![Vec::new(); vertices.len()];
    for (number, face) in (0u32..).zip(&mesh.mesh.triangles) {
        face.iter().for_each(|corner| faces_of[*corner as usize].push(number));
    }
    let on_mesh = |p: &Point3| {
        let mut around: Vec<u32> =
            by_vertex.around(p).flat_map(|vertex| faces_of[*vertex as usize].iter().copied()).collect();
        around.sort_unstable();
        around.dedup();
        around.into_iter().any(|face| {
            let corners = mesh.mesh.triangles[face as usize].map(|i| vertices[i as usize]);
            to_triangle_m(p, &corners) <= NEAR_M
        })
    };
    let true_points = map.iter().filter(|p| on_mesh(&p.point.position())).count();
    let by_point = Cells::new(NEAR_M, map.iter().map(|p| (p.point.position(), p.point.position())));
    let (mut there, mut found) = (0, 0);
    for (vertex, _) in vertices.iter().zip(seen).filter(|(_, seen)| **seen) {
        there += 1;
        let near = |point: &Point3| (point - vertex).norm() <= NEAR_M;
        found += usize::from(by_point.around(vertex).any(near));
    }
    SurfaceScore {
        points: map.len(),
        accuracy: true_points as f64 / map.len().max(1) as f64,
        seen_vertices: there,
        completeness: found as f64 / there.max(1) as f64,
    }
}

/// The vertices of a mesh that frames show.
pub struct Seen {
    /// In the picture, in the sensor's range, and not occluded.
    pub in_pictures: Vec<bool>,
    /// With a depth that is right to 10 cm.
    pub in_depth: Vec<bool>,
}

/// Marks the vertices that the given frames of the clip see.
pub fn seen_by(clip: &Clip, frames: &[Range<usize>], mesh: &LabelledMesh) -> Result<Seen, ClipError> {
    let vertices = &mesh.mesh.vertices_m;
    let mut seen = Seen { in_pictures: vec![false; vertices.len()], in_depth: vec![false; vertices.len()] };
    let mut places: Vec<usize> = frames.iter().cloned().flatten().collect();
    places.sort_unstable();
    places.dedup();
    for index in places {
        let frame = clip.load(index)?;
        let Some(world_from_camera) = frame.header.world_from_camera else { continue };
        for (seen, vertex) in seen.in_pictures.iter_mut().zip(vertices) {
            *seen = *seen || seen_at(vertex, &frame, &world_from_camera).is_some();
        }
        let camera_from_world = world_from_camera.inverse();
        for (seen, vertex) in seen.in_depth.iter_mut().zip(vertices) {
            *seen = *seen || is_measured(&(camera_from_world * vertex), &frame);
        }
    }
    Ok(seen)
}

/// Returns whether the frame's depth at a point of the camera's frame is right to 10 cm.
fn is_measured(at: &Point3, frame: &Frame) -> bool {
    let camera = &frame.depth_camera;
    let pixel = |focal: f64, along: f64, centre: f64, side: u32| {
        let place = (focal * along / at.z + centre).round();
        (place >= 0.0 && place < f64::from(side)).then_some(place as u32)
    };
    let u = pixel(camera.fx, at.x, camera.cx, camera.width);
    let v = pixel(camera.fy, at.y, camera.cy, camera.height);
    at.z > 0.0
        && u.zip(v).is_some_and(|(u, v)| {
            let depth_m = f64::from(frame.depth.at(u, v));
            depth_m > 0.0 && (depth_m - at.z).abs() <= 0.1
        })
}

/// Returns the distance to a triangle (Ericson, "Real-Time Collision Detection", 2005, 5.1.5, by projection).
fn to_triangle_m(p: &Point3, [a, b, c]: &[Point3; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    if let Some(unit) = normal.try_normalize(1e-12) {
        let inside = |from: &Point3, to: &Point3| (to - from).cross(&(p - from)).dot(&normal) >= 0.0;
        if inside(a, b) && inside(b, c) && inside(c, a) {
            return (p - a).dot(&unit).abs();
        }
    }
    let edge = |from: &Point3, to: &Point3| {
        let along: Vector3 = to - from;
        let t = ((p - from).dot(&along) / along.norm_squared().max(1e-18)).clamp(0.0, 1.0);
        (p - (from + along * t)).norm()
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}
