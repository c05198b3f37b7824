//! The occupied points as PLY.

use super::Written;
use crate::lidar::LidarMap;
use crate::ply;

/// Writes binary little-endian PLY, with coordinates in full precision and z zero.
pub(super) fn write(map: &LidarMap) -> Written {
    let count = map.occupied_m.len();
    let properties = [("double", "x"), ("double", "y"), ("double", "z")];
    let header = ply::header(&["metres, x right, y up"], count, &properties);
    let mut bytes = Vec::with_capacity(header.len() + 24 * count);
    bytes.extend_from_slice(header.as_bytes());
    for point in &map.occupied_m {
        for value in [point.x, point.y, 0.0] {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
    }
    let mut notes = Vec::new();
    if map.cells.is_some() {
        notes.push("free cells are not kept".to_string());
    }
    if !map.rooms.is_empty() || map.charger.is_some() || !map.info.marks_in_words().is_empty() {
        notes.push("rooms, charger and marks are not kept".to_string());
    }
    Written { bytes, file_from_map_m: [0.0; 2], notes }
}
