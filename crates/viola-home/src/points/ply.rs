//! A map's points as binary PLY.

use crate::assemble::POINT_BYTES;
use crate::ply::PROPERTIES;
use viola_formats::ply;

/// Streaming writer of a PLY file: its header, then the points of one tile after the other.
pub struct Ply {
    points: usize,
}

impl Ply {
    pub fn new(points: usize) -> Ply {
        Ply { points }
    }

    pub fn head(&self) -> Vec<u8> {
        let [head @ .., weight] = PROPERTIES;
        let properties: Vec<_> = head.into_iter().chain([("ushort", "clip"), weight]).collect();
        let comments = ["frame map, metres, z up", "clip: place in the list of the map's clips"];
        ply::header(&comments, self.points, &properties).into_bytes()
    }

    pub fn size_bytes(&self) -> u64 {
        self.head().len() as u64 + (self.points * POINT_BYTES) as u64
    }
}
