//! How much work a clip will be, before any of its pictures is decoded.

use super::fuse::choose;
use serde::{Deserialize, Serialize};
use viola_formats::clip::Clip;

/// What was measured on two cores of a server (BENCHMARKS.md), in seconds.
const SECONDS_A_JOB: f64 = 0.4;
const SECONDS_A_KEY_FRAME: f64 = 0.006;
/// For a million pixels of a key frame, colour or depth.
const SECONDS_A_MEGAPIXEL: f64 = 0.012;
/// For a million pixels of a video's frame: all frames are decoded, for those between lead to the key frames.
const SECONDS_A_MEGAPIXEL_OF_VIDEO: f64 = 0.013;

/// A frame of a clip without poses, which is followed by its pictures.
const SECONDS_A_TRACKED_FRAME: f64 = 0.025;

/// What aligning a clip will take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Estimate {
    /// Frames that will be decoded and fused; all of them where the clip has no poses.
    #[schema(example = 118)]
    pub key_frames: usize,
    /// Seconds on two cores without a network and without completion; waiting for other jobs is not counted.
    #[schema(example = 3.2)]
    pub seconds: f64,
}

/// Counts the key frames and multiplies.
pub fn estimate(clip: &Clip) -> Estimate {
    let info = clip.info();
    let megapixels = |width: u32, height: u32| f64::from(width) * f64::from(height) * 1e-6;
    let color = megapixels(info.color_width, info.color_height);
    let depth = megapixels(info.depth_width, info.depth_height);
    let is_tracked = info.frames_with_pose == 0;
    // How far the camera moves is not known before it was tracked.
    let key_frames = if is_tracked { info.frames } else { choose(clip, None, None).len() };
    let a_key_frame = SECONDS_A_KEY_FRAME + SECONDS_A_MEGAPIXEL * (color + depth);
    let video =
        if clip.has_video() { info.frames as f64 * color * SECONDS_A_MEGAPIXEL_OF_VIDEO } else { 0.0 };
    let tracking = if is_tracked { info.frames as f64 * SECONDS_A_TRACKED_FRAME } else { 0.0 };
    let seconds = SECONDS_A_JOB + key_frames as f64 * a_key_frame + video + tracking;
    Estimate { key_frames, seconds: (seconds * 10.0).round() / 10.0 }
}
