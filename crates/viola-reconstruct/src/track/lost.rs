//! Reasons why a frame cannot be tracked.

use super::picture::Pyramid;
use serde::{Deserialize, Serialize};

/// Reason why a segment ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case", tag = "why")]
pub enum Lost {
    #[error("the depth camera gave almost no reading; it saw too near, too far, or glass")]
    NoDepth,
    #[error("the picture is dark; switch on the light")]
    Dark,
    #[error("the pictures do not tell the motion of the camera: a bare wall or floor filled them")]
    Unconstrained,
    #[error(
        "the picture does not continue the one before: the camera moved too fast, or the recording was cut"
    )]
    Jump,
}

/// Minimum fraction of the picture with depth.
const MIN_DEPTH_FRACTION: f64 = 0.08;
/// Mean grey below which a picture is dark.
const DARK: f32 = 0.02;

impl Lost {
    /// Returns the fault of a frame by itself; `None` if it can be tracked.
    pub(super) fn of(pyramid: &Pyramid) -> Option<Lost> {
        let Some(layer) = pyramid.layers.get(1).or(pyramid.layers.first()) else {
            return Some(Lost::NoDepth);
        };
        let known = layer.depth_m.iter().filter(|depth| **depth > 0.0).count();
        if (known as f64) < MIN_DEPTH_FRACTION * layer.depth_m.len() as f64 {
            return Some(Lost::NoDepth);
        }
        let seen = layer.grey.iter().filter(|grey| grey.is_finite());
        let (sum, count) = seen.fold((0.0, 0usize), |(sum, count), grey| (sum + grey, count + 1));
        // Depth alone can track in the dark, but its errors would go unnoticed.
        (sum < DARK * count as f32).then_some(Lost::Dark)
    }

    /// Returns the stable name, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Lost::NoDepth => "track_no_depth",
            Lost::Dark => "track_dark",
            Lost::Unconstrained => "track_unconstrained",
            Lost::Jump => "track_jump",
        }
    }
}
