//! Poses of a home's clips: each by itself, then jointly.

use super::cache::{Cache, Loaded};
use super::level::{Level, apart, in_space};
use super::members::{Extent, Member, PlacedBy, PlacedClip, Verdict};
use super::neighbours::{self, Asked, Neighbour};
use super::overlap::{Overlap, overlap};
use super::settle::{Edge, FADE, Prior, settle};
use super::sight::Sights;
use super::{Manifest, Opinion, Pair};
use nalgebra::Matrix3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::sync::Arc;
use viola_geometry::Pose2;

/// Maximum neighbours of a clip in its pose graph; those with the largest overlap are kept.
const MAX_NEIGHBOURS: usize = 24;

/// A clip with a known pose.
struct Known<'a> {
    member: &'a Member,
    by: PlacedBy,
    probability: Option<f64>,
    alone: Pose2,
    /// None for a fixed pose.
    covariance: Option<Matrix3<f64>>,
    extent: Extent,
    points: usize,
}

/// The placed clips and the compared pairs.
pub(super) struct Placed<'a> {
    pub clips: Vec<(&'a Member, PlacedClip)>,
    pub pairs: Vec<Pair>,
    pub opinions: Vec<Opinion>,
}

pub(super) fn place<'a, E>(
    last: &Manifest,
    members: &'a [Member],
    cache: &mut Cache<E>,
) -> Result<Placed<'a>, E> {
    let mut known = Vec::new();
    let before: FxHashMap<&str, &PlacedClip> = last.clips.iter().map(|clip| (&*clip.share, clip)).collect();
    for member in members {
        let (by, alone, covariance, probability) = match &member.verdict {
            Verdict::Aligned { map_from_clip, covariance, probability } => {
                (PlacedBy::Alignment, *map_from_clip, Some(*covariance), *probability)
            }
            Verdict::Chosen { map_from_clip } => (PlacedBy::Person, *map_from_clip, None, None),
            Verdict::Ambiguous { .. } => continue,
        };
        let (extent, points) = match before.get(&*member.share) {
            Some(before) => (before.extent, before.points),
            None => {
                let loaded = cache.get(member)?;
                (loaded.extent(), loaded.share.cloud_in_clip.points.len())
            }
        };
        known.push(Known { member, by, probability, alone, covariance, extent, points });
    }
    let (decided, opinions) = ask_neighbours(last, members, &known, cache)?;
    known.extend(decided);
    known.sort_by(|a, b| a.member.order().cmp(&b.member.order()));
    let pairs = compare(last, &known, cache)?;
    let clips = together(&before, &known, &pairs);
    Ok(Placed { clips, pairs, opinions })
}

/// Returns the ambiguous clips that their neighbours resolve, and the agreements. Only clips with a pose of
/// their own are neighbours, so the result does not depend on the order.
fn ask_neighbours<'a, E>(
    last: &Manifest,
    members: &'a [Member],
    known: &[Known<'a>],
    cache: &mut Cache<E>,
) -> Result<(Vec<Known<'a>>, Vec<Opinion>), E> {
    let said: FxHashMap<(&str, usize, &str), &Opinion> = last
        .opinions
        .iter()
        .map(|opinion| ((&*opinion.asked, opinion.alternative, &*opinion.neighbour), opinion))
        .collect();
    let (mut decided, mut opinions) = (Vec::new(), Vec::new());
    for member in members {
        let Verdict::Ambiguous { alternatives } = &member.verdict else { continue };
        let asked = cache.get(member)?;
        let extent = asked.extent();
        let mut agreements = vec![Vec::new(); alternatives.len()];
        for (alternative, (pose, _)) in alternatives.iter().enumerate() {
            for other in known.iter().filter(|other| extent.meets(pose, &other.extent, &other.alone)) {
                let before = said.get(&(&*member.share, alternative, &*other.member.share));
                let said = match before.filter(|opinion| opinion.map_from_neighbour == other.alone) {
                    Some(opinion) => opinion.said,
                    None => {
                        let loaded = cache.get(other.member)?;
                        let map_from_clip = in_space(&other.alone, &Level::default());
                        let neighbour = Neighbour {
                            map_from_clip,
                            surface: loaded.surface(),
                            sights: Sights::new(&loaded.share.views, &map_from_clip),
                        };
                        let asked = Asked { surface: asked.surface(), views: &asked.share.views };
                        let pose = in_space(pose, &Level::default());
                        neighbours::agreement(&asked, &pose, &neighbour)
                    }
                };
                agreements[alternative].push(said);
                opinions.push(Opinion {
                    asked: member.share.clone(),
                    alternative,
                    neighbour: other.member.share.clone(),
                    map_from_neighbour: other.alone,
                    said,
                });
            }
        }
        if let Some((place, probability)) = neighbours::decide(alternatives, &agreements) {
            /// Typical standard deviations (x_m, y_m, yaw_rad): alternatives carry no covariance.
            const SPREAD: [f64; 3] = [0.03, 0.03, 0.01];
            decided.push(Known {
                member,
                by: PlacedBy::Neighbours,
                probability: Some(probability),
                alone: alternatives[place].0,
                covariance: Some(Matrix3::from_diagonal(&SPREAD.map(|s| s * s).into())),
                extent,
                points: asked.share.cloud_in_clip.points.len(),
            });
        }
    }
    Ok((decided, opinions))
}

/// Returns all pairs of clips whose boxes meet, in canonical order.
fn compare<E>(last: &Manifest, known: &[Known], cache: &mut Cache<E>) -> Result<Vec<Pair>, E> {
    let before: FxHashMap<(&str, &str), &Pair> =
        last.pairs.iter().map(|pair| ((&*pair.a, &*pair.b), pair)).collect();
    let mut pairs = Vec::new();
    for (i, b) in known.iter().enumerate() {
        let meeting = known[..i].iter().filter(|a| a.extent.meets(&a.alone, &b.extent, &b.alone));
        let mut fresh: Vec<(Pair, Arc<Loaded>)> = Vec::new();
        for a in meeting {
            let same = before.get(&(&*a.member.share, &*b.member.share));
            match same.filter(|pair| pair.map_from_a == a.alone && pair.map_from_b == b.alone) {
                Some(pair) => pairs.push((*pair).clone()),
                None => {
                    let pair = Pair {
                        a: a.member.share.clone(),
                        b: b.member.share.clone(),
                        map_from_a: a.alone,
                        map_from_b: b.alone,
                        overlap: None,
                    };
                    fresh.push((pair, cache.get(a.member)?));
                }
            }
        }
        if !fresh.is_empty() {
            let b = cache.get(b.member)?;
            fresh.par_iter_mut().for_each(|(pair, a)| {
                let (map_from_a, map_from_b) = (&pair.map_from_a, &pair.map_from_b);
                let level = Level::default();
                let start = in_space(map_from_b, &level).inverse() * in_space(map_from_a, &level);
                pair.overlap = overlap(a.surface(), b.surface(), &start);
            });
        }
        pairs.extend(fresh.into_iter().map(|(pair, _)| pair));
    }
    Ok(pairs)
}

/// Refines each clip with the clips that it overlaps.
fn together<'a>(
    before: &FxHashMap<&str, &PlacedClip>,
    known: &[Known<'a>],
    pairs: &[Pair],
) -> Vec<(&'a Member, PlacedClip)> {
    let place: FxHashMap<&str, usize> =
        known.iter().enumerate().map(|(i, k)| (&*k.member.share, i)).collect();
    let mut overlaps: FxHashMap<(usize, usize), &Overlap> = FxHashMap::default();
    let mut neighbours: Vec<Vec<(usize, usize)>> = vec![Vec::new(); known.len()];
    for pair in pairs {
        let (Some(overlap), Some(&a), Some(&b)) = (&pair.overlap, place.get(&*pair.a), place.get(&*pair.b))
        else {
            continue;
        };
        overlaps.insert((a, b), overlap);
        neighbours[a].push((overlap.found, b));
        neighbours[b].push((overlap.found, a));
    }
    let settled = |(i, clip): (usize, &Known<'a>)| {
        let mut near = neighbours[i].clone();
        near.sort_by_key(|(found, at)| (std::cmp::Reverse(*found), *at));
        near.truncate(MAX_NEIGHBOURS);
        near.sort_by_key(|(_, at)| *at);
        let near: Vec<usize> = near.into_iter().map(|(_, at)| at).collect();
        let with: Vec<String> = near.iter().map(|at| known[*at].member.share.clone()).collect();
        let unchanged = before.get(&*clip.member.share).filter(|old| {
            let stands = |share: &String| {
                let (Some(old), Some(at)) = (before.get(&**share), place.get(&**share)) else { return false };
                old.alone == known[*at].alone && old.by == known[*at].by
            };
            old.alone == clip.alone && old.by == clip.by && old.with == with && with.iter().all(stands)
        });
        let (map_from_clip, level) = match unchanged {
            Some(old) => (old.map_from_clip, old.level),
            None => solve(i, &near, known, &overlaps),
        };
        let placed = PlacedClip {
            clip: clip.member.clip,
            share: clip.member.share.clone(),
            recorded_at_ms: clip.member.recorded_at_ms,
            by: clip.by,
            probability: clip.probability,
            alone: clip.alone,
            map_from_clip,
            level,
            with,
            extent: clip.extent,
            tiles: Vec::new(),
            points: clip.points,
        };
        (clip.member, placed)
    };
    known.iter().enumerate().collect::<Vec<_>>().into_par_iter().map(settled).collect()
}

fn solve(
    first: usize,
    near: &[usize],
    known: &[Known],
    overlaps: &FxHashMap<(usize, usize), &Overlap>,
) -> (Pose2, Level) {
    let chosen: Vec<usize> = std::iter::once(first).chain(near.iter().copied()).collect();
    let clips: Vec<Prior> = chosen
        .iter()
        .map(|at| Prior {
            map_from_clip: in_space(&known[*at].alone, &Level::default()),
            covariance: known[*at].covariance,
        })
        .collect();
    let mut edges = Vec::new();
    for (i, a) in chosen.iter().enumerate() {
        for (j, b) in chosen.iter().enumerate() {
            if let Some(overlap) = overlaps.get(&(*a, *b)) {
                edges.push(Edge { a: i, b: j, overlap });
            }
        }
    }
    let alone = (known[first].alone, Level::default());
    let settled = settle(&clips, &edges, FADE).map_or(alone, |pose| apart(&pose));
    // A person's choice stays bit-identical in the plane.
    if known[first].covariance.is_none() { (known[first].alone, settled.1) } else { settled }
}
