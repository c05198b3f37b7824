//! Poses of a home's clips: the likeliest of each, then refined jointly.

use super::cache::{Cache, Loaded};
use super::candidates::{Candidate, KnownClip, Marginal, candidates};
use super::joint::{self, Comparison};
use super::level::{Level, apart, in_space, rounded};
use super::members::{Extent, Member, PlacedBy, PlacedClip, Verdict};
use super::overlap::{Overlap, overlap};
use super::settle::{Edge, KERNELS, Prior, settle};
use super::ties::{Tie, forest, pass_poses, ties};
use super::{Manifest, Pair};
use nalgebra::Matrix3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;
use std::sync::Arc;
use viola_geometry::{LevelName, Pose2};

/// Minimum probability to place a clip that is not aligned by itself.
pub const SURE: f64 = 0.95;
/// Edges of the pose graph that a clip keeps: the largest overlaps. The other clip may keep more of them.
const MAX_NEIGHBOURS: usize = 24;
/// Clips that are loaded at a time, to bound the memory.
const AT_A_TIME: usize = 8;

/// A clip with a pose.
struct Known<'a> {
    member: &'a Member,
    by: PlacedBy,
    probability: Option<f64>,
    level: LevelName,
    alone: Pose2,
    /// None for a fixed pose.
    covariance: Option<Matrix3<f64>>,
    extent: Extent,
    points: usize,
}

impl Known<'_> {
    /// Returns the pair of two clips, not yet registered.
    fn pair_with(&self, b: &Known) -> Pair {
        Pair {
            a: self.member.share.clone(),
            b: b.member.share.clone(),
            map_from_a: self.alone,
            map_from_b: b.alone,
            overlap: None,
        }
    }
}

/// The placed clips, and what the next merge needs to know of the others.
pub(super) struct Placed<'a> {
    pub clips: Vec<(&'a Member, PlacedClip)>,
    pub pairs: Vec<Pair>,
    pub known: Vec<KnownClip>,
    pub comparisons: Vec<Comparison>,
    pub ties: Vec<Tie>,
}

pub(super) fn place<'a, E>(
    last: &Manifest,
    members: &'a [Member],
    cache: &mut Cache<E>,
) -> Result<Placed<'a>, E> {
    let mut candidates = candidates(&last.known, members, cache)?;
    let ties = ties((&last.known, &last.ties), &candidates, cache)?;
    let forest = forest(&candidates, &ties);
    pass_poses(&mut candidates, &forest);
    let comparisons = joint::compare((&last.known, &last.comparisons), &candidates, cache)?;
    let marginals = joint::marginals(&candidates, &comparisons, &forest);
    let each = || candidates.iter().zip(&marginals);
    let placed: Vec<Known> = each().filter_map(|(candidate, marginal)| known(candidate, *marginal)).collect();
    let pairs = overlaps(last, &placed, &ties, cache)?;
    let clips = together(&placed, &pairs);
    let known = each().map(|(candidate, marginal)| candidate.known(*marginal)).collect();
    Ok(Placed { clips, pairs, known, comparisons, ties })
}

/// Returns a clip at its likeliest pose; none if its pose is not known. A clip that is aligned by itself, or
/// that a person placed, always has a pose.
fn known<'a>(candidate: &Candidate<'a>, marginal: Option<Marginal>) -> Option<Known<'a>> {
    /// Typical standard deviations (x_m, y_m, yaw_rad): alternatives carry no covariance.
    const SPREAD: [f64; 3] = [0.03, 0.03, 0.01];
    let probability = marginal.map(|marginal| marginal.probability);
    let (by, level, alone, covariance) = match &candidate.member.verdict {
        Verdict::Aligned { level, map_from_clip, covariance, .. } => {
            (PlacedBy::Alignment, *level, *map_from_clip, Some(*covariance))
        }
        Verdict::Chosen { level, map_from_clip } => (PlacedBy::Person, *level, *map_from_clip, None),
        Verdict::Ambiguous { .. } | Verdict::Unplaced => {
            let sure = marginal.filter(|marginal| marginal.probability >= SURE)?;
            let spread = Matrix3::from_diagonal(&SPREAD.map(|s| s * s).into());
            let mode = &candidate.modes[sure.mode];
            (PlacedBy::Neighbours, mode.level, mode.map_from_clip, Some(spread))
        }
    };
    let Candidate { member, extent, points, .. } = *candidate;
    Some(Known { member, by, probability, level, alone, covariance, extent, points })
}

/// Returns all pairs of clips whose boxes meet, in canonical order. Ties register clips whose own poses are too
/// far apart.
fn overlaps<E>(last: &Manifest, known: &[Known], ties: &[Tie], cache: &mut Cache<E>) -> Result<Vec<Pair>, E> {
    let ties: FxHashMap<(&str, &str), &Tie> = ties.iter().map(|tie| ((&*tie.a, &*tie.b), tie)).collect();
    let before: FxHashMap<(&str, &str), &Pair> =
        last.pairs.iter().map(|pair| ((&*pair.a, &*pair.b), pair)).collect();
    let mut pairs: Vec<Pair> = Vec::new();
    for (i, b) in known.iter().enumerate() {
        // The pairs to register, by their places among the pairs.
        let mut fresh: Vec<(usize, &Known)> = Vec::new();
        let meets = |a: &&Known| a.level == b.level && a.extent.meets(&a.alone, &b.extent, &b.alone);
        for a in known[..i].iter().filter(meets) {
            let same = before.get(&(&*a.member.share, &*b.member.share));
            let same = same.filter(|pair| pair.map_from_a == a.alone && pair.map_from_b == b.alone);
            if same.is_none() {
                fresh.push((pairs.len(), a));
            }
            pairs.push(same.map_or_else(|| a.pair_with(b), |pair| (*pair).clone()));
        }
        if !joint::downwards(i, known.len()) {
            fresh.reverse();
        }
        for part in fresh.chunks(AT_A_TIME) {
            let b = cache.get(b.member)?;
            let loaded: Result<Vec<Arc<Loaded>>, E> = part.iter().map(|(_, a)| cache.get(a.member)).collect();
            let registered = part.par_iter().zip(loaded?).map(|((at, _), a)| {
                let Pair { a: name_a, b: name_b, map_from_a, map_from_b, .. } = &pairs[*at];
                let level = Level::default();
                let start = in_space(map_from_b, &level).inverse() * in_space(map_from_a, &level);
                let tied = || ties.get(&(&**name_a, &**name_b))?.overlap_at(map_from_a, map_from_b);
                overlap(a.surface(), b.surface(), &start).or_else(tied)
            });
            let registered: Vec<Option<Overlap>> = registered.collect();
            for ((at, _), overlap) in part.iter().zip(registered) {
                pairs[*at].overlap = overlap;
            }
        }
    }
    Ok(pairs)
}

/// Refines the clips jointly.
fn together<'a, 'e>(known: &[Known<'a>], pairs: &'e [Pair]) -> Vec<(&'a Member, PlacedClip)> {
    let place: FxHashMap<&str, usize> =
        known.iter().enumerate().map(|(i, k)| (&*k.member.share, i)).collect();
    let edge = |pair: &'e Pair| {
        Some(Edge { a: *place.get(&*pair.a)?, b: *place.get(&*pair.b)?, overlap: pair.overlap.as_ref()? })
    };
    let edges = largest(known.len(), pairs.iter().filter_map(edge).collect());
    let priors: Vec<Prior> = known
        .iter()
        .map(|clip| Prior {
            map_from_clip: in_space(&clip.alone, &Level::default()),
            covariance: clip.covariance,
        })
        .collect();
    let mut with: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); known.len()];
    for edge in &edges {
        with[edge.a].insert(edge.b);
        with[edge.b].insert(edge.a);
    }
    let settled = settle(&priors, &edges, &KERNELS);
    let placed = |((clip, pose), with): ((&Known<'a>, _), BTreeSet<usize>)| {
        let (pose, level) = if with.is_empty() { (clip.alone, Level::default()) } else { apart(&pose) };
        let (pose, level) = rounded(&pose, &level);
        let placed = PlacedClip {
            clip: clip.member.clip,
            share: clip.member.share.clone(),
            recorded_at_ms: clip.member.recorded_at_ms,
            by: clip.by,
            probability: clip.probability,
            level_name: clip.level,
            alone: clip.alone,
            // A person's choice stays bit-identical in the plane.
            map_from_clip: if clip.covariance.is_none() { clip.alone } else { pose },
            level,
            with: with.into_iter().map(|at| known[at].member.share.clone()).collect(),
            extent: clip.extent,
            tiles: Vec::new(),
            points: clip.points,
        };
        (clip.member, placed)
    };
    known.iter().zip(settled).zip(with).map(placed).collect()
}

/// Returns the edges that are among the largest of one of their clips.
fn largest<'e>(clips: usize, edges: Vec<Edge<'e>>) -> Vec<Edge<'e>> {
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by_key(|at| (std::cmp::Reverse(edges[*at].overlap.found), *at));
    let (mut counts, mut kept) = (vec![0; clips], vec![false; edges.len()]);
    for at in order {
        let Edge { a, b, .. } = edges[at];
        kept[at] = counts[a] < MAX_NEIGHBOURS || counts[b] < MAX_NEIGHBOURS;
        counts[a] += 1;
        counts[b] += 1;
    }
    edges.into_iter().zip(kept).filter(|(_, kept)| *kept).map(|(edge, _)| edge).collect()
}
