//! The work of one job: open the clip and the map, align, make the pictures.

use crate::align::{Alignment, Reason};
use crate::progress::Progress;
use std::path::Path;

/// What one job makes.
pub struct Finished {
    pub alignment: Alignment,
    pub overlay_png: Vec<u8>,
    pub cloud_ply: Vec<u8>,
}

/// Why a job made nothing.
#[derive(Debug)]
pub enum Failure {
    /// Somebody asked to stop.
    Cancelled,
    /// The clip or the map cannot be used; the reason is for whoever sent it.
    Refused(Reason),
}

// ---- stand-in until the method lands; its body is replaced at the merge ----
pub fn align_clip(
    clip_path: &Path,
    lidar_bytes: &[u8],
    seed: u64,
    progress: &dyn Progress,
) -> Result<Finished, Failure> {
    use crate::align::AlignmentState;
    use crate::progress::{Stage, check};
    let refused = |code: &str, detail: String| Failure::Refused(Reason { code: code.to_owned(), detail });
    crate::clip::Clip::open(clip_path).map_err(|error| refused(error.code(), error.to_string()))?;
    let lidar = crate::lidar::LidarMap::read(lidar_bytes)
        .map_err(|error| refused(error.code(), error.to_string()))?;
    for stage in Stage::ALL {
        progress.enter(stage);
        for step in 0..20 {
            check(progress).map_err(|_| Failure::Cancelled)?;
            std::thread::sleep(std::time::Duration::from_millis(15));
            progress.advance(f64::from(step) / 20.0);
        }
    }
    let map_from_clip = crate::geometry::Pose2::new(1.0, seed as f64, 0.0);
    let alignment = Alignment {
        state: AlignmentState::Aligned,
        probability: None,
        map_from_clip: Some(map_from_clip),
        covariance: None,
        loss_m: None,
        inliers: None,
        coverage: None,
        alternatives: vec![],
        reasons: vec![],
        hits: 0,
        key_frames: 0,
        floor: None,
        seconds: Default::default(),
    };
    Ok(Finished {
        alignment,
        overlay_png: crate::home::lidar_png(&lidar),
        cloud_ply: b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n".to_vec(),
    })
}
