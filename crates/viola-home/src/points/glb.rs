//! A map's points as binary glTF 2.0 (Khronos, GLB container), with a named node, mesh and material per
//! class, so that any viewer can distinguish, hide and colour classes.
//!
//! glTF has y up: a map point (x, y, z) becomes (x, z, -y). Its vertex colours are linear. They already have the light
//! of the recording in them, so the materials are unlit (`KHR_materials_unlit`).

use crate::assemble::POINT_BYTES;
use crate::light::{linear_u16, shown};
use serde_json::{Value, json};
use viola_geometry::taxonomy::{CLASSES, Class};

/// Position, normal, RGBA colour of 16 bits, probability, clip and padding.
const VERTEX_BYTES: usize = 40;

/// Extent of one class's points in one tile.
#[derive(Debug, Clone, Copy)]
struct Part {
    points: usize,
    min_m: [f32; 3],
    max_m: [f32; 3],
}

const NOTHING: Part = Part { points: 0, min_m: [f32::INFINITY; 3], max_m: [f32::NEG_INFINITY; 3] };

/// Streaming writer of a GLB file. Needs two passes over the tiles in the same order: `announce` for the
/// header's offsets, then `tile` for the bytes.
#[derive(Default)]
pub struct Glb {
    tiles: Vec<[Part; CLASSES]>,
}

fn position(point: &[u8]) -> [f32; 3] {
    let c = |at: usize| f32::from_le_bytes([point[at], point[at + 1], point[at + 2], point[at + 3]]);
    [c(0), c(8), -c(4)]
}

impl Glb {
    /// Registers a tile's points for the header.
    pub fn announce(&mut self, points: &[u8]) {
        let mut parts = [NOTHING; CLASSES];
        for point in points.chunks_exact(POINT_BYTES) {
            let Some(part) = parts.get_mut(usize::from(point[27])) else { continue };
            part.points += 1;
            for (axis, c) in position(point).into_iter().enumerate() {
                part.min_m[axis] = part.min_m[axis].min(c);
                part.max_m[axis] = part.max_m[axis].max(c);
            }
        }
        self.tiles.push(parts);
    }

    /// Returns a tile's points as vertices, grouped by class.
    pub fn tile(points: &[u8]) -> Vec<u8> {
        let light: Vec<[u8; 2]> = (0..=255).map(|value| linear_u16(value).to_le_bytes()).collect();
        let mut by_class: Vec<Vec<u8>> = vec![Vec::new(); CLASSES];
        for point in points.chunks_exact(POINT_BYTES) {
            let Some(out) = by_class.get_mut(usize::from(point[27])) else { continue };
            position(point).iter().for_each(|c| out.extend_from_slice(&c.to_le_bytes()));
            position(&point[12..]).iter().for_each(|c| out.extend_from_slice(&c.to_le_bytes()));
            let color = shown([point[24], point[25], point[26]]);
            color.iter().for_each(|value| out.extend_from_slice(&light[usize::from(*value)]));
            out.extend_from_slice(&u16::MAX.to_le_bytes());
            out.extend_from_slice(&point[28..32]);
            out.extend_from_slice(&[point[34], point[35], 0, 0]);
        }
        by_class.concat()
    }

    fn body_bytes(&self) -> usize {
        self.tiles.iter().flatten().map(|part| part.points * VERTEX_BYTES).sum()
    }

    fn document(&self) -> Vec<u8> {
        let mut accessors: Vec<Value> = Vec::new();
        let mut views: Vec<Value> = Vec::new();
        let mut primitives: Vec<Vec<Value>> = vec![Vec::new(); CLASSES];
        let mut offset = 0;
        let classes: Vec<Class> = Class::ALL
            .iter()
            .copied()
            .filter(|class| self.tiles.iter().any(|tile| tile[usize::from(class.id())].points > 0))
            .collect();
        for tile in &self.tiles {
            for (material, class) in classes.iter().enumerate() {
                let part = &tile[usize::from(class.id())];
                if part.points == 0 {
                    continue;
                }
                let view = views.len();
                let size = part.points * VERTEX_BYTES;
                views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": size,
                    "byteStride": VERTEX_BYTES, "target": 34962 }));
                offset += size;
                let first = accessors.len();
                let mut accessor = |at: usize, kind: u32, shape: &str, more: Value| {
                    let mut accessor = json!({ "bufferView": view, "byteOffset": at, "componentType": kind,
                        "count": part.points, "type": shape });
                    if let (Value::Object(all), Value::Object(more)) = (&mut accessor, more) {
                        all.extend(more);
                    }
                    accessors.push(accessor);
                };
                accessor(0, 5126, "VEC3", json!({ "min": part.min_m, "max": part.max_m }));
                accessor(12, 5126, "VEC3", json!({}));
                accessor(24, 5123, "VEC4", json!({ "normalized": true }));
                accessor(32, 5126, "SCALAR", json!({}));
                accessor(36, 5123, "SCALAR", json!({}));
                primitives[usize::from(class.id())].push(
                    json!({ "mode": 0, "material": material, "attributes": {
                    "POSITION": first, "NORMAL": first + 1, "COLOR_0": first + 2,
                    "_PROBABILITY": first + 3, "_CLIP": first + 4 } }),
                );
            }
        }
        let material = |class: &Class| {
            let color = class.color().map(|c| (f64::from(c) / 255.0 * 1000.0).round() / 1000.0);
            json!({ "name": class.name(), "extras": { "class_color": color, "class_id": class.id() },
                "extensions": { "KHR_materials_unlit": {} },
                "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 1 } })
        };
        let mesh = |class: &Class| json!({ "name": class.name(), "primitives": primitives[usize::from(class.id())] });
        let node = |(i, class): (usize, &Class)| json!({ "name": class.name(), "mesh": i });
        let mut document = json!({
            "asset": { "version": "2.0", "generator": concat!("viola ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [{ "name": "home" }],
        });
        if let (Value::Object(document), false) = (&mut document, classes.is_empty()) {
            let nodes: Vec<usize> = (0..classes.len()).collect();
            document.insert("scenes".into(), json!([{ "name": "home", "nodes": nodes }]));
            document.insert("extensionsUsed".into(), json!(["KHR_materials_unlit"]));
            document.insert("nodes".into(), classes.iter().enumerate().map(node).collect());
            document.insert("meshes".into(), classes.iter().map(mesh).collect());
            document.insert("materials".into(), classes.iter().map(material).collect());
            document.insert("accessors".into(), accessors.into());
            document.insert("bufferViews".into(), views.into());
            document.insert("buffers".into(), json!([{ "byteLength": offset }]));
        }
        let mut text = serde_json::to_vec(&document).unwrap_or_default();
        text.resize(text.len().next_multiple_of(4), b' ');
        text
    }

    /// Returns the header and the JSON chunk: all bytes before the points.
    pub fn head(&self) -> Vec<u8> {
        let document = self.document();
        let body = self.body_bytes();
        let chunk = if body > 0 { 8 } else { 0 };
        let total = 12 + 8 + document.len() + chunk + body;
        let mut out = Vec::with_capacity(document.len() + 28);
        out.extend_from_slice(b"glTF");
        [2, total as u32, document.len() as u32].iter().for_each(|n| out.extend_from_slice(&n.to_le_bytes()));
        out.extend_from_slice(b"JSON");
        out.extend_from_slice(&document);
        if body > 0 {
            out.extend_from_slice(&(body as u32).to_le_bytes());
            out.extend_from_slice(b"BIN\0");
        }
        out
    }

    /// Returns the file's size; none if it exceeds the GLB limit of 4 GiB.
    pub fn size_bytes(&self) -> Option<u64> {
        let size = (self.head().len() + self.body_bytes()) as u64;
        (size <= u64::from(u32::MAX)).then_some(size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::point_bytes;
    use crate::points::tests::points;

    #[test]
    fn colours_are_linear_light() {
        let mut point = points(1).remove(0);
        point.point.color = [128, 0, 255];
        let vertex = Glb::tile(&point_bytes(&point));
        assert_eq!(vertex.len(), VERTEX_BYTES);
        let light: Vec<u16> = vertex[24..32].as_chunks().0.iter().map(|c| u16::from_le_bytes(*c)).collect();
        // IEC 61966-2-1: 128 is light of 0.2159.
        assert_eq!(light, [14_146, 0, u16::MAX, u16::MAX]);
    }

    #[test]
    fn a_point_that_no_picture_showed_is_grey() {
        let mut point = points(1).remove(0);
        point.point.color = viola_reconstruct::NO_COLOR;
        let vertex = Glb::tile(&point_bytes(&point));
        let light: Vec<u16> = vertex[24..32].as_chunks().0.iter().map(|c| u16::from_le_bytes(*c)).collect();
        // IEC 61966-2-1: 150 is light of 0.3050.
        assert_eq!(light, [19_987, 19_987, 19_987, u16::MAX]);
    }
}
