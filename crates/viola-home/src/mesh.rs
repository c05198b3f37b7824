//! The surface of a home as triangles: vertices with colours, triangles by class and object.
//!
//! A hole in the points stays a hole. Positions are in the LiDAR map's frame, in metres.

mod field;
mod glb;
mod nets;
mod obj;
mod parts;
mod simplify;
#[cfg(test)]
mod tests;
mod texture;
mod usdz;
mod vertices;

use crate::assemble::Tile;
use crate::gltf::y_up;
use crate::{MAP_VOXEL_M, MapPoint};
use field::Field;
use parts::Part;

pub use parts::MeshObject;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::CloudPoint;

/// Triangles of a mesh unless a caller wants another number: a flat looks whole and stays below 15 MB as GLB.
pub const MESH_TRIANGLES: usize = 200_000;
/// Largest homes have a coarser grid: the memory of the simplification is bounded by the points of a fine one.
const FINE_POINTS: usize = 700_000;

/// A corner of triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Vertex {
    position_m: [f32; 3],
    /// Unit length, towards the observed side.
    normal: [f32; 3],
    color: [u8; 3],
    class: Class,
}

impl Vertex {
    /// Returns the difference in look, 0 to 1: of colours, or 1 for another class.
    fn difference(&self, other: &Vertex) -> f64 {
        if self.class != other.class {
            return 1.0;
        }
        let steps = self.color.iter().zip(&other.color).map(|(a, b)| f64::from(a.abs_diff(*b)) / 255.0);
        steps.fold(0.0, f64::max)
    }

    /// Returns the vertex between two: at fraction 0 the first, at 1 the second.
    fn towards(&self, other: &Vertex, fraction: f32) -> Vertex {
        let mix = |a: f32, b: f32| a + fraction * (b - a);
        let mixed = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|axis| mix(a[axis], b[axis]));
        let normal: [f32; 3] = mixed(self.normal, other.normal);
        let length = field::dot(normal, normal).sqrt();
        Vertex {
            position_m: mixed(self.position_m, other.position_m),
            normal: if length > 1e-6 { normal.map(|c| c / length) } else { self.normal },
            color: std::array::from_fn(|c| {
                mix(f32::from(self.color[c]), f32::from(other.color[c])).round() as u8
            }),
            class: if fraction < 0.5 { self.class } else { other.class },
        }
    }
}

/// Returns the lower and the upper corner of the box around vertices, with y up.
fn bounds(vertices: &[Vertex]) -> [[f32; 3]; 2] {
    let places = vertices.iter().map(|vertex| y_up(vertex.position_m));
    places.fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[low, high], place| {
        let each = |pick: fn(f32, f32) -> f32, a: [f32; 3]| std::array::from_fn(|i| pick(a[i], place[i]));
        [each(f32::min, low), each(f32::max, high)]
    })
}

/// A triangle mesh with vertex colours.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
    parts: Vec<Part>,
}

impl Mesh {
    /// Makes the mesh of a home's tiles with at most `triangles`; each of `objects` becomes a part with its id.
    pub fn new(tiles: &[Tile], objects: &[MeshObject], triangles: usize) -> Mesh {
        let points: Vec<&CloudPoint> =
            tiles.iter().flat_map(|tile| &tile.points).map(|MapPoint { point, .. }| point).collect();
        let coarser = (points.len() as f64 / FINE_POINTS as f64).max(1.0).sqrt();
        let step_m = (MAP_VOXEL_M * coarser) as f32;
        let net = nets::net(&Field::new(&points, step_m));
        let vertices = vertices::dressed(&net.positions_m, &points, step_m);
        let mut mesh = Mesh { vertices, triangles: net.triangles, parts: Vec::new() };
        mesh.drop_unused_vertices();
        simplify::simplify(&mut mesh, triangles);
        parts::divide(&mut mesh, objects);
        mesh
    }

    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Returns the vertices, in the LiDAR map's frame.
    pub fn positions_m(&self) -> impl Iterator<Item = [f32; 3]> {
        self.vertices.iter().map(|vertex| vertex.position_m)
    }

    /// Returns the vertices' indices of each triangle.
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    fn drop_unused_vertices(&mut self) {
        let mut place = vec![u32::MAX; self.vertices.len()];
        for vertex in self.triangles.iter().flatten() {
            place[*vertex as usize] = 0;
        }
        for (kept, place) in place.iter_mut().filter(|place| **place == 0).enumerate() {
            *place = kept as u32;
        }
        let mut is_kept = place.iter().map(|place| *place != u32::MAX);
        self.vertices.retain(|_| is_kept.next().unwrap_or(false));
        self.triangles.iter_mut().flatten().for_each(|vertex| *vertex = place[*vertex as usize]);
    }
}
