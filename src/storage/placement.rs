//! The placement of a clip in its home's map.

use serde::{Deserialize, Serialize};
use viola_geometry::Pose2;
use viola_home::PlacedBy;

/// Pose of a clip in a revision of the home's map, and its source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    pub map_from_clip: Pose2,
    pub by: PlacedBy,
    /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1; null if a person chose it.
    pub probability: Option<f64>,
    /// Revision of the home's map.
    pub map_revision: i64,
}
