//! A point of a home's map.

use viola_reconstruct::CloudPoint;

/// A point of a home's map, in the LiDAR map's frame, with its source clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPoint {
    pub point: CloudPoint,
    /// Clip with the largest weight: its index in the map's list of clips.
    pub clip: u16,
}

#[cfg(test)]
impl MapPoint {
    /// Returns a point of the first clip.
    pub fn new(position_m: [f64; 3], normal: [f32; 3], label: viola_reconstruct::Label) -> MapPoint {
        let position_m = position_m.map(|c| c as f32);
        MapPoint { point: CloudPoint { position_m, normal, color: [0; 3], label, weight: 100 }, clip: 0 }
    }
}
