//! A recorded RGB-D clip: what was understood of it, and its frames, one at a time.
//!
//! [`Clip::open`] finds the layout by content, reads the small text files (poses, intrinsics, indices) and
//! keeps them; pictures stay in their container until [`Clip::load`] asks for one, so memory does not grow
//! with the clip's length beyond a hundred bytes a frame.

use crate::geometry::{Pinhole, Pose3, Vector3};
use serde::{Deserialize, Serialize};

/// What was understood of a clip, told to whoever sent it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct ClipInfo {
    /// Layout by name: `scannet`, `seven_scenes`, `tum_rgbd`.
    pub layout: String,
    /// Direction and camera axes of the poses as the files have them, for example
    /// `camera-to-world, OpenCV (x right, y down, z forward)`.
    pub pose_convention: String,
    /// Unit of the depth pictures, for example `millimetres (16-bit PNG)`.
    pub depth_unit: String,
    /// Which way is up and how it is known, for example `world z (layout)` or `unknown`.
    pub gravity: String,
    /// Where the intrinsics come from.
    pub intrinsics: String,
    /// Frames with both pictures.
    pub frames: usize,
    /// Frames with a finite pose.
    pub frames_with_pose: usize,
    /// Frames left out because their pose is missing or not finite.
    pub skipped_without_pose: usize,
    /// Frames left out because one of their pictures is missing.
    pub skipped_incomplete: usize,
    pub color_width: u32,
    pub color_height: u32,
    pub depth_width: u32,
    pub depth_height: u32,
    /// Seconds from the first to the last frame, when the layout has times.
    pub duration_s: Option<f64>,
    /// Anything else worth telling: assumptions made, files ignored.
    pub notes: Vec<String>,
}

/// What is known of a frame without decoding its pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameHeader {
    /// The number that the layout gives the frame; `--frames` counts in it.
    pub number: u32,
    pub time_s: Option<f64>,
    /// Finite, with a unit rotation; none where the capture has none.
    pub world_from_camera: Option<Pose3>,
}

/// A decoded frame. The colour camera and the depth camera share one pose.
#[derive(Debug, Clone)]
pub struct Frame {
    pub header: FrameHeader,
    pub color_camera: Pinhole,
    pub color: image::RgbImage,
    pub depth_camera: Pinhole,
    pub depth: DepthImage,
}

/// Metric depth along z, row after row from the top; 0 where there is no reading.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    pub width: u32,
    pub height: u32,
    pub depth_m: Vec<f32>,
}

impl DepthImage {
    pub fn at(&self, x: u32, y: u32) -> f32 {
        self.depth_m[(y * self.width + x) as usize]
    }
}

/// Why a clip is refused or cannot be read on.
#[derive(Debug, thiserror::Error)]
pub enum ClipError {}
