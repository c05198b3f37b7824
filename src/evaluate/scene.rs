//! A scene with known poses, and what each method makes of its excerpts.

use crate::align::{self, AlignError, AlignParams, AlignmentState, Target};
use crate::clip::{Clip, ClipError};
use crate::geometry::{Pose2, Vector3, angle_between};
use crate::lidar::{LidarError, LidarMap};
use crate::progress::Progress;
use crate::stopwatch::Stopwatch;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;

/// A recording with true poses, its LiDAR map, and where the map lies in the recording's world.
pub struct Scene {
    pub name: String,
    pub clip: Clip,
    pub lidar: LidarMap,
    pub map_from_world: Pose2,
}

#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    #[error("the recording: {0}")]
    Clip(#[from] ClipError),
    #[error("the LiDAR map: {0}")]
    Lidar(#[from] LidarError),
    #[error("the truth {path}: {cause}; a JSON object with map_from_world {{x_m, y_m, yaw_rad}} is needed")]
    Truth { path: String, cause: String },
    #[error("cancelled")]
    Cancelled,
}

#[derive(Deserialize)]
struct TruthFile {
    map_from_world: Pose2,
}

impl Scene {
    pub fn open(scene: &Path, lidar: &Path, truth: &Path) -> Result<Scene, SceneError> {
        let bad_truth = |cause: String| SceneError::Truth { path: truth.display().to_string(), cause };
        let text = std::fs::read_to_string(truth).map_err(|e| bad_truth(e.to_string()))?;
        let truth: TruthFile = serde_json::from_str(&text).map_err(|e| bad_truth(e.to_string()))?;
        Ok(Scene {
            name: scene.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            clip: Clip::open(scene)?,
            lidar: LidarMap::open(lidar)?,
            map_from_world: truth.map_from_world,
        })
    }

    /// The true pose of the clip that begins with frame `index`; none when that frame has no pose.
    fn map_from_clip(&self, index: usize) -> Option<Pose2> {
        let world_from_camera = self.clip.frames().get(index)?.world_from_camera?;
        let heading = align::heading(&world_from_camera, &Vector3::z());
        let at = world_from_camera.translation.vector;
        Some(self.map_from_world.compose(&Pose2::new(at.x, at.y, heading.y.atan2(heading.x))))
    }
}

/// A way to align a clip: a row of the table.
#[derive(Debug, Clone)]
pub struct Method {
    pub name: String,
    pub params: AlignParams,
}

/// One clip by one method.
#[derive(Debug, Clone, PartialEq)]
pub struct ClipResult {
    pub method: String,
    pub set: String,
    /// Length of the clips in this cell of the table, in frames.
    pub frames: usize,
    pub first_frame: u32,
    pub last_frame: u32,
    pub state: AlignmentState,
    pub probability: Option<f64>,
    /// Infinite when there is no pose.
    pub rotation_error_deg: f64,
    pub translation_error_m: f64,
    pub coverage: f64,
    pub inliers: f64,
    /// Search, refine and decide.
    pub register_seconds: f64,
    /// All stages.
    pub seconds: f64,
}

impl ClipResult {
    /// The paper's success: under 10 degrees and 0.3 m.
    pub fn is_success(&self) -> bool {
        self.rotation_error_deg < 10.0 && self.translation_error_m < 0.3
    }
}

/// Aligns clips, given as places in the scene's frames, by every method, and reports each result with how
/// many of how many are done. What does not depend on the method (fusion, floor, rays) is done once a clip
/// with the first method's parameters.
pub fn evaluate_clips(
    scene: &Scene,
    clips: &[Range<usize>],
    methods: &[Method],
    progress: &dyn Progress,
    mut done: impl FnMut(&ClipResult, usize, usize),
) -> Result<Vec<ClipResult>, SceneError> {
    let Some(first_method) = methods.first() else { return Ok(Vec::new()) };
    let target = Target::new(&scene.lidar);
    let headers = scene.clip.frames();
    let total = clips.len() * methods.len();
    let mut results = Vec::with_capacity(total);
    for range in clips {
        let Some(begin) = range.clone().find(|&i| headers[i].world_from_camera.is_some()) else { continue };
        let Some(truth) = scene.map_from_clip(begin) else { continue };
        let numbers = headers[range.start].number..headers[range.end - 1].number + 1;
        let watch = Stopwatch::around(progress);
        let observation = align::observe(&scene.clip, Some(numbers.clone()), &first_method.params, &watch)
            .map_err(scene_error)?;
        let observe_seconds: f64 = watch.stop().values().sum();
        for method in methods {
            let watch = Stopwatch::around(progress);
            let alignment = align::register(&observation, target.as_ref(), &method.params, &watch)
                .map_err(scene_error)?;
            let register_seconds: f64 = watch.stop().values().sum();
            let error = alignment.map_from_clip.map(|pose| {
                (angle_between(pose.yaw_rad, truth.yaw_rad).to_degrees(), pose.distance_m(&truth))
            });
            let (rotation_error_deg, translation_error_m) = error.unwrap_or((f64::INFINITY, f64::INFINITY));
            results.push(ClipResult {
                method: method.name.clone(),
                set: scene.name.clone(),
                frames: range.len(),
                first_frame: numbers.start,
                last_frame: numbers.end - 1,
                state: alignment.state,
                probability: alignment.probability,
                rotation_error_deg,
                translation_error_m,
                coverage: alignment.coverage.unwrap_or(0.0),
                inliers: alignment.inliers.unwrap_or(0.0),
                register_seconds,
                seconds: observe_seconds + register_seconds,
            });
            done(&results[results.len() - 1], results.len(), total);
        }
    }
    Ok(results)
}

fn scene_error(error: AlignError) -> SceneError {
    match error {
        AlignError::Cancelled => SceneError::Cancelled,
        AlignError::Clip(error) => SceneError::Clip(error),
    }
}
