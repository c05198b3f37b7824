//! The answer for one clip, as it is written and served.

use super::complete::View;
use super::refine::Spread;
use super::score::{Evidence, LossWeights, is_different};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::{LevelName, Pose2};
use viola_reconstruct::label::LabelReport;
use viola_reconstruct::{FloorReport, Reason};

/// The verdict on a clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlignmentState {
    /// One pose stands out.
    Aligned,
    /// Several poses that are not close to each other explain the clip about equally well.
    Ambiguous,
    /// No pose can be given; the reasons say why.
    #[default]
    Failed,
}

/// One explanation of the clip, the best first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// The level in whose LiDAR map the pose is.
    #[serde(default)]
    pub level: LevelName,
    pub map_from_clip: Pose2,
    /// Height of the clip frame's origin, which is on the floor of the answer, above the floor of this explanation, in metres: it
    /// is added to heights in the clip frame. 0 if both are one floor, positive if that of the explanation lies lower.
    #[serde(default, skip_serializing_if = "viola_geometry::is_zero")]
    pub rise_m: f64,
    /// Loss in metres, which ranks the alternatives: mean robust distance of the hits to the map, plus
    /// penalties by free space and by the rooms' names.
    pub loss_m: f64,
    /// Fraction of the hits within 0.1 m of the map, 0..1.
    pub inliers: f64,
    /// Contradictions by free space; null if the method does not use it.
    pub free_space: Option<FreeSpace>,
    /// Fraction of the labelled surface above the floor that does not belong in its room of the map, such as
    /// a bed in a kitchen, 0..1; by a network's classes and the rooms' names. Null if no room's name states
    /// its purpose.
    #[serde(default)]
    pub misplaced: Option<f64>,
    /// Probability that this pose is right, 0..1; null if the method gives none.
    pub probability: Option<f64>,
    /// All evidence of the loss; `None` if the method has none, or the answer was read from a file.
    #[serde(skip)]
    pub evidence: Option<Evidence>,
}

/// Contradictions between free space of one side and obstacles of the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FreeSpace {
    /// Fraction of the clip's rays that run through walls of the map, 0..1.
    pub blocked_rays: f64,
    /// Fraction of the hits that stand where the robot saw free floor, 0..1.
    pub hits_on_floor: f64,
    /// Fraction of the hits that fit a wall on a side that the robot never saw, 0..1.
    #[serde(default)]
    pub unseen_sides: f64,
    /// Walls of the map where the clip saw free floor, as a fraction of these walls and the hits, 0..1.
    pub walls_on_floor: f64,
}

/// A scale at which the clip fits better.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BetterScale {
    /// Factor of the clip's lengths.
    pub factor: f64,
    /// How much smaller the loss is, in the clip's metres.
    pub gain_m: f64,
}

/// The first used camera of a clip: the clip frame has its origin on the floor below it and faces along its heading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceCamera {
    /// Number of the frame in the clip.
    pub frame: u32,
    /// Pose of the camera (x right, y down, z forward) in the clip frame, row by row; translation in metres.
    pub clip_from_camera: [[f64; 4]; 4],
}

/// The answer for one clip: `result.json` of `viola align`, and `alignment` of a clip over HTTP.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    pub state: AlignmentState,
    /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1; null without a pose.
    pub probability: Option<f64>,
    /// The level of the first alternative; `main` without one.
    #[serde(default)]
    pub level: LevelName,
    /// Null if the state is `failed`.
    pub map_from_clip: Option<Pose2>,
    /// Covariance of (x_m, y_m, yaw_rad), row by row: square metres, metre radians, square radians.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// Loss of the best alternative.
    pub loss_m: Option<f64>,
    pub inliers: Option<f64>,
    /// Fraction of the LiDAR map's points that the clip's hits explain, 0..1 (the paper's coverage).
    pub coverage: Option<f64>,
    /// The ranked explanations, the chosen one first.
    pub alternatives: Vec<Alternative>,
    /// Uncertainty of the pose before calibration; `None` without a pose, or if the answer was read from a file.
    #[serde(skip)]
    pub spread: Option<Spread>,
    /// Metres per unit of the clip's depth, if the unit was unknown; null if it is metres. Poses have the same unit; those
    /// of a Nerfstudio file have it after division by its `applied_scale`.
    #[serde(default)]
    pub scale: Option<f64>,
    /// Standard deviation of `scale`.
    #[serde(default)]
    pub scale_std: Option<f64>,
    /// Loss of the explanations at other scales minus that of the best one; empty if the answer was read from a file.
    #[serde(skip)]
    pub scale_rival_gaps_m: Vec<f64>,
    /// Another scale at which a clip in metres fits better; `None` if the answer was read from a file.
    #[serde(skip)]
    pub better_scale: Option<BetterScale>,
    pub reasons: Vec<Reason>,
    pub hits: usize,
    pub key_frames: usize,
    /// Summary of the labelling; null if nothing was fused.
    pub labels: Option<LabelReport>,
    pub floor: Option<FloorReport>,
    /// The camera that defines the clip frame; null without a floor.
    #[serde(default)]
    pub reference_camera: Option<ReferenceCamera>,
    /// Completion because the first answer was in doubt; null without completion.
    pub completion: Option<CompletionReport>,
    /// Time of each stage. The only part that differs from run to run.
    pub seconds: BTreeMap<String, f64>,
}

impl Alternative {
    /// Returns the explanation with its loss by this evidence, above the floor of the answer. It has no probability, and no
    /// misplaced fraction.
    pub fn of(
        level: LevelName,
        map_from_clip: Pose2,
        evidence: &Evidence,
        weights: &LossWeights,
    ) -> Alternative {
        Alternative {
            level,
            map_from_clip,
            rise_m: 0.0,
            loss_m: weights.loss_m(evidence),
            inliers: evidence.inliers,
            free_space: Some(FreeSpace {
                blocked_rays: evidence.blocked_rays,
                hits_on_floor: evidence.hits_on_floor,
                unseen_sides: evidence.unseen_sides,
                walls_on_floor: evidence.walls_on_floor,
            }),
            misplaced: None,
            probability: None,
            evidence: Some(*evidence),
        }
    }

    /// Returns whether this is another explanation than `other`: another level or a distant pose.
    pub fn is_different_from(&self, other: &Alternative) -> bool {
        self.level != other.level || is_different(&self.map_from_clip, &other.map_from_clip)
    }
}

impl Alignment {
    /// Returns an answer without a pose or any data.
    pub fn failed() -> Alignment {
        Alignment::default()
    }
}

/// Summary of the completion of an answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompletionReport {
    /// Number of points that extend walls.
    pub structure_points: usize,
    /// Number of points by networks.
    pub imagined_points: usize,
    /// Number of completed hits.
    pub hits: usize,
    /// The networks that completed pictures or their depth.
    pub imagined_by: Vec<String>,
    /// The views with completed pictures, in their order.
    pub views: Vec<ViewReport>,
    /// True if the time budget ended before the last view.
    pub cut_short: bool,
    /// True if the answer is the one after completion.
    pub taken: bool,
    pub before: AnswerSummary,
    pub after: AnswerSummary,
}

/// Summary of a view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewReport {
    /// In the clip frame.
    pub view: View,
    /// Fraction of the picture that was completed, 0..1.
    pub imagined_share: f64,
    /// Number of points that the view added.
    pub points: usize,
}

/// Summary of an answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AnswerSummary {
    pub state: AlignmentState,
    pub probability: Option<f64>,
    pub map_from_clip: Option<Pose2>,
}

impl AnswerSummary {
    pub(super) fn of(alignment: &Alignment) -> AnswerSummary {
        AnswerSummary {
            state: alignment.state,
            probability: alignment.probability,
            map_from_clip: alignment.map_from_clip,
        }
    }
}
