//! Sources of clips with ground truth.

use super::{RunError, SUCCESS_DEG, SUCCESS_M};
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
    /// The true pose; none if the map is of another home.
    pub map_from_clip: Option<Pose2>,
    /// True if the clip's content fits the map equally well in several places; none if that is unknown.
    pub unknowable: Option<bool>,
    /// True if the clip shows the floor, by the truth; none if that is unknown.
    pub floor_in_sight: Option<bool>,
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

    /// Returns whether a pose on a level is the paper's success.
    pub fn is_right(&self, level: LevelName, pose: &Pose2) -> bool {
        let errors = self.errors(pose).filter(|_| level == self.level);
        errors.is_some_and(|(rotation_deg, translation_m)| {
            rotation_deg < SUCCESS_DEG && translation_m < SUCCESS_M
        })
    }

    /// Returns whether an answer is the paper's success.
    pub fn is_success(&self, alignment: &Alignment) -> bool {
        alignment.map_from_clip.is_some_and(|pose| self.is_right(alignment.level, &pose))
    }

    /// Returns the errors of a pose on the true level, in degrees and metres; none without a true pose.
    pub fn errors(&self, pose: &Pose2) -> Option<(f64, f64)> {
        let truth = self.map_from_clip.as_ref()?;
        Some((angle_between(pose.yaw_rad, truth.yaw_rad).to_degrees(), pose.distance_m(truth)))
    }
}

/// The unit of a clip's poses and depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unit {
    Metres,
    /// A unit between 0.2 and 5 m, drawn for each clip, which the clip does not tell.
    Withheld,
    /// So many times the metres that the clip tells.
    Wrong(f64),
}

impl Unit {
    /// Returns the clip in this unit, and the metres of a withheld unit.
    pub(super) fn applied(self, clip: Clip, seed: u64) -> (Clip, Option<f64>) {
        match self {
            Unit::Metres => (clip, None),
            Unit::Wrong(factor) => (clip.scaled(factor), None),
            Unit::Withheld => {
                let widest = 5f64.ln();
                let metres = ChaCha8Rng::seed_from_u64(seed).random_range(-widest..widest).exp();
                (clip.scaled(1.0 / metres).with_unknown_scale(), Some(metres))
            }
        }
    }

    /// Returns the part of a fingerprint for this unit.
    pub(super) fn fingerprint(self) -> String {
        match self {
            Unit::Metres => String::new(),
            Unit::Withheld => " without metres".to_owned(),
            Unit::Wrong(factor) => format!(" times {factor}"),
        }
    }
}

/// Returns the part of a fingerprint for a map. Maps with the same counts and bounds differ by the order of their points.
pub(super) fn map_fingerprint(lidar: &LidarMap) -> String {
    let sum = lidar.occupied_m.iter().fold(0.0, |sum, p| sum * 0.999 + p.x + 3.0 * p.y);
    format!("{:?} {sum}", lidar.info)
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
