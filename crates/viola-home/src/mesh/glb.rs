//! A mesh as binary glTF: one node, mesh and material for each part.

use super::{Mesh, Vertex, bounds};
use crate::gltf::{self, y_up};
use crate::light::linear_u16;
use serde_json::{Value, json};

/// Position, normal and RGBA colour of 16 bits.
const VERTEX_BYTES: usize = 32;
const TRIANGLE_BYTES: usize = 12;

impl Mesh {
    /// Returns the mesh as binary glTF 2.0, with a node for each part.
    pub fn glb(&self) -> Vec<u8> {
        let body = body(self);
        let mut out = gltf::head(&document(self), body.len());
        out.extend_from_slice(&body);
        out
    }
}

fn body(mesh: &Mesh) -> Vec<u8> {
    let mut out =
        Vec::with_capacity(mesh.vertices.len() * VERTEX_BYTES + mesh.triangles.len() * TRIANGLE_BYTES);
    for Vertex { position_m, normal, color, .. } in &mesh.vertices {
        let floats = y_up(*position_m).into_iter().chain(y_up(*normal));
        floats.for_each(|c| out.extend_from_slice(&c.to_le_bytes()));
        let color = color.map(linear_u16).into_iter().chain([u16::MAX]);
        color.for_each(|c| out.extend_from_slice(&c.to_le_bytes()));
    }
    for part in &mesh.parts {
        let indices = mesh.triangles[part.triangles.clone()].iter().flatten();
        indices.for_each(|vertex| {
            out.extend_from_slice(&(vertex - part.vertices.start as u32).to_le_bytes());
        });
    }
    out
}

fn document(mesh: &Mesh) -> Value {
    if mesh.parts.is_empty() {
        return gltf::empty();
    }
    let indices_at = mesh.vertices.len() * VERTEX_BYTES;
    let (mut accessors, mut meshes, mut nodes, mut materials) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (index, part) in mesh.parts.iter().enumerate() {
        let first = accessors.len();
        let (count, at) = (part.vertices.len(), part.vertices.start * VERTEX_BYTES);
        let [min, max] = bounds(&mesh.vertices[part.vertices.clone()]);
        accessors.extend([
            json!({ "bufferView": 0, "byteOffset": at, "componentType": 5126, "count": count, "type": "VEC3", "min": min, "max": max }),
            json!({ "bufferView": 0, "byteOffset": at + 12, "componentType": 5126, "count": count, "type": "VEC3" }),
            json!({ "bufferView": 0, "byteOffset": at + 24, "componentType": 5123, "count": count, "type": "VEC4", "normalized": true }),
            json!({ "bufferView": 1, "byteOffset": part.triangles.start * TRIANGLE_BYTES, "componentType": 5125,
                "count": part.triangles.len() * 3, "type": "SCALAR" }),
        ]);
        let attributes = json!({ "POSITION": first, "NORMAL": first + 1, "COLOR_0": first + 2 });
        materials.push(
            json!({ "name": part.name, "doubleSided": true, "extensions": { "KHR_materials_unlit": {} },
            "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 1 } }),
        );
        meshes.push(json!({ "name": part.name, "primitives": [
            { "attributes": attributes, "indices": first + 3, "material": index, "mode": 4 }] }));
        nodes.push(json!({ "name": part.name, "mesh": index, "extras": { "class": part.class.name() } }));
    }
    let all: Vec<usize> = (0..nodes.len()).collect();
    json!({
        "asset": gltf::asset(),
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "name": "home", "nodes": all }],
        "nodes": nodes, "meshes": meshes, "materials": materials, "accessors": accessors,
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": indices_at, "byteStride": VERTEX_BYTES, "target": 34962 },
            { "buffer": 0, "byteOffset": indices_at, "byteLength": mesh.triangles.len() * TRIANGLE_BYTES, "target": 34963 },
        ],
        "buffers": [{ "byteLength": indices_at + mesh.triangles.len() * TRIANGLE_BYTES }],
    })
}
