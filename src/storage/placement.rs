//! Where a home's map has a clip.

use serde::{Deserialize, Serialize};
use viola_geometry::Pose2;
use viola_home::PlacedBy;

/// Where a revision of the home's map has a clip, and who says so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Placement {
    pub map_from_clip: Pose2,
    pub by: PlacedBy,
    /// That the pose is right to 10 degrees and 0.3 m, 0..1; null where a person chose it.
    #[schema(minimum = 0, maximum = 1, example = 0.97)]
    pub probability: Option<f64>,
    /// Of the home's map.
    #[schema(minimum = 1, example = 4)]
    pub map_revision: i64,
}
