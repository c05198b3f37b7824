//! Errors of an evaluation.

use super::survey::SurveyError;
use crate::mesh::MeshError;
use std::path::PathBuf;
use viola_align::AlignError;
use viola_formats::clip::ClipError;
use viola_formats::lidar::LidarError;
use viola_geometry::progress::Cancelled;

#[derive(Debug, thiserror::Error)]
pub enum RunError {
    #[error("cancelled")]
    Cancelled,
    #[error("clip {clip}: {source}")]
    Align { clip: String, source: AlignError },
    #[error("the map of simulated home {home}: {source}")]
    Map { home: u64, source: LidarError },
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Drawn(#[from] DrawnError),
    #[error(transparent)]
    Journal(#[from] JournalError),
    #[error("cannot write {path}: {source}")]
    Picture { path: PathBuf, source: std::io::Error },
    #[error("cannot start a worker: {0}")]
    Worker(#[from] rayon::ThreadPoolBuildError),
}

impl RunError {
    /// Wraps the error of a clip that could not be observed or aligned.
    pub(super) fn of_clip(clip: &str, error: AlignError) -> RunError {
        match error {
            AlignError::Cancelled => RunError::Cancelled,
            source => RunError::Align { clip: clip.to_owned(), source },
        }
    }
}

impl From<Cancelled> for RunError {
    fn from(_: Cancelled) -> RunError {
        RunError::Cancelled
    }
}

#[derive(Debug, thiserror::Error)]
pub enum DrawnError {
    #[error("{path}: {source}")]
    Lidar { path: String, source: LidarError },
    #[error("{path}: the map does not say which cells are free, so nobody can walk in it")]
    NoCells { path: String },
    #[error("{path}: no place in the map is free and sees enough of its walls")]
    NoPlace { path: String },
}

#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    #[error("the recording: {0}")]
    Clip(#[from] ClipError),
    #[error("the LiDAR map: {0}")]
    Lidar(#[from] LidarError),
    #[error("the truth {path}: {cause}; a JSON object with map_from_world {{x_m, y_m, yaw_rad}} is needed")]
    Truth { path: String, cause: String },
    #[error("the mesh: {0}")]
    Mesh(#[from] MeshError),
    #[error("the LiDAR map from the mesh: {0}")]
    Survey(#[from] SurveyError),
    #[error("the recording's world is not known to be upright, so a map cannot be cut out of its mesh")]
    NotUpright,
    #[error("the recording does not tell which way is up in its world, so the truth cannot be compared")]
    UnknownUp,
}

#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    #[error("{path}, line {line}: {source}; delete the file to start again")]
    Damaged { path: PathBuf, line: usize, source: serde_json::Error },
}
