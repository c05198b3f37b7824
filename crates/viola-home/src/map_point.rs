//! A point of a home's map.

use viola_reconstruct::CloudPoint;

/// A point of a home's map, in the LiDAR map's frame, and where it came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPoint {
    pub point: CloudPoint,
    /// The clip that saw most of it: its place in the list of the map's clips.
    pub clip: u16,
}
