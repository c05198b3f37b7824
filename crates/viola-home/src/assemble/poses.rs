//! Poses of a home's clips: the likeliest of each, then refined jointly, block by block in the map's order.
//!
//! A block is refined with the blocks before it at rest. So a clip that comes last moves the clips of its own block only,
//! and its merge costs the same in a home of many clips as in one of few.

use super::cache::Cache;
use super::candidates::{Candidate, KnownClip, Marginal, candidates};
use super::clip_matches::{ClipMatch, clip_matches, forest, pass_poses};
use super::floor_correction::{FloorCorrection, pose_in_space, raised_pose, rounded, split_pose};
use super::footprint::PlacedFootprint;
use super::joint::{self, Comparison};
use super::members::{Member, Mode, PlacedBy, PlacedClip, Verdict};
use super::neighbours::neighbours;
use super::overlap::{Overlap, overlap};
use super::pose_graph::{Edge, KERNELS, Prior, refine_poses};
use super::{Manifest, Pair};
use nalgebra::Matrix3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::collections::{BTreeMap, BTreeSet};
use viola_geometry::Pose2;
use viola_geometry::progress::{self, Cancelled, Progress};

/// Minimum probability to place a clip that is not aligned by itself. In 80 simulated homes 4 % of the clips from 0.95 on
/// were wrong, and none from 0.97 on (docs/experiments.md, Rules for placing clips together).
pub(super) const MIN_PLACED_PROBABILITY: f64 = 0.97;
/// Clips of the first block, so many that the mean error of their own alignments is small, and of each further block.
/// Clips count by their places among all clips of the home, placed or not.
const FIRST_BLOCK: usize = 16;
const BLOCK: usize = 8;

/// A clip with a pose.
struct Known<'a, 'c> {
    candidate: &'c Candidate<'a>,
    /// Its place among all clips of the home.
    place: usize,
    by: PlacedBy,
    probability: Option<f64>,
    /// Its pose before joint refinement.
    alone: Mode,
    /// None for a fixed pose.
    covariance: Option<Matrix3<f64>>,
}

impl<'a> Known<'a, '_> {
    fn member(&self) -> &'a Member {
        self.candidate.member
    }

    /// Returns the pair of two clips, not yet registered.
    fn pair_with(&self, b: &Known) -> Pair {
        Pair {
            a: self.member().contribution.clone(),
            b: b.member().contribution.clone(),
            map_from_a: self.alone.map_from_clip,
            map_from_b: b.alone.map_from_clip,
            rise_of_a_m: self.alone.rise_m,
            rise_of_b_m: b.alone.rise_m,
            overlap: None,
        }
    }
}

/// Returns the block of the clip at a place.
fn block(place: usize) -> usize {
    (place + BLOCK).saturating_sub(FIRST_BLOCK) / BLOCK
}

/// The placed clips, and what the next merge needs to know of the others.
pub(super) struct Placed<'a> {
    pub clips: Vec<(&'a Member, PlacedClip)>,
    /// The number of the first clips whose poses do not depend on a clip that comes last: those of full blocks.
    pub resting: usize,
    pub pairs: Vec<Pair>,
    pub known: Vec<KnownClip>,
    pub comparisons: Vec<Comparison>,
    pub clip_matches: Vec<ClipMatch>,
}

/// The clips with their likeliest poses by all clips of the home, before any is refined.
pub(super) struct Likeliest<'a> {
    candidates: Vec<Candidate<'a>>,
    pub known: Vec<KnownClip>,
    comparisons: Vec<Comparison>,
    clip_matches: Vec<ClipMatch>,
}

pub(super) fn likeliest<'a, E: From<Cancelled>>(
    last: &Manifest,
    members: &'a [Member],
    cache: &mut Cache<E>,
) -> Result<Likeliest<'a>, E> {
    let mut candidates = candidates(&last.known, members, cache)?;
    let clip_matches = clip_matches((&last.known, &last.clip_matches), &candidates, cache)?;
    let forest = forest(&candidates, &clip_matches);
    pass_poses(&mut candidates, &forest.branches);
    let comparisons = joint::compare((&last.known, &last.comparisons), &candidates, cache)?;
    let marginals = joint::marginals(&candidates, &comparisons, &forest, cache.progress)?;
    let known = candidates.iter().zip(marginals).map(|(clip, marginal)| clip.known(marginal)).collect();
    Ok(Likeliest { candidates, known, comparisons, clip_matches })
}

pub(super) fn place<'a, E: From<Cancelled>>(
    last: &Manifest,
    members: &'a [Member],
    cache: &mut Cache<E>,
) -> Result<Placed<'a>, E> {
    let Likeliest { candidates, known, comparisons, clip_matches } = likeliest(last, members, cache)?;
    let each = candidates.iter().zip(&known).enumerate();
    let placed = each.filter_map(|(place, (clip, known))| with_pose(place, clip, known.marginal));
    let placed: Vec<Known> = placed.collect();
    let pairs = overlaps(last, &placed, cache)?;
    let clips = together(&placed, &pairs, &clip_matches, cache.progress)?;
    let full = block(members.len());
    let resting = placed.partition_point(|clip| block(clip.place) < full);
    Ok(Placed { clips, resting, pairs, known, comparisons, clip_matches })
}

/// Returns a clip at its likeliest pose; none if its pose is not known. A clip that is aligned by itself, or
/// that a person placed, always has a pose.
fn with_pose<'a, 'c>(
    place: usize,
    candidate: &'c Candidate<'a>,
    marginal: Option<Marginal>,
) -> Option<Known<'a, 'c>> {
    /// Typical standard deviations (x_m, y_m, yaw_rad): alternatives carry no covariance.
    const SPREAD: [f64; 3] = [0.03, 0.03, 0.01];
    // The first mode is that of the clip's own alignment, or that of the person.
    let (by, mode, covariance) = match &candidate.member.verdict {
        Verdict::Aligned { covariance, .. } => (PlacedBy::Alignment, 0, Some(*covariance)),
        Verdict::Chosen { .. } => (PlacedBy::Person, 0, None),
        Verdict::Ambiguous { .. } | Verdict::Unplaced => {
            let sure = marginal.filter(|marginal| marginal.probability >= MIN_PLACED_PROBABILITY)?;
            (PlacedBy::Neighbours, sure.mode, Some(Matrix3::from_diagonal(&SPREAD.map(|s| s * s).into())))
        }
    };
    let probability = marginal.map(|marginal| marginal.probability);
    Some(Known { candidate, place, by, probability, alone: candidate.modes[mode], covariance })
}

/// Returns the pairs of clips with the neighbours that they choose, in canonical order.
fn overlaps<E: From<Cancelled>>(
    last: &Manifest,
    known: &[Known],
    cache: &mut Cache<E>,
) -> Result<Vec<Pair>, E> {
    let before: FxHashMap<(&str, &str), &Pair> =
        last.pairs.iter().map(|pair| ((&*pair.a, &*pair.b), pair)).collect();
    let mut pairs: Vec<Pair> = Vec::new();
    for (i, chosen) in chosen(last, known, cache.progress)?.into_iter().enumerate() {
        let b = &known[i];
        // The pairs to register, by their places among the pairs.
        let mut fresh: Vec<(usize, &Known)> = Vec::new();
        for a in chosen.into_iter().map(|a| &known[a]) {
            let pair = a.pair_with(b);
            let poses = |pair: &Pair| (pair.map_from_a, pair.rise_of_a_m, pair.map_from_b, pair.rise_of_b_m);
            let same = before.get(&(&*a.member().contribution, &*b.member().contribution));
            let same = same.filter(|before| poses(before) == poses(&pair));
            if same.is_none() {
                fresh.push((pairs.len(), a));
            }
            pairs.push(same.map_or(pair, |before| (*before).clone()));
        }
        if !joint::downwards(i, known.len()) {
            fresh.reverse();
        }
        let others: Vec<&Member> = fresh.iter().map(|(_, a)| a.member()).collect();
        let registered = cache.with_each(b.member(), &others, |at, a, b| {
            let pair = &pairs[fresh[at].0];
            let map_from_a = raised_pose(&pair.map_from_a, pair.rise_of_a_m);
            let map_from_b = raised_pose(&pair.map_from_b, pair.rise_of_b_m);
            overlap(a.surface(), b.surface(), &(map_from_b.inverse() * map_from_a))
        })?;
        for ((at, _), overlap) in fresh.iter().zip(registered) {
            pairs[*at].overlap = overlap;
        }
    }
    Ok(pairs)
}

/// Returns the clips that each clip is registered to. Clips with the same clips before them as in the last map keep
/// theirs.
fn chosen(last: &Manifest, known: &[Known], progress: &dyn Progress) -> Result<Vec<Vec<usize>>, Cancelled> {
    let is_old = last.known.iter().any(|known| known.footprint.is_none());
    let is_same = |(clip, last): &(&Known, &PlacedClip)| {
        let Mode { level, map_from_clip, rise_m, .. } = clip.alone;
        clip.member().contribution == last.contribution
            && (level, map_from_clip, rise_m) == (last.level, last.alone, last.rise_m)
    };
    let same = if is_old { 0 } else { known.iter().zip(&last.clips).take_while(is_same).count() };
    let place: FxHashMap<&str, usize> =
        known.iter().enumerate().map(|(i, clip)| (&*clip.member().contribution, i)).collect();
    let mut chosen: Vec<Vec<usize>> = vec![Vec::new(); known.len()];
    for pair in &last.pairs {
        if let (Some(a), Some(b)) = (place.get(&*pair.a), place.get(&*pair.b))
            && *b < same
        {
            chosen[*b].push(*a);
        }
    }
    if same == known.len() {
        return Ok(chosen);
    }
    let placed = |clip: &Known| clip.candidate.footprint.placed(&clip.alone.map_from_clip, clip.alone.rise_m);
    let placed: Vec<PlacedFootprint> = known.par_iter().map(placed).collect();
    let fresh = (same..known.len()).into_par_iter().map(|i| -> Result<Vec<usize>, Cancelled> {
        progress::check(progress)?;
        let b = &known[i];
        let in_map = |clip: &Known| clip.candidate.extent.in_map(&clip.alone.map_from_clip);
        let box_of_b = in_map(b);
        let meets = |a: &Known| a.alone.level == b.alone.level && in_map(a).shared_m2(&box_of_b) > 0.0;
        let before: Vec<(usize, &PlacedFootprint)> =
            (0..i).filter(|a| meets(&known[*a])).map(|a| (a, &placed[a])).collect();
        Ok(neighbours(&placed[i], &before))
    });
    chosen.splice(same.., fresh.collect::<Result<Vec<_>, Cancelled>>()?);
    Ok(chosen)
}

/// Refines the clips jointly, block by block.
fn together<'a>(
    known: &[Known<'a, '_>],
    pairs: &[Pair],
    clip_matches: &[ClipMatch],
    progress: &dyn Progress,
) -> Result<Vec<(&'a Member, PlacedClip)>, Cancelled> {
    let edges = edges(known, pairs, clip_matches);
    let mut priors: Vec<Prior> = known
        .iter()
        .map(|clip| Prior {
            map_from_clip: clip.alone.in_space(),
            covariance: clip.covariance,
            is_fixed: true,
        })
        .collect();
    let mut with: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); known.len()];
    for Edge { a, b, .. } in &edges {
        with[*a].insert(*b);
        with[*b].insert(*a);
    }
    let mut poses: Vec<(Pose2, FloorCorrection)> = Vec::new();
    for block in known.chunk_by(|a, b| block(a.place) == block(b.place)) {
        progress::check(progress)?;
        let range = poses.len()..poses.len() + block.len();
        priors[range.clone()].iter_mut().for_each(|prior| prior.is_fixed = false);
        let of_block: Vec<Edge> = edges.iter().filter(|edge| range.contains(&edge.b)).copied().collect();
        let refined = refine_poses(&priors, &of_block, &KERNELS);
        for i in range {
            let (pose, correction) = if with[i].is_empty() {
                (known[i].alone.map_from_clip, FloorCorrection::of_rise(known[i].alone.rise_m))
            } else {
                split_pose(&refined[i])
            };
            let (pose, correction) = rounded(&pose, &correction);
            // A person's choice stays bit-identical in the plane.
            let pose = if known[i].covariance.is_none() { known[i].alone.map_from_clip } else { pose };
            poses.push((pose, correction));
            priors[i].map_from_clip = pose_in_space(&pose, &correction);
            priors[i].is_fixed = true;
        }
    }
    let placed = |((clip, (pose, floor_correction)), with): ((&Known<'a, '_>, _), BTreeSet<usize>)| {
        let member = clip.member();
        let placed = PlacedClip {
            clip: member.clip,
            contribution: member.contribution.clone(),
            recorded_at_ms: member.recorded_at_ms,
            by: clip.by,
            probability: clip.probability,
            level: clip.alone.level,
            alone: clip.alone.map_from_clip,
            rise_m: clip.alone.rise_m,
            map_from_clip: pose,
            floor_correction,
            with: with.into_iter().map(|at| known[at].member().contribution.clone()).collect(),
            extent: clip.candidate.extent,
            tiles: Vec::new(),
            points: clip.candidate.points,
        };
        (member, placed)
    };
    Ok(known.iter().zip(poses).zip(with).map(placed).collect())
}

/// Returns the edges of the pose graph, in canonical order: the registered pairs, and the matches of clips whose own poses
/// are too far apart. The first clip of an edge is before the second one.
fn edges<'o>(known: &[Known], pairs: &'o [Pair], clip_matches: &'o [ClipMatch]) -> Vec<Edge<'o>> {
    let place: FxHashMap<&str, usize> =
        known.iter().enumerate().map(|(i, k)| (&*k.member().contribution, i)).collect();
    let mut edges: BTreeMap<(usize, usize), &Overlap> = BTreeMap::new();
    for clip_match in clip_matches {
        let (Some(a), Some(b)) = (place.get(&*clip_match.a), place.get(&*clip_match.b)) else { continue };
        let (at_a, at_b) = (&known[*a].alone, &known[*b].alone);
        if at_a.level == at_b.level
            && let Some(overlap) = clip_match.overlap_at(&at_a.map_from_clip, &at_b.map_from_clip)
        {
            edges.insert((*a, *b), overlap);
        }
    }
    for pair in pairs {
        if let (Some(a), Some(b), Some(overlap)) = (place.get(&*pair.a), place.get(&*pair.b), &pair.overlap) {
            edges.insert((*a, *b), overlap);
        }
    }
    edges.into_iter().map(|((a, b), overlap)| Edge { a, b, overlap }).collect()
}
