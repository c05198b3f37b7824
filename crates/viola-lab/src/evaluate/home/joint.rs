//! Simulated homes whose clips are placed together: how many ambiguous clips the others place, and whether
//! the probabilities hold.

mod table;

use super::clips::{AlignedClip, ClipsError, Recorder};
use super::member::{FilesOfClips, member};
use crate::evaluate::HomesParams;
use crate::simulate::{Home, HomeParams, Set};
use serde::Serialize;
use std::path::Path;
use viola_align::{AlignParams, AlignmentState};
use viola_geometry::progress::{Cancelled, Progress};
use viola_geometry::{LevelName, Pose2};
use viola_home::{
    ClipMatch, Comparison, Manifest, Member, Mode, PlacedBy, Verdict, assemble, compare, likeliest,
};

pub use table::JointRow;

/// Minimum probability of the true pose of a clip whose place the others decide.
const DECIDED: f64 = 0.95;

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
    /// By the clips' numbers.
    #[serde(rename = "ties")]
    pub clip_matches: Vec<JointMatch>,
}

/// A match and the truth about it.
#[derive(Debug, Clone, Serialize)]
pub struct JointMatch {
    #[serde(rename = "tie")]
    pub clip_match: ClipMatch,
    pub is_right: bool,
}

impl JointMatch {
    fn new(clip_match: ClipMatch, clips: &[AlignedClip]) -> JointMatch {
        let truth = |name: &str| name.parse::<usize>().ok().and_then(|n| clips.get(n));
        let is_right = truth(&clip_match.a).zip(truth(&clip_match.b)).is_some_and(|(a, b)| {
            let map_from_b = a.answer.map_from_clip.compose(&clip_match.b_from_a().inverse());
            b.is_right(&map_from_b)
        });
        JointMatch { clip_match, is_right }
    }
}

/// Result of one clip.
#[derive(Debug, Clone, Serialize)]
pub struct JointClip {
    pub alone: AlignmentState,
    /// The possible poses.
    pub modes: Vec<JointMode>,
    /// True for an ambiguous clip whose true pose gets a probability of at least [`DECIDED`] if all other clips
    /// are at their true poses.
    pub decidable: bool,
    /// Probability of the likeliest pose by all clips, and whether it is right; none for failed clips.
    pub probability: Option<f64>,
    pub is_right: Option<bool>,
    /// Source of the clip's pose in the map; none if it is not there.
    pub placed_by: Option<PlacedBy>,
}

#[derive(Debug, Clone, Serialize)]
pub struct JointMode {
    pub map_from_clip: Pose2,
    pub probability: f64,
    pub is_right: bool,
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
) -> Result<JointHome, ClipsError> {
    let home = Home::generate(&HomeParams::new(set, seed));
    let survey = home.survey();
    let lidar = survey.lidar_map()?;
    let recorder = Recorder { homes, params, folder, progress };
    let name = format!("{}_{seed}", set.name());
    let clips = recorder.clips(&home, &survey, &lidar, &name, 0..homes.clips_per_home)?;
    let mut load = FilesOfClips(clips.iter().map(|clip| &clip.files).collect());
    let own =
        |(number, clip): (usize, &AlignedClip)| Some(member(number, Verdict::of(&clip.answer.alignment)?));
    let members: Vec<Member> = clips.iter().enumerate().filter_map(own).collect();
    let assembly = assemble(&Manifest::default(), members, &mut load, progress)?;
    let with_truth = |(number, clip): (usize, &AlignedClip)| {
        Verdict::of(&clip.answer.alignment)?;
        Some(member(number, Verdict::Ambiguous { alternatives: true_then_wrong(clip) }))
    };
    let members = clips.iter().enumerate().filter_map(with_truth).collect();
    let at_truth = compare(members, &mut load, progress)?;
    let Manifest { clips: placed, known, comparisons, clip_matches, .. } = assembly.manifest;
    let clip_matches =
        clip_matches.into_iter().map(|clip_match| JointMatch::new(clip_match, &clips)).collect();
    let decidable = (0..clips.len()).map(|number| is_decidable(number, &clips, &mut load, progress));
    let decidable = decidable.collect::<Result<Vec<bool>, Cancelled>>()?;
    let result = |(number, clip): (usize, &AlignedClip)| {
        let contribution = number.to_string();
        let known = known.iter().find(|known| known.contribution == contribution);
        let marginal = known.and_then(|known| known.marginal);
        let pose = known.zip(marginal).and_then(|(known, marginal)| known.modes.get(marginal.mode));
        JointClip {
            alone: clip.answer.alignment.state,
            modes: modes(clip),
            decidable: decidable[number],
            probability: marginal.map(|marginal| marginal.probability),
            is_right: pose.map(|pose| clip.is_right(pose)),
            placed_by: placed
                .iter()
                .find(|placed| placed.contribution == contribution)
                .map(|placed| placed.by),
        }
    };
    let clips = clips.iter().enumerate().map(result).collect();
    Ok(JointHome { set: set.name(), seed, clips, comparisons, at_truth, clip_matches })
}

fn modes(clip: &AlignedClip) -> Vec<JointMode> {
    let mode = |Mode { map_from_clip, probability, .. }: Mode| JointMode {
        is_right: clip.is_right(&map_from_clip),
        map_from_clip,
        probability,
    };
    match Verdict::of(&clip.answer.alignment) {
        Some(Verdict::Aligned { level, map_from_clip, probability, .. }) => {
            vec![mode(Mode { level, map_from_clip, rise_m: 0.0, probability: probability.unwrap_or(0.0) })]
        }
        Some(Verdict::Ambiguous { alternatives }) => alternatives.into_iter().map(mode).collect(),
        Some(Verdict::Chosen { .. } | Verdict::Unplaced) | None => Vec::new(),
    }
}

/// Returns the true pose, then the alternatives that are wrong.
fn true_then_wrong(clip: &AlignedClip) -> Vec<Mode> {
    let wrong = modes(clip).into_iter().filter(|mode| !mode.is_right);
    let wrong = wrong.map(|mode| (mode.map_from_clip, 0.01));
    let on_main = |(map_from_clip, probability)| Mode {
        level: LevelName::MAIN,
        map_from_clip,
        rise_m: 0.0,
        probability,
    };
    std::iter::once((clip.answer.map_from_clip, 1.0)).chain(wrong).map(on_main).collect()
}

/// Returns whether an ambiguous clip is placed, and rightly, if the others are at their true poses.
fn is_decidable(
    number: usize,
    clips: &[AlignedClip],
    load: &mut FilesOfClips,
    progress: &dyn Progress,
) -> Result<bool, Cancelled> {
    let clip = &clips[number];
    if clip.answer.alignment.state != AlignmentState::Ambiguous {
        return Ok(false);
    }
    let verdict = |other: usize| match Verdict::of(&clips[other].answer.alignment)? {
        own if other == number => Some(own),
        _ => {
            let map_from_clip = clips[other].answer.map_from_clip;
            Some(Verdict::Chosen { level: LevelName::MAIN, map_from_clip, rise_m: 0.0 })
        }
    };
    let members = (0..clips.len()).filter_map(|other| Some(member(other, verdict(other)?))).collect();
    let known = likeliest(members, load, progress)?;
    let known = known.iter().find(|known| known.contribution == number.to_string());
    Ok(known.zip(known.and_then(|known| known.marginal)).is_some_and(|(known, marginal)| {
        marginal.probability >= DECIDED && clip.is_right(&known.modes[marginal.mode])
    }))
}
