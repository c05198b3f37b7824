//! A map's points as binary glTF, with a named node, mesh and material per class, so that any viewer can distinguish,
//! hide and colour classes.

use crate::assemble::POINT_BYTES;
use crate::gltf::{self, y_up};
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
    let c = |axis: usize| f32::from_le_bytes(point.as_chunks::<4>().0[axis]);
    y_up([c(0), c(1), c(2)])
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

    fn document(&self) -> Value {
        let (mut accessors, mut views) = (Vec::new(), Vec::new());
        let mut primitives: Vec<Vec<Value>> = vec![Vec::new(); CLASSES];
        let mut offset = 0;
        let is_there = |class: &Class| self.tiles.iter().any(|tile| tile[usize::from(class.id())].points > 0);
        let classes: Vec<Class> = Class::ALL.iter().copied().filter(is_there).collect();
        if classes.is_empty() {
            return gltf::empty();
        }
        for tile in &self.tiles {
            for (material, class) in classes.iter().enumerate() {
                let Part { points: count, min_m, max_m } = tile[usize::from(class.id())];
                if count == 0 {
                    continue;
                }
                let view = views.len();
                let size = count * VERTEX_BYTES;
                views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": size,
                    "byteStride": VERTEX_BYTES, "target": 34962 }));
                offset += size;
                let first = accessors.len();
                accessors.extend([
                    json!({ "bufferView": view, "byteOffset": 0, "componentType": 5126, "count": count, "type": "VEC3",
                        "min": min_m, "max": max_m }),
                    json!({ "bufferView": view, "byteOffset": 12, "componentType": 5126, "count": count, "type": "VEC3" }),
                    json!({ "bufferView": view, "byteOffset": 24, "componentType": 5123, "count": count, "type": "VEC4",
                        "normalized": true }),
                    json!({ "bufferView": view, "byteOffset": 32, "componentType": 5126, "count": count, "type": "SCALAR" }),
                    json!({ "bufferView": view, "byteOffset": 36, "componentType": 5123, "count": count, "type": "SCALAR" }),
                ]);
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
        json!({
            "asset": gltf::asset(),
            "scene": 0,
            "scenes": [{ "name": "home", "nodes": (0..classes.len()).collect::<Vec<_>>() }],
            "extensionsUsed": ["KHR_materials_unlit"],
            "nodes": classes.iter().enumerate().map(node).collect::<Vec<_>>(),
            "meshes": classes.iter().map(mesh).collect::<Vec<_>>(),
            "materials": classes.iter().map(material).collect::<Vec<_>>(),
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{ "byteLength": offset }],
        })
    }

    /// Returns the header and the JSON chunk: all bytes before the points.
    pub fn head(&self) -> Vec<u8> {
        gltf::head(&self.document(), self.body_bytes())
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

    /// IEC 61966-2-1: 128 is light of 0.2159, and 150, the grey of a point that no picture showed, of 0.3050.
    #[test]
    fn colours_are_linear_light() {
        for (color, light) in [
            ([128, 0, 255], [14_146, 0, u16::MAX, u16::MAX]),
            (viola_reconstruct::NO_COLOR, [19_987, 19_987, 19_987, u16::MAX]),
        ] {
            let mut point = points(1).remove(0);
            point.point.color = color;
            let vertex = Glb::tile(&point_bytes(&point));
            assert_eq!(vertex.len(), VERTEX_BYTES);
            let found: Vec<u16> =
                vertex[24..32].as_chunks().0.iter().map(|c| u16::from_le_bytes(*c)).collect();
            assert_eq!(found, light, "{color:?}");
        }
    }
}
