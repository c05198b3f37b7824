//! The work of one job: open the clip and the maps, align, make the pictures.

use bytes::Bytes;
use std::path::Path;
use viola_align as align;
use viola_align::{AlignError, AlignParams, Alignment, AlignmentState, LevelMap};
use viola_formats::clip::{Clip, ClipError};
use viola_formats::container::Scratch;
use viola_formats::lidar::{LidarError, LidarMap};
use viola_formats::video;
use viola_geometry::LevelName;
use viola_geometry::progress::{Progress, Stage};
use viola_geometry::stopwatch::Stopwatch;
use viola_home as home;
use viola_reconstruct::Reason;
use viola_storage::result_file;

/// The LiDAR map's file of one level.
pub struct LevelFile {
    pub level: LevelName,
    pub bytes: Bytes,
}

/// Result of one job.
pub struct Finished {
    pub alignment: Alignment,
    /// Files by the names of [`viola_storage::result_file`].
    pub files: Vec<(&'static str, Vec<u8>)>,
}

/// Reason why a job has no result.
#[derive(Debug, thiserror::Error)]
pub enum AlignJobError {
    #[error("the work was cancelled")]
    Cancelled,
    #[error(transparent)]
    Clip(#[from] ClipError),
    #[error(transparent)]
    Lidar(#[from] LidarError),
}

impl From<AlignError> for AlignJobError {
    fn from(error: AlignError) -> AlignJobError {
        match error {
            AlignError::Cancelled => AlignJobError::Cancelled,
            AlignError::Clip(error) => AlignJobError::Clip(error),
        }
    }
}

impl AlignJobError {
    /// Returns whether the machine is at fault and not the files: then the attempt does not count.
    pub fn is_service_fault(&self) -> bool {
        match self {
            AlignJobError::Cancelled => false,
            AlignJobError::Clip(error) => error.is_service_fault(),
            AlignJobError::Lidar(error) => error.is_service_fault(),
        }
    }

    /// Returns the reason for the clip's owner.
    pub fn reason(&self) -> Reason {
        let code = match self {
            AlignJobError::Cancelled => "cancelled",
            AlignJobError::Clip(error) => error.code(),
            AlignJobError::Lidar(error) => error.code(),
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
    /// Place for unpacked archives.
    pub scratch: Scratch,
    /// True if the sender of the clip says that its unit is unknown.
    pub unknown_scale: bool,
}

/// Aligns the clip of a file to the maps of its home.
pub fn align_clip(
    clip_path: &Path,
    files: &[LevelFile],
    params: &JobParams,
    progress: &dyn Progress,
) -> Result<Finished, AlignJobError> {
    let watch = start(&params.align, progress);
    let clip = Clip::open_in(clip_path, &params.video, &params.scratch)?;
    let clip = if params.unknown_scale { clip.with_unknown_scale() } else { clip };
    let read = |file: &LevelFile| Ok((file.level, LidarMap::read(&file.bytes)?));
    let maps: Vec<(LevelName, LidarMap)> = files.iter().map(read).collect::<Result<_, LidarError>>()?;
    finish(&clip, &level_maps(&maps), &params.align, watch)
}

/// Returns the maps as the method takes them.
pub fn level_maps(maps: &[(LevelName, LidarMap)]) -> Vec<LevelMap<'_>> {
    maps.iter().map(|(level, lidar)| LevelMap { level: *level, lidar }).collect()
}

/// Aligns an opened clip to opened maps.
pub fn align_opened(
    clip: &Clip,
    levels: &[LevelMap],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Finished, AlignJobError> {
    finish(clip, levels, params, start(params, progress))
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
    levels: &[LevelMap],
    params: &AlignParams,
    watch: Stopwatch,
) -> Result<Finished, AlignJobError> {
    let mut aligned = align::align_levels(clip, None, levels, params, &watch)?;

    watch.enter(Stage::Report);
    let chosen = levels.iter().find(|map| map.level == aligned.alignment.level).or(levels.first());
    let mut files = vec![
        // In the clip's own frame: its pose in the map changes with its neighbours and with a choice.
        (result_file::CLOUD, home::cloud_ply(&aligned.cloud_in_clip, None)),
        (result_file::VIEWS, home::views_bytes(&aligned.cloud_in_clip, &aligned.views)),
        (result_file::FEATURES, home::features_bytes(&aligned.features)),
        (result_file::SCAN, serde_json::to_vec(&home::ClipScan::of(&aligned)).unwrap_or_default()),
    ];
    files.extend(chosen.map(|map| (result_file::OVERLAY, home::overlay_png(map.lidar, &aligned))));
    files.extend(home::completion_png(&aligned).map(|png| (result_file::COMPLETION, png)));
    let pictures = home::frame_pictures(clip);
    files.extend(pictures.thumbnail.map(|jpg| (result_file::THUMBNAIL, jpg)));
    if aligned.alignment.state != AlignmentState::Aligned {
        files.extend(pictures.row.map(|jpg| (result_file::FRAMES, jpg)));
    }
    aligned.alignment.seconds = watch.stop();
    Ok(Finished { alignment: aligned.alignment, files })
}
