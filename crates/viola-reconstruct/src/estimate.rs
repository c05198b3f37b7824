//! Estimates the work for a clip before any of its pictures is decoded.

use super::fuse::choose;
use serde::{Deserialize, Serialize};
use viola_formats::clip::Clip;

/// Costs in seconds, measured on two cores of a server (BENCHMARKS.md).
const SECONDS_A_JOB: f64 = 0.4;
const SECONDS_A_KEY_FRAME: f64 = 0.006;
/// For each million pixels of a key frame, colour or depth.
const SECONDS_A_MEGAPIXEL: f64 = 0.012;
/// For each million pixels of a video frame. All frames are decoded, because key frames depend on them.
const SECONDS_A_MEGAPIXEL_OF_VIDEO: f64 = 0.013;

/// For each frame of a clip without poses, whose camera is tracked by its pictures.
const SECONDS_A_TRACKED_FRAME: f64 = 0.025;

/// Estimated cost of aligning a clip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Frames that will be decoded and fused; all frames if the clip has no poses.
    pub key_frames: usize,
    /// Seconds on two cores without a network or completion. Excludes the wait for other jobs.
    pub seconds: f64,
}

/// Estimates the cost from the number of frames and their sizes.
pub fn estimate(clip: &Clip) -> Estimate {
    let info = clip.info();
    let megapixels = |width: u32, height: u32| f64::from(width) * f64::from(height) * 1e-6;
    let color = megapixels(info.color_width, info.color_height);
    let depth = megapixels(info.depth_width, info.depth_height);
    let is_tracked = info.frames_with_pose == 0;
    // The camera's motion is unknown before tracking.
    let key_frames = if is_tracked { info.frames } else { choose(clip, None, None).len() };
    let a_key_frame = SECONDS_A_KEY_FRAME + SECONDS_A_MEGAPIXEL * (color + depth);
    let video =
        if clip.has_video() { info.frames as f64 * color * SECONDS_A_MEGAPIXEL_OF_VIDEO } else { 0.0 };
    let tracking = if is_tracked { info.frames as f64 * SECONDS_A_TRACKED_FRAME } else { 0.0 };
    let seconds = SECONDS_A_JOB + key_frames as f64 * a_key_frame + video + tracking;
    Estimate { key_frames, seconds: (seconds * 10.0).round() / 10.0 }
}
