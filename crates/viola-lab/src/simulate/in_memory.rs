//! Simulated recordings as clips without files.

use super::clip::SimulatedClip;
use std::sync::Arc;
use viola_formats::clip::{Clip, ClipInfo, Frame};
use viola_geometry::Vector3;

impl SimulatedClip {
    /// Returns the recording as a clip; frames are rendered on demand.
    pub fn into_clip(self) -> Clip {
        clip_in_memory(Arc::new(self))
    }
}

/// Returns a shared recording as a clip.
pub fn clip_in_memory(recorded: Arc<SimulatedClip>) -> Clip {
    clip_in_memory_heard(recorded, |_, _| ())
}

/// Returns a shared recording as a clip; `hear` is called for each rendered frame.
pub fn clip_in_memory_heard(
    recorded: Arc<SimulatedClip>,
    hear: impl Fn(usize, &Frame) + Send + Sync + 'static,
) -> Clip {
    let (color, depth) = (recorded.color_camera, recorded.depth_camera);
    let frames = recorded.headers().to_vec();
    let posed = frames.iter().filter(|frame| frame.world_from_camera.is_some()).count();
    let info = ClipInfo {
        layout: "simulated".into(),
        pose_convention: "camera-to-world, OpenCV (x right, y down, z forward)".into(),
        depth_unit: "metres".into(),
        gravity: "world z is up".into(),
        intrinsics: "exact".into(),
        frames_with_pose: posed,
        skipped_without_pose: frames.len() - posed,
        duration_s: frames.last().and_then(|last| last.time_s),
        ..ClipInfo::in_memory(frames.len(), [color.width, color.height], [depth.width, depth.height])
    };
    Clip::from_frames(info, frames, Some(Vector3::z()), move |index| {
        let frame = recorded.frame(index);
        hear(index, &frame);
        frame
    })
}
