//! Why a frame cannot be followed.

use super::picture::Pyramid;
use serde::{Deserialize, Serialize};

/// Why a segment ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case", tag = "why")]
pub enum Lost {
    #[error("the depth camera gave almost no reading; it saw too near, too far, or glass")]
    NoDepth,
    #[error("the picture is dark; switch on the light")]
    Dark,
    #[error("what the camera saw does not tell where it moved: a bare wall or floor filled the picture")]
    Unconstrained,
    #[error(
        "the picture does not continue the one before: the camera moved too fast, or the recording was cut"
    )]
    Jump,
}

/// Less of the picture than this has depth.
const LEAST_DEPTH: f64 = 0.08;
/// Grey of which a picture has less than this is dark.
const DARK: f32 = 0.02;

impl Lost {
    /// What is wrong with a frame by itself.
    pub(super) fn of(pyramid: &Pyramid) -> Option<Lost> {
        let Some(layer) = pyramid.layers.get(1).or(pyramid.layers.first()) else {
            return Some(Lost::NoDepth);
        };
        let known = layer.depth_m.iter().filter(|depth| **depth > 0.0).count();
        if (known as f64) < LEAST_DEPTH * layer.depth_m.len() as f64 {
            return Some(Lost::NoDepth);
        }
        let seen = layer.grey.iter().filter(|grey| grey.is_finite());
        let (sum, count) = seen.fold((0.0, 0usize), |(sum, count), grey| (sum + grey, count + 1));
        // Depth alone can follow where it is dark, but then nothing tells whether it does so rightly.
        (sum < DARK * count as f32).then_some(Lost::Dark)
    }

    /// Stable name, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Lost::NoDepth => "track_no_depth",
            Lost::Dark => "track_dark",
            Lost::Unconstrained => "track_unconstrained",
            Lost::Jump => "track_jump",
        }
    }
}
