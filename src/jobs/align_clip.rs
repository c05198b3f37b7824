//! The work of one job: open the clip and the map, align, make the pictures.

use crate::storage::result_file;
use std::path::Path;
use viola_align as align;
use viola_align::{AlignError, AlignParams, Alignment};
use viola_formats::clip::{Clip, ClipError};
use viola_formats::lidar::{LidarError, LidarMap};
use viola_formats::video;
use viola_geometry::progress::{Progress, Stage};
use viola_geometry::stopwatch::Stopwatch;
use viola_home as home;
use viola_reconstruct::Reason;

/// Result of one job.
pub struct Finished {
    pub alignment: Alignment,
    /// Files by the names of [`crate::storage::result_file`].
    pub files: Vec<(&'static str, Vec<u8>)>,
}

/// Reason why a job has no result.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    #[error("the work was cancelled")]
    Cancelled,
    #[error(transparent)]
    Clip(#[from] ClipError),
    #[error(transparent)]
    Lidar(#[from] LidarError),
}

impl From<AlignError> for Failure {
    fn from(error: AlignError) -> Failure {
        match error {
            AlignError::Cancelled => Failure::Cancelled,
            AlignError::Clip(error) => Failure::Clip(error),
        }
    }
}

impl Failure {
    /// Returns whether the machine is at fault and not the files: then the attempt does not count.
    pub fn is_ours(&self) -> bool {
        match self {
            Failure::Cancelled => false,
            Failure::Clip(error) => error.is_ours(),
            Failure::Lidar(error) => error.is_ours(),
        }
    }

    /// Returns the reason for the clip's owner.
    pub fn reason(&self) -> Reason {
        let code = match self {
            Failure::Cancelled => "cancelled",
            Failure::Clip(error) => error.code(),
            Failure::Lidar(error) => error.code(),
        };
        Reason::new(code, self.to_string())
    }
}

/// Parameters of a job, beside its files.
#[derive(Debug, Clone, Default)]
pub struct JobParams {
    pub align: AlignParams,
    /// Decoders of clips' videos.
    pub video: video::Tools,
}

/// Aligns the clip of a file to the map of a file.
pub fn align_clip(
    clip_path: &Path,
    lidar_bytes: &[u8],
    params: &JobParams,
    progress: &dyn Progress,
) -> Result<Finished, Failure> {
    let watch = start(&params.align, progress);
    let clip = Clip::open_with(clip_path, &params.video)?;
    let lidar = LidarMap::read(lidar_bytes)?;
    finish(&clip, &lidar, &params.align, watch)
}

/// Aligns an opened clip to an opened map.
pub fn align_opened(
    clip: &Clip,
    lidar: &LidarMap,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Finished, Failure> {
    finish(clip, lidar, params, start(params, progress))
}

/// Starts the first stage, with the time budgets of the method.
fn start<'a>(params: &AlignParams, progress: &'a dyn Progress) -> Stopwatch<'a> {
    let watch = Stopwatch::around(progress, std::time::Instant::now)
        .with_budget(Stage::Complete, params.complete.time);
    watch.enter(Stage::Decode);
    watch
}

fn finish(
    clip: &Clip,
    lidar: &LidarMap,
    params: &AlignParams,
    watch: Stopwatch,
) -> Result<Finished, Failure> {
    let mut aligned = align::align(clip, None, lidar, params, &watch)?;

    watch.enter(Stage::Report);
    let mut files = vec![
        (result_file::OVERLAY, home::overlay_png(lidar, &aligned)),
        // In the clip's own frame: its pose in the map changes with its neighbours and with a choice.
        (result_file::CLOUD, home::cloud_ply(&aligned.cloud_in_clip, None)),
        (result_file::VIEWS, home::views_bytes(&aligned.views)),
        (result_file::FEATURES, home::features_bytes(&aligned.features)),
        (result_file::SCAN, serde_json::to_vec(&home::ClipScan::of(&aligned)).unwrap_or_default()),
    ];
    files.extend(home::completion_png(&aligned).map(|png| (result_file::COMPLETION, png)));
    aligned.alignment.seconds = watch.stop();
    Ok(Finished { alignment: aligned.alignment, files })
}
