//! The points of a map as binary PLY.

use crate::assemble::POINT_BYTES;

/// A PLY file in the making: its head, then the points of one tile after the other.
pub struct Ply {
    points: usize,
}

impl Ply {
    pub fn new(points: usize) -> Ply {
        Ply { points }
    }

    pub fn head(&self) -> Vec<u8> {
        format!(
            "ply\nformat binary_little_endian 1.0\ncomment frame map, metres, z up\n\
            comment clip: place in the list of the map's clips\nelement vertex {}\n\
            property float x\nproperty float y\nproperty float z\n\
            property float nx\nproperty float ny\nproperty float nz\n\
            property uchar red\nproperty uchar green\nproperty uchar blue\n\
            property uchar label\nproperty float probability\nproperty ushort views\nproperty ushort clip\n\
            property ushort weight\n\
            end_header\n",
            self.points
        )
        .into_bytes()
    }

    pub fn size_bytes(&self) -> u64 {
        self.head().len() as u64 + (self.points * POINT_BYTES) as u64
    }
}
