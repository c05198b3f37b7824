//! The aligned clips of a simulated home, kept in a folder: they take most of the time.

use super::super::member::Share;
use super::JointError;
use crate::evaluate::HomesParams;
use crate::simulate::{ClipParams, Home, HomeParams, Set, valetudo_json};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;
use viola_align::{AlignParams, Alignment, align};
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Progress;
use viola_geometry::{Pose2, angle_between};
use viola_home::{ClipContribution, cloud_ply, features_bytes, read_features, views_bytes};

/// A clip aligned by itself, with the truth.
pub(super) struct AlignedClip {
    pub answer: Answer,
    pub share: Share,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Answer {
    pub alignment: Alignment,
    pub map_from_clip: Pose2,
}

impl AlignedClip {
    /// Returns whether a pose is under 10 degrees and 0.3 m from the truth.
    pub fn is_right(&self, pose: &Pose2) -> bool {
        let truth = &self.answer.map_from_clip;
        pose.distance_m(truth) < 0.3 && angle_between(pose.yaw_rad, truth.yaw_rad) < 10f64.to_radians()
    }
}

/// Returns the clips of a home, aligned one by one. Those in `folder` are not aligned again.
pub(super) fn clips(
    set: Set,
    seed: u64,
    homes: &HomesParams,
    params: &AlignParams,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Vec<AlignedClip>, JointError> {
    let home = Home::generate(&HomeParams::new(set, seed));
    let survey = home.survey();
    let lidar = LidarMap::read(valetudo_json(&survey).to_string().as_bytes())?;
    let one = |number: u64| -> Result<AlignedClip, JointError> {
        let path = folder.join(format!("{}_{seed}_{number}", set.name()));
        if let Some(clip) = read(&path)? {
            return Ok(clip);
        }
        let recording = ClipParams {
            frames: homes.frames.first().copied().unwrap_or(10),
            sensor: homes.sensor,
            color_width: homes.sensor.depth_camera().width,
            drift: homes.drift,
            ..ClipParams::default()
        };
        let recorded = home.clip(&survey, number, &recording);
        let map_from_clip = recorded.truth.map_from_clip;
        let aligned = align(&recorded.into_clip(), None, &lidar, params, progress)?;
        let clip = AlignedClip {
            answer: Answer { alignment: aligned.alignment, map_from_clip },
            share: Share {
                contribution: ClipContribution::new(aligned.cloud_in_clip, aligned.views),
                features: aligned.features,
            },
        };
        write(&path, &clip)?;
        Ok(clip)
    };
    (0..homes.clips_per_home).into_par_iter().map(one).collect()
}

/// Files of a clip; the answer is written last, so it is there only if the others are.
const CLOUD: &str = "ply";
const VIEWS: &str = "views";
const FEATURES: &str = "features";
const ANSWER: &str = "json";

fn read(path: &Path) -> Result<Option<AlignedClip>, JointError> {
    let answer = path.with_extension(ANSWER);
    if !answer.exists() {
        return Ok(None);
    }
    let file = |extension: &str| {
        let path = path.with_extension(extension);
        std::fs::read(&path).map_err(|source| JointError::File { path, source })
    };
    let damaged = || JointError::Damaged { path: answer.clone() };
    let contribution = ClipContribution::read(&file(CLOUD)?, &file(VIEWS)?).map_err(|_| damaged())?;
    let features = read_features(&file(FEATURES)?).map_err(|_| damaged())?;
    let share = Share { contribution, features };
    let answer = serde_json::from_slice(&file(ANSWER)?).map_err(|_| damaged())?;
    Ok(Some(AlignedClip { answer, share }))
}

fn write(path: &Path, clip: &AlignedClip) -> Result<(), JointError> {
    let answer = serde_json::to_vec(&clip.answer).unwrap_or_default();
    let files = [
        (CLOUD, cloud_ply(&clip.share.contribution.cloud_in_clip, None)),
        (VIEWS, views_bytes(&clip.share.contribution.views)),
        (FEATURES, features_bytes(&clip.share.features)),
        (ANSWER, answer),
    ];
    for (extension, bytes) in files {
        let path = path.with_extension(extension);
        std::fs::write(&path, bytes).map_err(|source| JointError::File { path, source })?;
    }
    Ok(())
}
