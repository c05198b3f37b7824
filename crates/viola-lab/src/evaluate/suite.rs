//! Sources of clips with ground truth.

use super::RunError;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use viola_align::{AlignParams, Alignment, Observation, Target};
use viola_formats::clip::Clip;
use viola_formats::lidar::LidarMap;
use viola_geometry::{LevelName, Pose2, angle_between};

/// Name of a clip to evaluate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Case {
    /// Unique in its set; part of file names, so only letters, digits, `_` and `-`.
    pub name: String,
    /// Data set: a row of the table.
    pub set: String,
    /// Length of the clips in this row, in frames.
    pub frames: usize,
}

/// A clip and its map, as methods get them, with the truth.
pub struct Sample {
    pub observation: Observation,
    pub lidar: Arc<LidarMap>,
    /// None if the map has no occupied point.
    pub target: Option<Arc<Target>>,
    /// The level of `target`.
    pub level: LevelName,
    /// Maps of the home's other levels.
    pub other_levels: Vec<Arc<Target>>,
    pub map_from_clip: Pose2,
    /// All poses that fit the clip's content as well as the true one, which is included. More than one means
    /// that the clip is unknowable.
    pub equivalent_poses: Vec<Pose2>,
    /// True metres per unit of a clip whose unit was withheld.
    pub scale: Option<f64>,
    /// Numbers of the first and the last frame.
    pub first_frame: u32,
    pub last_frame: u32,
}

impl Sample {
    /// Returns the maps of all levels of the home.
    pub fn targets(&self) -> Vec<&Target> {
        self.target.iter().chain(&self.other_levels).map(Arc::as_ref).collect()
    }

    /// Returns whether an answer is the paper's success: under 10 degrees and 0.3 m.
    pub fn is_success(&self, alignment: &Alignment) -> bool {
        let pose = alignment.map_from_clip.filter(|_| alignment.level == self.level);
        pose.as_ref().is_some_and(|pose| {
            let (rotation_deg, translation_m) = self.errors(pose);
            rotation_deg < 10.0 && translation_m < 0.3
        })
    }

    /// Returns the errors of a pose on the true level, in degrees and metres.
    pub fn errors(&self, pose: &Pose2) -> (f64, f64) {
        let truth = &self.map_from_clip;
        (angle_between(pose.yaw_rad, truth.yaw_rad).to_degrees(), pose.distance_m(truth))
    }
}

/// Returns the clip in a unit between 0.2 and 5 m, drawn by `seed`, and the metres of this unit.
pub(super) fn without_metres(clip: &Clip, seed: u64) -> (Clip, f64) {
    let widest = 5f64.ln();
    let metres = ChaCha8Rng::seed_from_u64(seed).random_range(-widest..widest).exp();
    (clip.scaled(1.0 / metres).with_unknown_scale(), metres)
}

/// Clips with their truth, made one at a time by several threads.
pub trait Suite: Sync {
    fn cases(&self) -> &[Case];

    /// Describes everything that the samples depend on; old results with another fingerprint are ignored.
    fn fingerprint(&self) -> String;

    /// Returns `cases()[index]`, observed with `params`; none if the data has no truth for it.
    fn sample(
        &self,
        index: usize,
        params: &AlignParams,
        progress: &dyn viola_geometry::progress::Progress,
    ) -> Result<Option<Sample>, RunError>;
}
