//! A point of a home's map.

use viola_reconstruct::CloudPoint;

/// A point of a home's map, in the LiDAR map's frame, with its source clip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPoint {
    pub point: CloudPoint,
    /// Clip with the largest weight: its index in the map's list of clips.
    pub clip: u16,
}
