//! Record of one clip and one method.

use super::{Case, SUCCESS_DEG, SUCCESS_M, Sample};
use crate::paper::covered;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use viola_align::{Alignment, AlignmentState, Alternative, Evidence, MODEL};
use viola_geometry::{LevelName, Point2, Pose2, wrap_angle};

/// Result of one method on one clip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClipResult {
    pub method: String,
    pub set: String,
    /// Length of the clips in this table row, in frames.
    pub frames: usize,
    /// The clip's name in its set.
    pub clip: String,
    pub first_frame: u32,
    pub last_frame: u32,
    pub state: AlignmentState,
    /// Codes of the answer's reasons.
    pub reasons: Vec<String>,
    pub probability: Option<f64>,
    /// True if the map is of another home, in which no pose is right.
    #[serde(default)]
    pub foreign: bool,
    /// Null without a pose on the true level.
    pub rotation_error_deg: Option<f64>,
    pub translation_error_m: Option<f64>,
    /// True if the answer has the true level; null without a pose, and in homes with one level.
    #[serde(default)]
    pub right_level: Option<bool>,
    /// Fraction of the map's points that the clip's hits cover at the true pose (the paper's coverage); null
    /// without a true pose.
    pub coverage: Option<f64>,
    pub inliers: Option<f64>,
    /// True if the method found the floor; false if its height was assumed, or there is none.
    #[serde(default)]
    pub floor_seen: bool,
    /// True if the clip shows the floor, by the truth; null if that is unknown.
    #[serde(default)]
    pub floor_in_sight: Option<bool>,
    /// True if the clip's content fits the map equally well in several places; null if that is unknown.
    pub unknowable: Option<bool>,
    /// Error of the scale, as a fraction of the true one; null if the clip had metres, or no answer.
    #[serde(default)]
    pub scale_error: Option<f64>,
    /// Index of the true pose in the ranked alternatives.
    pub truth_rank: Option<usize>,
    /// Error and uncertainty of the pose; null without a pose on the true level, and for methods without
    /// covariance.
    #[serde(default)]
    pub placement: Option<Placement>,
    /// The ranked alternatives, compared with the truth.
    #[serde(default)]
    pub alternatives: Vec<Listed>,
    /// Number of hits of the virtual scan.
    #[serde(default)]
    pub hits: usize,
    /// Time of search, refinement and decision, on one thread.
    pub register_seconds: f64,
    /// Time from the clip's pictures to its pose, on one thread.
    pub seconds: f64,
}

/// Error of a pose at the middle of its hits, with the covariances of (x_m, y_m, yaw_rad) there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    pub error: [f64; 3],
    /// By the likelihood of the hits, before calibration.
    pub spread: [[f64; 3]; 3],
    /// As in the answer.
    pub covariance: [[f64; 3]; 3],
}

impl Placement {
    fn new(sample: &Sample, alignment: &Alignment) -> Option<Placement> {
        let (pose, spread) = (alignment.map_from_clip?, alignment.spread?);
        let truth = sample.map_from_clip?;
        let at = pose.apply(&spread.middle_in_clip) - truth.apply(&spread.middle_in_clip);
        Some(Placement {
            error: [at.x, at.y, wrap_angle(pose.yaw_rad - truth.yaw_rad)],
            spread: spread.covariance.into(),
            covariance: MODEL.covariance.calibrated(&spread.covariance).into(),
        })
    }

    /// Returns the normalised squared error (NEES), 3 on average if the covariance is right (Bar-Shalom et
    /// al., 2001).
    pub fn nees(&self) -> f64 {
        let error = Vector3::from(self.error);
        let solved = Matrix3::from(self.covariance).cholesky().map(|root| root.solve(&error));
        solved.map_or(f64::INFINITY, |solved| error.dot(&solved))
    }
}

/// One of the answer's alternatives.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Listed {
    /// On the true level, and the paper's success.
    pub right: bool,
    pub level: LevelName,
    pub map_from_clip: Pose2,
    pub loss_m: f64,
    /// None for methods that rank by distance only.
    pub evidence: Option<Evidence>,
}

impl ClipResult {
    /// Returns whether it is the paper's success.
    pub fn is_success(&self) -> bool {
        self.rotation_error_deg.is_some_and(|e| e < SUCCESS_DEG)
            && self.translation_error_m.is_some_and(|e| e < SUCCESS_M)
    }

    pub(super) fn new(
        case: &Case,
        method: &str,
        sample: &Sample,
        alignment: &Alignment,
        coverage: Option<f64>,
        seconds: Seconds,
    ) -> ClipResult {
        let is_right_level = alignment.level == sample.level;
        let on_level = alignment.map_from_clip.as_ref().filter(|_| is_right_level);
        let error = on_level.and_then(|pose| sample.errors(pose));
        let foreign = sample.map_from_clip.is_none();
        let may_err = alignment.map_from_clip.is_some() && !sample.other_levels.is_empty() && !foreign;
        let listed = |alternative: &Alternative| Listed {
            right: sample.is_right(alternative.level, &alternative.map_from_clip),
            level: alternative.level,
            map_from_clip: alternative.map_from_clip,
            loss_m: alternative.loss_m,
            evidence: alternative.evidence,
        };
        let alternatives: Vec<Listed> = alignment.alternatives.iter().map(listed).collect();
        ClipResult {
            method: method.to_owned(),
            set: case.set.clone(),
            frames: case.frames,
            clip: case.name.clone(),
            first_frame: sample.first_frame,
            last_frame: sample.last_frame,
            state: alignment.state,
            reasons: alignment.reasons.iter().map(|reason| reason.code.clone()).collect(),
            probability: alignment.probability,
            foreign,
            rotation_error_deg: error.map(|e| e.0),
            translation_error_m: error.map(|e| e.1),
            right_level: may_err.then_some(is_right_level),
            coverage,
            inliers: alignment.inliers,
            floor_seen: sample.observation.floor.as_ref().is_some_and(|floor| !floor.assumed),
            floor_in_sight: sample.floor_in_sight,
            unknowable: sample.unknowable,
            scale_error: alignment.scale.zip(sample.scale).map(|(found, truth)| found / truth - 1.0),
            truth_rank: alternatives.iter().position(|alternative| alternative.right),
            placement: Placement::new(sample, alignment).filter(|_| is_right_level),
            alternatives,
            hits: alignment.hits,
            register_seconds: seconds.register,
            seconds: seconds.all,
        }
    }
}

#[cfg(test)]
impl Listed {
    /// Returns a wrong alternative without evidence.
    pub(super) fn example() -> Listed {
        Listed {
            right: false,
            level: LevelName::MAIN,
            map_from_clip: Pose2::IDENTITY,
            loss_m: 0.0,
            evidence: None,
        }
    }
}

#[cfg(test)]
impl ClipResult {
    /// Returns a clip with these errors, or without a pose.
    pub(super) fn example(state: AlignmentState, errors: Option<(f64, f64)>) -> ClipResult {
        ClipResult {
            method: "viola".into(),
            set: "normal".into(),
            frames: 60,
            clip: "000001_0".into(),
            first_frame: 0,
            last_frame: 59,
            state,
            reasons: Vec::new(),
            probability: None,
            foreign: false,
            rotation_error_deg: errors.map(|e| e.0),
            translation_error_m: errors.map(|e| e.1),
            right_level: None,
            coverage: Some(0.5),
            inliers: Some(0.9),
            floor_seen: true,
            floor_in_sight: None,
            unknowable: Some(false),
            scale_error: None,
            truth_rank: None,
            placement: None,
            alternatives: Vec::new(),
            hits: 150,
            register_seconds: 0.1,
            seconds: 1.0,
        }
    }
}

/// Times of one result.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seconds {
    pub register: f64,
    pub all: f64,
}

/// Returns the fraction of the map's points with a hit within 0.1 m when the clip is at its true pose; none without a
/// true pose.
pub(super) fn coverage(sample: &Sample) -> Option<f64> {
    let map_from_clip = sample.map_from_clip?;
    let place = |hit: &viola_align::Hit| map_from_clip.apply(&hit.point_m);
    let hits: Vec<Point2> = sample.observation.scan.hits.iter().map(place).collect();
    let Some(target) = &sample.target else { return Some(0.0) };
    if hits.is_empty() {
        return Some(0.0);
    }
    Some(covered(target, &hits))
}
