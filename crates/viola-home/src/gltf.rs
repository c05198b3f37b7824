//! Binary glTF 2.0 (Khronos, GLB container): what the points and the mesh of a home have in common.
//!
//! glTF has y up: a map point (x, y, z) becomes (x, z, -y). Vertex colours are linear. They already have the light of the
//! recording in them, so the materials are unlit (`KHR_materials_unlit`).

use serde_json::{Value, json};

/// Returns a place or a direction of the map with y up, as file formats of meshes have it.
pub fn y_up([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, z, -y]
}

/// Returns the `asset` of a document.
pub fn asset() -> Value {
    json!({ "version": "2.0", "generator": concat!("viola ", env!("CARGO_PKG_VERSION")) })
}

/// Returns the document of a file without a vertex.
pub fn empty() -> Value {
    json!({ "asset": asset(), "scene": 0, "scenes": [{ "name": "home" }] })
}

/// Returns the header, the JSON chunk and the head of the binary chunk: all bytes before the body.
pub fn head(document: &Value, body_bytes: usize) -> Vec<u8> {
    let mut text = serde_json::to_vec(document).unwrap_or_default();
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = if body_bytes > 0 { 8 + body_bytes } else { 0 };
    let total = 12 + 8 + text.len() + chunk;
    let mut out = Vec::with_capacity(text.len() + 28);
    out.extend_from_slice(b"glTF");
    [2, total as u32, text.len() as u32].iter().for_each(|n| out.extend_from_slice(&n.to_le_bytes()));
    out.extend_from_slice(b"JSON");
    out.extend_from_slice(&text);
    if body_bytes > 0 {
        out.extend_from_slice(&(body_bytes as u32).to_le_bytes());
        out.extend_from_slice(b"BIN\0");
    }
    out
}
