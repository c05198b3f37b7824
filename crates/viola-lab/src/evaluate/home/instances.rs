//! Furniture of a labelled mesh: connected surface of one class.

use super::super::Mesh;
use super::super::labels::Folding;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point3, Pose2, groups};
use viola_home::{UprightBox, fit_box};

/// A ground-truth object.
#[derive(Debug, Clone)]
pub struct Instance {
    pub class: Class,
    pub vertices: usize,
    /// Bounding box of all its vertices along the axes of the recording's world.
    pub world_box: UprightBox,
    /// Box with the smallest footprint, in the map.
    pub map_box: UprightBox,
}

/// A labelled mesh, in the recording's world.
pub struct LabelledMesh {
    pub mesh: Mesh,
    /// Class of each vertex; none if unlabelled.
    pub classes: Vec<Option<Class>>,
    /// Height of the floor in the world: median of the floor's vertices.
    pub floor_m: f64,
}

/// Minimum vertices of an object; the mesh has one every two centimetres.
const MIN_VERTICES: usize = 50;
/// Minimum extent along some axis of the world, for true and found objects.
pub const MIN_EXTENT_M: f64 = 0.5;

impl LabelledMesh {
    pub fn new(mesh: Mesh, folding: &Folding) -> LabelledMesh {
        let classes: Vec<Option<Class>> = mesh.labels.iter().map(|label| folding.class(*label)).collect();
        let floor = mesh.vertices_m.iter().zip(&classes).filter(|(_, class)| **class == Some(Class::Floor));
        let mut heights: Vec<f64> = floor.map(|(vertex, _)| vertex.z).collect();
        heights.sort_by(f64::total_cmp);
        let floor_m = heights.get(heights.len() / 2).copied().unwrap_or(0.0);
        LabelledMesh { mesh, classes, floor_m }
    }

    /// Returns a vertex in the map's frame, with z from the floor.
    pub fn in_map(&self, vertex: &Point3, map_from_world: &Pose2) -> [f64; 3] {
        let at = map_from_world.apply(&vertex.xy());
        [at.x, at.y, vertex.z - self.floor_m]
    }

    /// Returns the connected surface pieces of classes that `counts` accepts, the largest first.
    pub fn instances(&self, map_from_world: &Pose2, counts: impl Fn(Class) -> bool) -> Vec<Instance> {
        let mut parent: Vec<u32> = (0..self.classes.len() as u32).collect();
        for face in &self.mesh.triangles {
            for (a, b) in [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])] {
                if self.classes[a as usize].is_some() && self.classes[a as usize] == self.classes[b as usize]
                {
                    groups::join(&mut parent, a, b);
                }
            }
        }
        let mut members: std::collections::BTreeMap<u32, Vec<u32>> = Default::default();
        for vertex in 0..parent.len() as u32 {
            members.entry(groups::root(&mut parent, vertex)).or_default().push(vertex);
        }
        let mut out: Vec<Instance> = members
            .into_values()
            .filter(|vertices| vertices.len() >= MIN_VERTICES)
            .filter_map(|vertices| {
                let class = self.classes[vertices[0] as usize].filter(|class| counts(*class))?;
                let place = |i: &u32| &self.mesh.vertices_m[*i as usize];
                let world: Vec<[f64; 3]> =
                    vertices.iter().map(place).map(|v| [v.x, v.y, v.z - self.floor_m]).collect();
                let map: Vec<[f64; 3]> =
                    vertices.iter().map(place).map(|v| self.in_map(v, map_from_world)).collect();
                let world_box = along_axes(&world, 0.0);
                let is_large = world_box.size_m.iter().any(|side| *side > MIN_EXTENT_M);
                is_large.then_some(Instance {
                    class,
                    vertices: vertices.len(),
                    world_box,
                    map_box: fit_box(&map, None, 0.0)?,
                })
            })
            .collect();
        out.sort_by(|a, b| b.vertices.cmp(&a.vertices).then(a.class.cmp(&b.class)));
        out
    }
}

/// Returns the axis-aligned box without the fraction `beyond` of the points at each face.
pub fn along_axes(points: &[[f64; 3]], beyond: f64) -> UprightBox {
    let spans = [0, 1, 2].map(|axis| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        values.sort_by(f64::total_cmp);
        let off = (values.len() as f64 * beyond) as usize;
        match values.len() {
            0 => [0.0; 2],
            len => [values[off], values[len - 1 - off]],
        }
    });
    UprightBox {
        centre_m: spans.map(|[low, high]| (low + high) / 2.0),
        size_m: spans.map(|[low, high]| high - low),
        yaw_rad: 0.0,
    }
}
