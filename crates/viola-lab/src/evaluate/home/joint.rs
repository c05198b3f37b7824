//! Simulated homes whose clips are placed together: how many ambiguous clips the others place, and whether
//! the probabilities hold.

mod clips;
mod table;

use crate::evaluate::HomesParams;
use crate::simulate::Set;
use clips::{AlignedClip, clips};
use nalgebra::Matrix3;
use rustc_hash::FxHashMap;
use serde::Serialize;
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use uuid::Uuid;
use viola_align::{AlignError, AlignParams, AlignmentState};
use viola_formats::lidar::LidarError;
use viola_geometry::Pose2;
use viola_geometry::progress::Progress;
use viola_home::{
    Agreement, ClipContribution, Comparison, Manifest, Member, PlacedBy, Verdict, assemble, compare,
};

pub use table::JointRow;

/// A clip is decided by the others at their true poses if at its true pose at least so many patches of
/// surface agree with them, and at every other alternative at least so many more contradict them.
const DECIDING_AGREE: i32 = 20;
const DECIDING_DIFFER: i32 = 8;
/// Agreeing patches that excuse one differing patch: poses and depths err at the true pose as well.
const AGREEING_PER_ODD: i32 = 5;

/// Results of one home.
#[derive(Debug, Clone, Serialize)]
pub struct JointHome {
    pub set: &'static str,
    pub seed: u64,
    pub clips: Vec<JointClip>,
    /// Of the clips at their possible poses; by the clips' numbers.
    pub comparisons: Vec<Comparison>,
    /// The same with all clips at their true poses, which come first of the poses of each.
    pub at_truth: Vec<Comparison>,
}

/// Result of one clip.
#[derive(Debug, Clone, Serialize)]
pub struct JointClip {
    pub alone: AlignmentState,
    /// The possible poses.
    pub modes: Vec<JointMode>,
    /// True if the other clips at their true poses exclude all alternatives but the true one.
    pub decidable: bool,
    /// Probability of the likeliest pose by all clips, and whether it is right; none for failed clips.
    pub probability: Option<f64>,
    pub is_right: Option<bool>,
    /// How the clip came into the map; none if it is not there.
    pub placed_by: Option<PlacedBy>,
}

#[derive(Debug, Clone, Serialize)]
pub struct JointMode {
    pub map_from_clip: Pose2,
    pub probability: f64,
    pub is_right: bool,
}

#[derive(Debug, thiserror::Error)]
pub enum JointError {
    #[error(transparent)]
    Align(#[from] AlignError),
    #[error("the map of a simulated home: {0}")]
    Lidar(#[from] LidarError),
    #[error("{path}: {source}")]
    File { path: PathBuf, source: std::io::Error },
    #[error("{path} is not a clip of this evaluation; delete the folder to begin anew")]
    Damaged { path: PathBuf },
}

/// Aligns the clips of a simulated home one by one, then places them together. Aligned clips are kept in
/// `folder`.
pub fn joint(
    set: Set,
    seed: u64,
    homes: &HomesParams,
    params: &AlignParams,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<JointHome, JointError> {
    let clips = clips(set, seed, homes, params, folder, progress)?;
    let mut load = |member: &Member| -> Result<ClipContribution, Infallible> {
        let clip = member.share.parse::<usize>().ok().and_then(|number| clips.get(number));
        Ok(clip.map_or_else(ClipContribution::nothing, |clip| clip.share.clone()))
    };
    let members: Vec<Member> =
        clips.iter().enumerate().filter_map(|(number, clip)| Some(member(number, own_verdict(clip)?))).collect();
    let Ok(assembly) = assemble(&Manifest::default(), members, &mut load);
    let with_truth = |(number, clip): (usize, &AlignedClip)| {
        own_verdict(clip)?;
        Some(member(number, Verdict::Ambiguous { alternatives: true_then_wrong(clip) }))
    };
    let Ok(at_truth) = compare(clips.iter().enumerate().filter_map(with_truth).collect(), &mut load);
    let Manifest { clips: placed, known, comparisons, .. } = assembly.manifest;
    let result = |(number, clip): (usize, &AlignedClip)| {
        let share = number.to_string();
        let known = known.iter().find(|known| known.share == share);
        let marginal = known.and_then(|known| known.marginal);
        let pose = known.zip(marginal).and_then(|(known, marginal)| known.modes.get(marginal.mode));
        JointClip {
            alone: clip.answer.alignment.state,
            modes: modes(clip),
            decidable: is_decidable(clip, &share, &at_truth),
            probability: marginal.map(|marginal| marginal.probability),
            is_right: pose.map(|pose| clip.is_right(pose)),
            placed_by: placed.iter().find(|placed| placed.share == share).map(|placed| placed.by),
        }
    };
    let clips = clips.iter().enumerate().map(result).collect();
    Ok(JointHome { set: set.name(), seed, clips, comparisons, at_truth })
}

fn member(number: usize, verdict: Verdict) -> Member {
    Member {
        clip: Uuid::from_u128(number as u128),
        recorded_at_ms: None,
        sha256: format!("{number:06}"),
        share: number.to_string(),
        verdict,
    }
}

/// Returns a clip's own alignment as the service passes it on; none if it failed.
fn own_verdict(clip: &AlignedClip) -> Option<Verdict> {
    let alignment = &clip.answer.alignment;
    match alignment.state {
        AlignmentState::Aligned => Some(Verdict::Aligned {
            map_from_clip: alignment.map_from_clip?,
            covariance: Matrix3::from_fn(|r, c| alignment.covariance.map_or(0.0, |rows| rows[r][c])),
            probability: alignment.probability,
        }),
        AlignmentState::Ambiguous => {
            let alternatives = alignment.alternatives.iter();
            let alternatives =
                alternatives.map(|one| (one.map_from_clip, one.probability.unwrap_or(0.0))).collect();
            Some(Verdict::Ambiguous { alternatives })
        }
        AlignmentState::Failed => None,
    }
}

fn modes(clip: &AlignedClip) -> Vec<JointMode> {
    let mode = |(map_from_clip, probability): (Pose2, f64)| JointMode {
        is_right: clip.is_right(&map_from_clip),
        map_from_clip,
        probability,
    };
    match own_verdict(clip) {
        Some(Verdict::Aligned { map_from_clip, probability, .. }) => {
            vec![mode((map_from_clip, probability.unwrap_or(0.0)))]
        }
        Some(Verdict::Ambiguous { alternatives }) => alternatives.into_iter().map(mode).collect(),
        Some(Verdict::Chosen { .. }) | None => Vec::new(),
    }
}

/// Returns the true pose, then the alternatives that are wrong.
fn true_then_wrong(clip: &AlignedClip) -> Vec<(Pose2, f64)> {
    let wrong = modes(clip).into_iter().filter(|mode| !mode.is_right);
    let wrong = wrong.map(|mode| (mode.map_from_clip, 0.01));
    std::iter::once((clip.answer.map_from_clip, 1.0)).chain(wrong).collect()
}

fn is_decidable(clip: &AlignedClip, share: &str, at_truth: &[Comparison]) -> bool {
    let modes = modes(clip);
    if clip.answer.alignment.state != AlignmentState::Ambiguous || !modes.iter().any(|mode| mode.is_right) {
        return false;
    }
    let wrong = modes.iter().filter(|mode| !mode.is_right).count();
    // (agreeing, contradicting) patches by the clip's pose, with all others at their true poses.
    let mut sums: FxHashMap<usize, (i32, i32)> = FxHashMap::default();
    for comparison in at_truth {
        for (a, b, agreement) in &comparison.said {
            let (own, other) = if comparison.a == share { (a, b) } else { (b, a) };
            if (comparison.a == share || comparison.b == share) && *other == 0 {
                let sum = sums.entry(usize::from(*own)).or_default();
                sum.0 += i32::from(agreement.agree);
                sum.1 += contradictions(agreement);
            }
        }
    }
    let at = |mode: usize| sums.get(&mode).copied().unwrap_or_default();
    let (agree, against) = at(0);
    agree >= DECIDING_AGREE && (1..=wrong).all(|mode| at(mode).1 - against >= DECIDING_DIFFER)
}

fn contradictions(agreement: &Agreement) -> i32 {
    (i32::from(agreement.differ) - i32::from(agreement.agree) / AGREEING_PER_ODD).max(0)
}
