//! The method: from a clip and a LiDAR map to the clip's pose in the map.

use crate::geometry::Pose2;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The verdict on a clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlignmentState {
    /// One pose stands out.
    Aligned,
    /// Several poses that are not close to each other explain the clip about equally well.
    Ambiguous,
    /// No pose can be given; the reasons say why.
    Failed,
}

/// A machine-readable reason for a verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Reason {
    /// Stable, in snake case, for programs: `two_modes`, `too_few_hits`, `no_floor` ...
    pub code: String,
    /// For people.
    pub detail: String,
}

/// One explanation of the clip, the best first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Alternative {
    pub map_from_clip: Pose2,
    /// Mean robust distance of the hits to the map plus the free-space penalty, in metres: what ranks them.
    pub loss_m: f64,
    /// Share of the hits within 0.1 m of the map, 0..1.
    pub inliers: f64,
    /// Share of the clip's rays that run through walls of the map, 0..1.
    pub blocked_rays: f64,
    /// Posterior probability, null until it is calibrated.
    pub probability: Option<f64>,
}

/// The answer for one clip: `result.json` of `viola align`, and `alignment` of a clip over HTTP.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Alignment {
    pub state: AlignmentState,
    /// That the pose is right; null until it is calibrated.
    pub probability: Option<f64>,
    /// Null when the state is `failed`.
    pub map_from_clip: Option<Pose2>,
    /// Of (x_m, y_m, yaw_rad), row after row: square metres, metre radians, square radians.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// That of the best alternative.
    pub loss_m: Option<f64>,
    pub inliers: Option<f64>,
    /// Share of the LiDAR map's points that the clip's hits explain, 0..1 (the paper's coverage).
    pub coverage: Option<f64>,
    /// The ranked explanations, the chosen one first.
    pub alternatives: Vec<Alternative>,
    pub reasons: Vec<Reason>,
    pub hits: usize,
    pub key_frames: usize,
    pub floor: Option<FloorReport>,
    /// Time of each stage. The only part that differs from run to run.
    pub seconds: BTreeMap<String, f64>,
}

/// What was found of the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct FloorReport {
    /// Height of the first camera above it, in metres.
    pub camera_height_m: f64,
    /// Fused points within 2 cm of the plane.
    pub support_points: usize,
    /// Angle to the capture's gravity in degrees, when the capture knows gravity.
    pub gravity_angle_deg: Option<f64>,
}
