//! A mesh as Wavefront OBJ, y up as in glTF. Colours follow the positions, as MeshLab and Blender read them.

use super::{Mesh, Vertex};
use crate::gltf::y_up;
use std::fmt::Write;

impl Mesh {
    /// Returns the mesh as Wavefront OBJ with vertex colours, with an object and a group for each part.
    pub fn obj(&self) -> String {
        let mut out = String::with_capacity(self.vertices.len() * 90 + self.triangles.len() * 40);
        // Writing to a String cannot fail.
        let _ = writeln!(out, "# viola {}: metres, y up, vertex colours", env!("CARGO_PKG_VERSION"));
        for Vertex { position_m, color, .. } in &self.vertices {
            let ([x, y, z], [r, g, b]) = (y_up(*position_m), color.map(|c| f32::from(c) / 255.0));
            let _ = writeln!(out, "v {x:.4} {y:.4} {z:.4} {r:.3} {g:.3} {b:.3}");
        }
        for vertex in &self.vertices {
            let [x, y, z] = y_up(vertex.normal);
            let _ = writeln!(out, "vn {x:.3} {y:.3} {z:.3}");
        }
        for part in &self.parts {
            // Some programs divide a file by objects and ignore its groups, others do the opposite.
            let _ = writeln!(out, "o {0}\ng {0}", part.name);
            for triangle in &self.triangles[part.triangles.clone()] {
                let [a, b, c] = triangle.map(|vertex| vertex + 1);
                let _ = writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}");
            }
        }
        out
    }
}
