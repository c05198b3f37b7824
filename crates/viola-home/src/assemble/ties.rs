//! Ties: relative poses of clips that saw the same place, by its appearance, map or no map.
//!
//! Two clips whose features agree on one motion are registered by their surfaces there, and the surfaces are
//! compared. A tie depends on its two clips alone.

mod forest;
mod matching;
mod motion;

pub(super) use forest::{Branch, forest, pass_poses};

use super::agreement::{Agreement, Side};
use super::cache::{Cache, Loaded};
use super::candidates::{Candidate, KnownClip};
use super::level::{Level, apart, in_space};
use super::overlap::{Overlap, overlap};
use motion::Motion;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};
use viola_geometry::{Pose2, Pose3};
use viola_reconstruct::Feature;

/// Clips that are loaded at a time, to bound the memory.
const AT_A_TIME: usize = 8;

/// Relative pose of two clips, named by their contributions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tie {
    pub a: String,
    pub b: String,
    pub b_from_a: Pose2,
    /// Height of `a`'s floor above that of `b`.
    pub rise_m: f64,
    /// Places that both clips show, and their RMS distance from their middle.
    pub places: usize,
    pub spread_m: f64,
    /// Agreement of the surfaces at this pose.
    pub surfaces: Agreement,
    /// Registration of the surfaces; none if they do not overlap.
    pub overlap: Option<Overlap>,
}

/// Returns the ties between all clips, in canonical order. Two clips of the last merge keep what they had then.
pub(super) fn ties<E>(
    (known, before): (&[KnownClip], &[Tie]),
    candidates: &[Candidate],
    cache: &mut Cache<E>,
) -> Result<Vec<Tie>, E> {
    let old: FxHashMap<&str, ()> = known.iter().map(|known| (&*known.share, ())).collect();
    let is_old = |clip: usize| old.contains_key(&*candidates[clip].member.share);
    let place: FxHashMap<&str, usize> =
        candidates.iter().enumerate().map(|(i, candidate)| (&*candidate.member.share, i)).collect();
    let kept = |tie: &Tie| Some(((*place.get(&*tie.a)?, *place.get(&*tie.b)?), tie.clone()));
    let mut found: Vec<((usize, usize), Tie)> = before.iter().filter_map(kept).collect();
    if (0..candidates.len()).all(is_old) {
        return Ok(found.into_iter().map(|(_, tie)| tie).collect());
    }
    let features: Vec<Vec<Feature>> =
        candidates.iter().map(|candidate| cache.features(candidate.member)).collect::<Result<_, E>>()?;
    let pairs: Vec<(usize, usize)> = (0..candidates.len())
        .flat_map(|b| (0..b).map(move |a| (a, b)))
        .filter(|(a, b)| !(is_old(*a) && is_old(*b)))
        .collect();
    let moved: Vec<(usize, usize, Motion)> = pairs
        .par_iter()
        .filter_map(|&(a, b)| Some((a, b, motion::motion(&features[a], &features[b])?)))
        .collect();
    for of_one in moved.chunk_by(|x, y| x.1 == y.1) {
        for part in of_one.chunks(AT_A_TIME) {
            let b = cache.get(candidates[part[0].1].member)?;
            let loaded: Vec<_> =
                part.iter().map(|(a, ..)| cache.get(candidates[*a].member)).collect::<Result<_, E>>()?;
            let tied = part.par_iter().zip(loaded).map(|((first, second, motion), a)| {
                let names = [*first, *second].map(|clip| candidates[clip].member.share.clone());
                ((*first, *second), Tie::of(names, motion, &a, &b))
            });
            found.extend(tied.collect::<Vec<_>>());
        }
    }
    found.sort_by_key(|(pair, _)| *pair);
    Ok(found.into_iter().map(|(_, tie)| tie).collect())
}

/// Logarithm of the odds that a tie is right, by the logarithm of its places and by the log-likelihood ratio of the
/// surfaces there. Of 107 ties of six simulated homes (`viola evaluate --joint`, sets `repeated` and `normal`, seeds
/// 2000..2003).
const OF_PLACES: f64 = 3.3;
const OF_SURFACES: f64 = 0.8;
const CONSTANT: f64 = -9.0;
/// Bound of the surfaces' ratio, and maximum of the logarithm of the odds.
const MAX_SURFACES: f64 = 3.0;
const MAX_LOG_ODDS: f64 = 6.0;

impl Tie {
    /// Returns the logarithm of the odds that the tie is right.
    fn log_odds(&self) -> f64 {
        let surfaces = self.surfaces.log_likelihood_ratio().clamp(-MAX_SURFACES, MAX_SURFACES);
        let log_odds = CONSTANT + OF_PLACES * (self.places as f64).ln() + OF_SURFACES * surfaces;
        log_odds.min(MAX_LOG_ODDS)
    }

    /// Returns the registration of the surfaces, if the tie is likely and consistent with these poses.
    pub fn overlap_at(&self, map_from_a: &Pose2, map_from_b: &Pose2) -> Option<Overlap> {
        let joins = forest::is_near(&map_from_a.compose(&self.b_from_a.inverse()), map_from_b);
        self.overlap.clone().filter(|_| joins && self.log_odds() > 0.0)
    }

    /// Registers two clips near a motion, and compares their surfaces there.
    fn of([name_a, name_b]: [String; 2], motion: &Motion, a: &Loaded, b: &Loaded) -> Tie {
        let start = in_space(&motion.b_from_a, &Level { z_m: motion.rise_m, tilt_rad: [0.0; 2] });
        let overlap = overlap(a.surface(), b.surface(), &start);
        let pose = overlap.as_ref().map_or(start, |overlap| overlap.b_from_a);
        let sides = [(a, pose), (b, Pose3::identity())]
            .map(|(clip, pose)| Side::new(clip.surface(), &clip.share.views, pose));
        let (b_from_a, level) = apart(&pose);
        Tie {
            a: name_a,
            b: name_b,
            b_from_a,
            rise_m: level.z_m,
            places: motion.places,
            spread_m: motion.spread_m,
            surfaces: Agreement::of(&sides[0], &sides[1]),
            overlap,
        }
    }
}

#[cfg(test)]
pub(super) use tests::room_of_features;
#[cfg(test)]
mod tests;
