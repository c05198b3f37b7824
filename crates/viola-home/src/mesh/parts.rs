//! Divides a mesh: a part for each object, and one for each class of the rest.

use super::{Mesh, Vertex};
use crate::objects::UprightBox;
use std::ops::Range;
use viola_geometry::taxonomy::Class;

/// Surfaces so near to an object's box still belong to it.
const MARGIN_M: f64 = 0.05;

/// An object whose surface becomes a part of a mesh.
pub struct MeshObject<'a> {
    pub id: &'a str,
    pub class: Class,
    pub bounds: UprightBox,
}

/// A named range of a mesh's triangles, and of the vertices that they alone have: programs read each part as a mesh of
/// its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The id of an object, or the name of a class.
    pub name: String,
    pub class: Class,
    pub triangles: Range<usize>,
    pub vertices: Range<usize>,
}

/// Sorts the triangles of a mesh by parts.
pub fn divide(mesh: &mut Mesh, objects: &[MeshObject]) {
    let part_of = |triangle: &[u32; 3]| {
        let corners = triangle.map(|vertex| &mesh.vertices[vertex as usize]);
        let class = majority(&corners);
        let middle: [f64; 3] = std::array::from_fn(|axis| {
            corners.iter().map(|vertex| f64::from(vertex.position_m[axis])).sum::<f64>() / 3.0
        });
        let object =
            objects.iter().position(|object| object.class == class && object.bounds.holds(&middle, MARGIN_M));
        let object = object.or_else(|| within(objects, class, &middle));
        // Objects come after the classes, in their own order.
        (object.map_or(0, |index| index + 1), object.map_or(class, |index| objects[index].class).id())
    };
    let mut keyed: Vec<((usize, u16), [u32; 3])> =
        mesh.triangles.iter().map(|triangle| (part_of(triangle), *triangle)).collect();
    keyed.sort_by_key(|(key, _)| *key);
    let (mut vertices, mut parts) = (Vec::new(), Vec::new());
    mesh.triangles.clear();
    for of_part in keyed.chunk_by(|a, b| a.0 == b.0) {
        let (object, class) = of_part[0].0;
        let class = Class::ALL.get(usize::from(class)).copied().unwrap_or(Class::Other);
        let name = object.checked_sub(1).map_or(class.name(), |index| objects[index].id).to_owned();
        let mut used: Vec<u32> = of_part.iter().flat_map(|(_, triangle)| *triangle).collect();
        used.sort_unstable();
        used.dedup();
        let (first_vertex, first) = (vertices.len(), mesh.triangles.len());
        let place = |vertex: u32| (first_vertex + used.partition_point(|other| *other < vertex)) as u32;
        mesh.triangles.extend(of_part.iter().map(|(_, triangle)| triangle.map(place)));
        vertices.extend(used.iter().map(|vertex| mesh.vertices[*vertex as usize]));
        parts.push(Part {
            name,
            class,
            triangles: first..mesh.triangles.len(),
            vertices: first_vertex..vertices.len(),
        });
    }
    (mesh.vertices, mesh.parts) = (vertices, parts);
}

/// Returns the smallest object around surface of another class: an object's class may be that of its size, or a person's.
fn within(objects: &[MeshObject], class: Class, middle: &[f64; 3]) -> Option<usize> {
    if class.is_structure() || matches!(class, Class::Rug | Class::Curtain) {
        return None;
    }
    let volume_m3 = |index: &usize| objects[*index].bounds.size_m.iter().product::<f64>();
    let around = (0..objects.len()).filter(|index| objects[*index].bounds.holds(middle, 0.0));
    around.min_by(|a, b| volume_m3(a).total_cmp(&volume_m3(b)))
}

fn majority([a, b, c]: &[&Vertex; 3]) -> Class {
    if b.class == c.class { b.class } else { a.class }
}
