//! The aligned clips of a simulated home, kept in a folder: they take most of the time.

use super::member::ClipFiles;
use crate::evaluate::{HomesParams, SUCCESS_DEG, SUCCESS_M};
use crate::simulate::{ClipParams, Home, Sensor, Survey};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use viola_align::{AlignError, AlignParams, Alignment, align};
use viola_formats::lidar::{LidarError, LidarMap};
use viola_geometry::Pose2;
use viola_geometry::progress::{Cancelled, Progress};
use viola_home::{ClipContribution, cloud_ply, features_bytes, read_features, views_bytes};

#[derive(Debug, thiserror::Error)]
pub enum ClipsError {
    #[error(transparent)]
    Align(#[from] AlignError),
    #[error("the map of a simulated home: {0}")]
    Lidar(#[from] LidarError),
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    #[error("{path} is not a clip of this evaluation; delete the folder to start again")]
    Damaged { path: PathBuf },
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// A clip aligned by itself, with the truth.
pub(super) struct AlignedClip {
    pub answer: Answer,
    pub files: ClipFiles,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Answer {
    pub alignment: Alignment,
    pub map_from_clip: Pose2,
}

impl AlignedClip {
    /// Returns whether a pose is the paper's success.
    pub fn is_right(&self, pose: &Pose2) -> bool {
        pose.is_within(&self.answer.map_from_clip, SUCCESS_M, SUCCESS_DEG.to_radians())
    }
}

/// Records clips of simulated homes and aligns them.
pub(super) struct Recorder<'a> {
    pub homes: &'a HomesParams,
    pub params: &'a AlignParams,
    /// Folder of the aligned clips.
    pub folder: &'a Path,
    pub progress: &'a dyn Progress,
}

impl Recorder<'_> {
    /// Returns clips of a home, aligned one by one. Those in the folder by `name` are not aligned again.
    pub fn clips(
        &self,
        home: &Home,
        survey: &Survey,
        lidar: &LidarMap,
        name: &str,
        numbers: Range<u64>,
    ) -> Result<Vec<AlignedClip>, ClipsError> {
        let one = |number: u64| -> Result<AlignedClip, ClipsError> {
            let path = self.folder.join(format!("{name}_{number}"));
            if let Some(clip) = read(&path)? {
                return Ok(clip);
            }
            let clip = self.align(home, survey, lidar, number)?;
            write(&path, &clip)?;
            Ok(clip)
        };
        numbers.into_par_iter().map(one).collect()
    }

    /// Returns the parameters of the recordings.
    pub fn recording(&self) -> ClipParams {
        ClipParams {
            frames: self.homes.frames.first().copied().unwrap_or(10),
            color_width: Sensor::PhoneLidar.depth_camera().width,
            drift: self.homes.drift,
            ..ClipParams::default()
        }
    }

    fn align(
        &self,
        home: &Home,
        survey: &Survey,
        lidar: &LidarMap,
        number: u64,
    ) -> Result<AlignedClip, ClipsError> {
        let recorded = Arc::new(home.clip(survey, number, &self.recording()));
        let (clip, params) = self.homes.clip_of(&recorded, home.params.seed, self.params);
        let aligned = align(&clip, None, lidar, &params, self.progress)?;
        // The frames of a simulated clip are numbered from 0.
        let first = aligned.alignment.reference_camera.as_ref().map_or(0, |camera| camera.frame as usize);
        let map_from_clip = recorded.map_from_frame(survey, first);
        Ok(AlignedClip {
            answer: Answer { alignment: aligned.alignment, map_from_clip },
            files: ClipFiles {
                contribution: ClipContribution::new(aligned.cloud_in_clip, aligned.views),
                features: aligned.features,
            },
        })
    }
}

/// Files of a clip; the answer is written last, so it is there only if the others are.
const CLOUD: &str = "ply";
const VIEWS: &str = "views";
const FEATURES: &str = "features";
const ANSWER: &str = "json";

fn read(path: &Path) -> Result<Option<AlignedClip>, ClipsError> {
    let answer = path.with_extension(ANSWER);
    if !answer.exists() {
        return Ok(None);
    }
    let file = |extension: &str| {
        let path = path.with_extension(extension);
        std::fs::read(&path).map_err(|source| ClipsError::File { path, source })
    };
    let damaged = || ClipsError::Damaged { path: answer.clone() };
    let contribution = ClipContribution::read(&file(CLOUD)?, &file(VIEWS)?).map_err(|_| damaged())?;
    let features = read_features(&file(FEATURES)?).map_err(|_| damaged())?;
    let files = ClipFiles { contribution, features };
    let answer = serde_json::from_slice(&file(ANSWER)?).map_err(|_| damaged())?;
    Ok(Some(AlignedClip { answer, files }))
}

fn write(path: &Path, clip: &AlignedClip) -> Result<(), ClipsError> {
    let answer = serde_json::to_vec(&clip.answer).unwrap_or_default();
    let ClipFiles { contribution, features } = &clip.files;
    let files = [
        (CLOUD, cloud_ply(&contribution.cloud_in_clip, None)),
        (VIEWS, views_bytes(&contribution.cloud_in_clip, &contribution.views)),
        (FEATURES, features_bytes(features)),
        (ANSWER, answer),
    ];
    for (extension, bytes) in files {
        let path = path.with_extension(extension);
        std::fs::write(&path, bytes).map_err(|source| ClipsError::File { path, source })?;
    }
    Ok(())
}
