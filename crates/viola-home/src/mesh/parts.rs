//! Divides a mesh: a part for each object, and one for each class of the rest.

use super::{Mesh, Vertex};
use crate::objects::UprightBox;
use viola_geometry::taxonomy::Class;

/// Surfaces so near to an object's box still belong to it.
const MARGIN_M: f64 = 0.05;

/// An object whose surface becomes a part of a mesh.
pub struct MeshObject<'a> {
    pub id: &'a str,
    pub class: Class,
    pub bounds: UprightBox,
}

/// A named range of a mesh's triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The id of an object, or the name of a class.
    pub name: String,
    pub class: Class,
    pub first: usize,
    pub triangles: usize,
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
        // Objects come after the classes, in their own order.
        (object.map_or(0, |index| index + 1), class.id())
    };
    let mut keyed: Vec<((usize, u16), [u32; 3])> =
        mesh.triangles.iter().map(|triangle| (part_of(triangle), *triangle)).collect();
    keyed.sort_by_key(|(key, _)| *key);
    mesh.parts = Vec::new();
    for (index, ((object, class), _)) in keyed.iter().enumerate() {
        let is_new = index == 0 || keyed[index - 1].0 != (*object, *class);
        if is_new {
            let class = Class::ALL.get(usize::from(*class)).copied().unwrap_or(Class::Other);
            let name = object.checked_sub(1).map_or(class.name(), |index| objects[index].id).to_owned();
            mesh.parts.push(Part { name, class, first: index, triangles: 0 });
        }
        if let Some(part) = mesh.parts.last_mut() {
            part.triangles += 1;
        }
    }
    mesh.triangles = keyed.into_iter().map(|(_, triangle)| triangle).collect();
}

fn majority([a, b, c]: &[&Vertex; 3]) -> Class {
    if b.class == c.class { b.class } else { a.class }
}
