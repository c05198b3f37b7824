//! The poses that each clip of a home may have.

use super::cache::Cache;
use super::footprint::Footprint;
use super::members::{Extent, Member, Mode, Verdict};
use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};
use viola_align::MIN_ALIGNED_PROBABILITY;
use viola_geometry::progress::Cancelled;
use viola_geometry::{LevelName, Pose2};

/// Maximum possible poses of a clip: as many as an alignment lists.
const MAX_MODES: usize = 8;
/// Minimum probability that a clip is at none of its listed poses.
const MIN_ELSEWHERE: f64 = 0.005;

/// A clip and its possible poses.
pub(super) struct Candidate<'a> {
    pub member: &'a Member,
    /// The best first, as the clip's own alignment ranks them; then those that matches to other clips add.
    pub modes: Vec<Mode>,
    pub extent: Extent,
    pub footprint: Footprint,
    pub points: usize,
}

/// A clip and its possible poses, named by its contribution.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownClip {
    #[serde(rename = "share")]
    pub contribution: String,
    pub extent: Extent,
    /// None in manifests of earlier versions.
    #[serde(default)]
    pub footprint: Option<Footprint>,
    pub points: usize,
    pub modes: Vec<Pose2>,
    /// Levels of the modes; empty if all are on the level `main`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<LevelName>,
    /// Heights of the clip frame's origin above the floor at the modes; empty if all are 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rises_m: Vec<f64>,
    /// The likeliest of the modes by all clips of the home; none if a person chose the pose.
    pub marginal: Option<Marginal>,
}

/// A clip's likeliest pose by the joint model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Marginal {
    /// Index of the pose.
    pub mode: usize,
    /// Probability that the clip is there.
    pub probability: f64,
}

impl Candidate<'_> {
    /// Returns whether a person chose the pose.
    pub fn is_chosen(&self) -> bool {
        matches!(self.member.verdict, Verdict::Chosen { .. })
    }

    /// Returns whether the clip's own alignment left its pose open.
    pub fn is_open(&self) -> bool {
        matches!(self.member.verdict, Verdict::Ambiguous { .. } | Verdict::Unplaced)
    }

    /// Returns the probability that the clip is at none of its modes.
    pub fn elsewhere(&self) -> f64 {
        let listed: f64 = self.modes.iter().map(|mode| mode.probability).sum();
        if self.is_chosen() { 0.0 } else { (1.0 - listed).max(MIN_ELSEWHERE) }
    }

    pub fn known(&self, marginal: Option<Marginal>) -> KnownClip {
        KnownClip {
            contribution: self.member.contribution.clone(),
            extent: self.extent,
            footprint: Some(self.footprint.clone()),
            points: self.points,
            modes: self.modes.iter().map(|mode| mode.map_from_clip).collect(),
            levels: self.levels(),
            rises_m: self.rises_m(),
            marginal,
        }
    }

    /// Returns the levels as a [`KnownClip`] has them.
    fn levels(&self) -> Vec<LevelName> {
        let levels = self.modes.iter().map(|mode| mode.level);
        if levels.clone().all(|level| level.is_main()) { Vec::new() } else { levels.collect() }
    }

    /// Returns the heights as a [`KnownClip`] has them.
    fn rises_m(&self) -> Vec<f64> {
        let rises_m = self.modes.iter().map(|mode| mode.rise_m);
        if rises_m.clone().all(|rise_m| rise_m == 0.0) { Vec::new() } else { rises_m.collect() }
    }

    /// Returns whether the clip had the same modes in the last merge.
    pub fn has_modes_of(&self, known: &KnownClip) -> bool {
        self.modes.iter().map(|mode| &mode.map_from_clip).eq(&known.modes)
            && self.levels() == known.levels
            && self.rises_m() == known.rises_m
    }
}

/// Returns the members with the poses of their own alignments, in their order. `known`: clips of the last merge.
pub(super) fn candidates<'a, E: From<Cancelled>>(
    known: &[KnownClip],
    members: &'a [Member],
    cache: &mut Cache<E>,
) -> Result<Vec<Candidate<'a>>, E> {
    let before: FxHashMap<&str, &KnownClip> =
        known.iter().map(|known| (&*known.contribution, known)).collect();
    let mut candidates = Vec::new();
    for member in members {
        let modes = modes(&member.verdict);
        let known =
            before.get(&*member.contribution).and_then(|known| Some((known, known.footprint.clone()?)));
        let (extent, footprint, points) = match known {
            Some((known, footprint)) => (known.extent, footprint, known.points),
            None => {
                let loaded = cache.get(member)?;
                (
                    loaded.extent(),
                    Footprint::of(loaded.surface()),
                    loaded.contribution.cloud_in_clip.points.len(),
                )
            }
        };
        candidates.push(Candidate { member, modes, extent, footprint, points });
    }
    Ok(candidates)
}

pub(super) fn modes(verdict: &Verdict) -> Vec<Mode> {
    match verdict {
        Verdict::Aligned { level, map_from_clip, probability, .. } => {
            // An alignment without a probability has the minimum of its state.
            let probability = probability.unwrap_or(MIN_ALIGNED_PROBABILITY).clamp(0.0, 1.0);
            vec![Mode { level: *level, map_from_clip: *map_from_clip, rise_m: 0.0, probability }]
        }
        Verdict::Chosen { level, map_from_clip, rise_m } => {
            let (level, map_from_clip, rise_m) = (*level, *map_from_clip, *rise_m);
            vec![Mode { level, map_from_clip, rise_m, probability: 1.0 }]
        }
        Verdict::Unplaced => Vec::new(),
        Verdict::Ambiguous { alternatives } => {
            let mode = |mode: &Mode| Mode { probability: mode.probability.clamp(0.0, 1.0), ..*mode };
            alternatives.iter().take(MAX_MODES).map(mode).collect()
        }
    }
}
