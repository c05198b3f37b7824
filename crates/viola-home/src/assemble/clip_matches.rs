//! Matches: relative poses of clips that saw the same place, by its appearance, map or no map.
//!
//! Two clips whose features agree on one motion are registered by their surfaces there, and the surfaces are
//! compared. A match depends on its two clips alone.

mod forest;
mod matching;
mod motion;

pub(super) use forest::{Branch, Forest, forest, is_likely, pass_poses};

use super::agreement::{Agreement, Side};
use super::cache::{Cache, Loaded};
use super::candidates::{Candidate, KnownClip};
use super::floor_correction::{FloorCorrection, pose_in_space, split_pose};
use super::members::Member;
use super::overlap::{Overlap, overlap};
pub use motion::Motion;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BTreeMap;
use viola_geometry::progress::{self, Cancelled};
use viola_geometry::{Pose2, Pose3};
use viola_reconstruct::Feature;

/// Matches of a clip with earlier clips whose surfaces are compared: those of the most places.
const MAX_COMPARED: usize = 6;

/// Relative pose of two clips, named by their contributions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClipMatch {
    pub a: String,
    pub b: String,
    pub motion: Motion,
    /// None if `b` has matches of more places with other clips before it.
    pub surfaces: Option<Surfaces>,
}

/// The surfaces of two clips near a motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Surfaces {
    /// The pose after registration, if they overlap; else that of the motion.
    pub b_from_a: Pose2,
    pub agreement: Agreement,
    /// None if they do not overlap.
    pub overlap: Option<Overlap>,
}

/// Matches by the indices of their candidates.
type Found = BTreeMap<(usize, usize), ClipMatch>;

/// Returns the matches between all clips, in canonical order. Two clips of the last merge keep what they had then.
pub(super) fn clip_matches<E: From<Cancelled>>(
    (known, before): (&[KnownClip], &[ClipMatch]),
    candidates: &[Candidate],
    cache: &mut Cache<E>,
) -> Result<Vec<ClipMatch>, E> {
    let place: FxHashMap<&str, usize> =
        candidates.iter().enumerate().map(|(i, candidate)| (&*candidate.member.contribution, i)).collect();
    // A clip whose time was corrected may have changed its place, and a match is of the earlier clip to the later one.
    let kept = |clip_match: &ClipMatch| {
        let (a, b) = (*place.get(&*clip_match.a)?, *place.get(&*clip_match.b)?);
        (a < b).then(|| ((a, b), clip_match.clone()))
    };
    let mut found: Found = before.iter().filter_map(kept).collect();
    find(known, candidates, cache, &mut found)?;
    let compared = most_places(candidates.len(), &found);
    for (pair, clip_match) in &mut found {
        clip_match.surfaces = clip_match.surfaces.take().filter(|_| compared.contains(pair));
    }
    // By the later clip, which is loaded once.
    let mut fresh: Vec<(usize, usize)> = found
        .iter()
        .filter(|(pair, clip_match)| clip_match.surfaces.is_none() && compared.contains(pair))
        .map(|(pair, _)| *pair)
        .collect();
    fresh.sort_unstable_by_key(|(a, b)| (*b, *a));
    for of_one in fresh.chunk_by(|x, y| x.1 == y.1) {
        let others: Vec<&Member> = of_one.iter().map(|(a, _)| candidates[*a].member).collect();
        let surfaces = cache.with_each(candidates[of_one[0].1].member, &others, |at, a, b| {
            found.get(&of_one[at]).map(|clip_match| Surfaces::of(&clip_match.motion, a, b))
        })?;
        for (pair, surfaces) in of_one.iter().zip(surfaces) {
            if let Some(clip_match) = found.get_mut(pair) {
                clip_match.surfaces = surfaces;
            }
        }
    }
    Ok(found.into_values().collect())
}

/// Adds the matches of clips that the last merge did not know, or knew in the other order.
fn find<E: From<Cancelled>>(
    known: &[KnownClip],
    candidates: &[Candidate],
    cache: &mut Cache<E>,
    found: &mut Found,
) -> Result<(), E> {
    let place: FxHashMap<&str, usize> =
        known.iter().enumerate().map(|(i, known)| (&*known.contribution, i)).collect();
    let before: Vec<Option<usize>> =
        candidates.iter().map(|candidate| place.get(&*candidate.member.contribution).copied()).collect();
    let is_known =
        |a: usize, b: usize| matches!((before[a], before[b]), (Some(first), Some(second)) if first < second);
    let pairs: Vec<(usize, usize)> = (0..candidates.len())
        .flat_map(|b| (0..b).map(move |a| (a, b)))
        .filter(|(a, b)| !is_known(*a, *b))
        .collect();
    if pairs.is_empty() {
        return Ok(());
    }
    let members: Vec<&Member> = candidates.iter().map(|candidate| candidate.member).collect();
    let features: Vec<Vec<Feature>> = cache.features(&members)?;
    let progress = cache.progress;
    let clip_match = |&(a, b): &(usize, usize)| {
        let motion = motion::motion(&features[a], &features[b])?;
        let name = |clip: usize| candidates[clip].member.contribution.clone();
        Some(((a, b), ClipMatch { a: name(a), b: name(b), motion, surfaces: None }))
    };
    let until_stop = |pair: &(usize, usize)| match progress::check(progress) {
        Ok(()) => clip_match(pair).map(Ok),
        Err(stop) => Some(Err(stop)),
    };
    found.extend(pairs.par_iter().filter_map(until_stop).collect::<Result<Vec<_>, Cancelled>>()?);
    Ok(())
}

/// Returns the matches that are among those of the most places of their later clip. A clip chooses among the clips before
/// it only, so a clip that comes last changes no comparison of two others.
fn most_places(clips: usize, found: &Found) -> FxHashSet<(usize, usize)> {
    let mut order: Vec<(usize, (usize, usize))> =
        found.iter().map(|(pair, clip_match)| (clip_match.motion.places, *pair)).collect();
    order.sort_unstable_by_key(|(places, pair)| (Reverse(*places), *pair));
    let mut counts = vec![0; clips];
    let mut compared = FxHashSet::default();
    for (_, (a, b)) in order {
        if counts[b] < MAX_COMPARED {
            compared.insert((a, b));
            counts[b] += 1;
        }
    }
    compared
}

/// Logarithm of the odds that a match is right, by the logarithm of its places and by the log-likelihood ratio of the
/// surfaces there. Of 107 matches of six simulated homes (`viola evaluate --joint`, sets `repeated` and `normal`, seeds
/// 2000..2003).
const OF_PLACES: f64 = 3.3;
const OF_SURFACES: f64 = 0.8;
const CONSTANT: f64 = -9.0;
/// Bound of the surfaces' ratio, and maximum of the logarithm of the odds.
const MAX_SURFACES: f64 = 3.0;
const MAX_LOG_ODDS: f64 = 6.0;

impl ClipMatch {
    /// Returns the relative pose.
    pub fn b_from_a(&self) -> Pose2 {
        self.surfaces.as_ref().map_or(self.motion.b_from_a, |surfaces| surfaces.b_from_a)
    }

    /// Returns the logarithm of the odds that the match is right; none without a comparison of the surfaces.
    fn log_odds(&self) -> Option<f64> {
        let surfaces = self.surfaces.as_ref()?.agreement.log_likelihood_ratio();
        let surfaces = OF_SURFACES * surfaces.clamp(-MAX_SURFACES, MAX_SURFACES);
        let log_odds = CONSTANT + OF_PLACES * (self.motion.places as f64).ln() + surfaces;
        Some(log_odds.min(MAX_LOG_ODDS))
    }

    /// Returns the registration of the surfaces, if the match is likely and consistent with these poses.
    pub fn overlap_at(&self, map_from_a: &Pose2, map_from_b: &Pose2) -> Option<&Overlap> {
        let joins = forest::is_near(&map_from_a.compose(&self.b_from_a().inverse()), map_from_b);
        let is_likely = joins && self.log_odds()? > 0.0;
        self.surfaces.as_ref()?.overlap.as_ref().filter(|_| is_likely)
    }
}

impl Surfaces {
    /// Registers two clips near a motion, and compares their surfaces there.
    fn of(motion: &Motion, a: &Loaded, b: &Loaded) -> Surfaces {
        let start =
            pose_in_space(&motion.b_from_a, &FloorCorrection { z_m: motion.rise_m, tilt_rad: [0.0; 2] });
        let overlap = overlap(a.surface(), b.surface(), &start);
        let pose = overlap.as_ref().map_or(start, |overlap| overlap.b_from_a);
        let sides = [(a, pose), (b, Pose3::identity())]
            .map(|(clip, pose)| Side::new(clip.surface(), &clip.contribution.views, pose));
        Surfaces { b_from_a: split_pose(&pose).0, agreement: Agreement::of(&sides[0], &sides[1]), overlap }
    }
}

#[cfg(test)]
pub(super) use tests::room_of_features;
#[cfg(test)]
mod tests;
