//! Where clips with a known truth come from.

use super::RunError;
use std::sync::Arc;
use viola_align::{AlignParams, Alignment, Observation, Target};
use viola_formats::lidar::LidarMap;
use viola_geometry::{Pose2, angle_between};

/// A clip that can be evaluated, by name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Case {
    /// Names the clip among all of its set; part of file names, so in letters, digits, `_` and `-`.
    pub name: String,
    /// Which data: a row of the table.
    pub set: String,
    /// Length of the clips in this row, in frames.
    pub frames: usize,
}

/// A clip and its map as the methods get them, and the truth.
pub struct Sample {
    pub observation: Observation,
    pub lidar: Arc<LidarMap>,
    /// None when the map has no occupied point.
    pub target: Option<Arc<Target>>,
    pub map_from_clip: Pose2,
    /// All poses that nobody could tell from the true one by what the clip shows, the true one included.
    /// More than one: the clip is unknowable.
    pub equivalent_poses: Vec<Pose2>,
    /// Numbers of the first and the last frame.
    pub first_frame: u32,
    pub last_frame: u32,
}

impl Sample {
    /// Whether an answer is right: the paper's success, under 10 degrees and 0.3 m.
    pub fn is_success(&self, alignment: &Alignment) -> bool {
        alignment.map_from_clip.as_ref().is_some_and(|pose| {
            let (rotation_deg, translation_m) = self.errors(pose);
            rotation_deg < 10.0 && translation_m < 0.3
        })
    }

    /// Degrees and metres between a pose and the true one.
    pub fn errors(&self, pose: &Pose2) -> (f64, f64) {
        let truth = &self.map_from_clip;
        (angle_between(pose.yaw_rad, truth.yaw_rad).to_degrees(), pose.distance_m(truth))
    }
}

/// Clips with their truth, made one at a time by several threads at once.
pub trait Suite: Sync {
    fn cases(&self) -> &[Case];

    /// Everything that the samples depend on, in words: when it changes, old results do not count.
    fn fingerprint(&self) -> String;

    /// Makes `cases()[index]`, observed with `params`; none when the data has no truth for it.
    fn sample(
        &self,
        index: usize,
        params: &AlignParams,
        progress: &dyn viola_geometry::progress::Progress,
    ) -> Result<Option<Sample>, RunError>;
}
