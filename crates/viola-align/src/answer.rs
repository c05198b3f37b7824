//! The answer for one clip, as it is written and served.

use super::complete::View;
use super::score::Evidence;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::Pose2;
use viola_reconstruct::label::LabelReport;
use viola_reconstruct::{FloorReport, Reason};

/// The verdict on a clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlignmentState {
    /// One pose stands out.
    Aligned,
    /// Several poses that are not close to each other explain the clip about equally well.
    Ambiguous,
    /// No pose can be given; the reasons say why.
    Failed,
}

/// One explanation of the clip, the best first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    pub map_from_clip: Pose2,
    /// Mean robust distance of the hits to the map, plus what free space and the rooms' names say against the pose, in metres:
    /// what ranks them.
    pub loss_m: f64,
    /// Share of the hits within 0.1 m of the map, 0..1.
    pub inliers: f64,
    /// What free space says against the pose; null where the method does not look at it.
    pub free_space: Option<FreeSpace>,
    /// What does not belong in the room of the map in which it would stand, such as a bed in a kitchen, by the classes that a
    /// network gave and the rooms' names: its share of all that was named above the floor, 0..1. Null where no room's name
    /// tells what it is for.
    #[serde(default)]
    pub misplaced: Option<f64>,
    /// That this pose is right, 0..1; null where the method does not give one.
    pub probability: Option<f64>,
    /// All evidence that the loss is made of; none where the method has none, or the answer was read from a file.
    #[serde(skip)]
    pub evidence: Option<Evidence>,
}

/// Contradictions between what one side saw free and the other side has standing there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FreeSpace {
    /// Share of the clip's rays that run through walls of the map, 0..1.
    pub blocked_rays: f64,
    /// Share of the hits that stand where the robot saw free floor, 0..1.
    pub hits_on_floor: f64,
    /// Share of the hits that fit a wall on the side from which the robot never saw it, 0..1.
    #[serde(default)]
    pub unseen_sides: f64,
    /// Share of the map's walls that stand where the clip saw free floor, among those it speaks about, 0..1.
    pub walls_on_floor: f64,
}

/// The answer for one clip: `result.json` of `viola align`, and `alignment` of a clip over HTTP.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    pub state: AlignmentState,
    /// That the pose is right to 10 degrees and 0.3 m, 0..1; null when there is no pose.
    pub probability: Option<f64>,
    /// Null when the state is `failed`.
    pub map_from_clip: Option<Pose2>,
    /// Of (x_m, y_m, yaw_rad), row after row: square metres, metre radians, square radians.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// That of the best alternative.
    pub loss_m: Option<f64>,
    pub inliers: Option<f64>,
    /// Share of the LiDAR map's points that the clip's hits explain, 0..1 (the paper's coverage).
    pub coverage: Option<f64>,
    /// The ranked explanations, the chosen one first.
    pub alternatives: Vec<Alternative>,
    pub reasons: Vec<Reason>,
    pub hits: usize,
    pub key_frames: usize,
    /// What told the classes of the points; null when nothing was fused.
    pub labels: Option<LabelReport>,
    pub floor: Option<FloorReport>,
    /// What was filled in because the first answer left doubt; null where nothing was.
    pub completion: Option<CompletionReport>,
    /// Time of each stage. The only part that differs from run to run.
    pub seconds: BTreeMap<String, f64>,
}

impl Alignment {
    /// No pose, and nothing known.
    pub fn failed() -> Alignment {
        Alignment {
            state: AlignmentState::Failed,
            probability: None,
            map_from_clip: None,
            covariance: None,
            loss_m: None,
            inliers: None,
            coverage: None,
            alternatives: Vec::new(),
            reasons: Vec::new(),
            hits: 0,
            key_frames: 0,
            labels: None,
            floor: None,
            completion: None,
            seconds: BTreeMap::new(),
        }
    }
}

/// The completion of an answer, as the answer reports it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompletionReport {
    /// Points that continue walls.
    pub structure_points: usize,
    /// Points that networks made up.
    pub imagined_points: usize,
    /// Hits at the vacuum's height that were filled in.
    pub hits: usize,
    /// The networks that made something up.
    pub imagined_by: Vec<String>,
    /// The views of which pictures were filled in, in their order.
    pub views: Vec<ViewReport>,
    /// The time allowed was over before the last view.
    pub cut_short: bool,
    /// Whether the answer is the one with what was filled in.
    pub taken: bool,
    pub before: Judged,
    pub after: Judged,
}

/// A view in short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewReport {
    /// In the clip frame.
    pub view: View,
    /// Share of the picture that was filled in, 0..1.
    pub imagined_share: f64,
    /// Points that the view added.
    pub points: usize,
}

/// An answer in short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    pub state: AlignmentState,
    pub probability: Option<f64>,
    pub map_from_clip: Option<Pose2>,
}

impl Judged {
    pub(super) fn of(alignment: &Alignment) -> Judged {
        Judged {
            state: alignment.state,
            probability: alignment.probability,
            map_from_clip: alignment.map_from_clip,
        }
    }
}
