//! Joint registration: the probabilities of all clips' possible poses, by what the clips saw of each other.
//!
//! Each clip is at one of the poses that its own alignment lists, or elsewhere. Each pair of clips adds
//! evidence for each pair of their poses: surfaces that agree, surfaces that contradict each other, and matches. A
//! clip's probability is its marginal over the poses of all clips. The model is a function of the set of
//! clips.

use super::agreement::{Agreement, Side};
use super::belief::{Factor, Model};
use super::cache::{Cache, Loaded};
use super::candidates::{Candidate, KnownClip, Marginal};
use super::clip_matches::{Branch, Forest, is_likely};
use super::members::{Extent, Member, Mode};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::progress::{Cancelled, Progress};

/// Maximum poses of other clips that a pose is compared with; those that share the most floor with it, by
/// their probability.
const MAX_PARTNERS: usize = 24;
/// Maximum clips that a clip with a pose of its own is compared with of those before it that have one, too: the clip
/// that comes last is compared with few, however many there are.
const MAX_DECIDED: usize = 8;

/// Bounds of the log-likelihood ratio of a pair of poses, and its weight if it contradicts: clips that see the
/// same place repeat the same contradiction. Chosen by log loss on the same homes.
const MAX_FOR: f64 = 2.0;
const MAX_AGAINST: f64 = 8.0;
const TEMPERING: f64 = 0.5;
/// Minimum patches of a place that a decided clip saw.
const MIN_SEEN: u32 = 5;
/// Smallest probability of a state.
const MIN_PROBABILITY: f64 = 1e-6;
/// Poses of one clip this near to each other are the same explanation.
const NEAR_M: f64 = 0.2;
const NEAR_RAD: f64 = 7f64.to_radians();

/// Agreement of two clips at their possible poses, named by their contributions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    pub a: String,
    pub b: String,
    /// Index of a pose of `a`, of one of `b`, and their agreement.
    pub said: Vec<(u8, u8, Agreement)>,
}

/// Two clips, and the pairs of their modes to compare.
type Pairs = BTreeMap<(usize, usize), Vec<(u8, u8)>>;

/// Returns the pairs of modes that may see each other: `a` before `b`.
fn pairs(candidates: &[Candidate]) -> Pairs {
    let modes: Vec<(usize, u8)> = candidates
        .iter()
        .enumerate()
        .flat_map(|(clip, candidate)| (0..candidate.modes.len()).map(move |mode| (clip, mode as u8)))
        .collect();
    let in_map = |&(clip, mode): &(usize, u8)| {
        candidates[clip].extent.in_map(&candidates[clip].modes[usize::from(mode)].map_from_clip)
    };
    let boxes: Vec<Extent> = modes.iter().map(in_map).collect();
    let partners = |(&(clip, mode), this_box): (&(usize, u8), &Extent)| -> Vec<((usize, u8), (usize, u8))> {
        let this = &candidates[clip];
        // A person's choices need no evidence.
        let is_open = |other: usize| other != clip && !(this.is_chosen() && candidates[other].is_chosen());
        let level = this.modes[usize::from(mode)].level;
        let (mut shared, mut decided) = (Vec::new(), Vec::new());
        let others = modes.iter().zip(&boxes).filter(|((other, _), _)| is_open(*other));
        for (&(other, at), other_box) in others {
            let (candidate, there) = (&candidates[other], candidates[other].modes[usize::from(at)]);
            let are_decided = !this.is_open() && !candidate.is_open();
            // Nothing on one level is seen from another.
            if there.level != level || (are_decided && other > clip) {
                continue;
            }
            let shared_m2 = this_box.shared_m2(other_box);
            if shared_m2 > 0.0 {
                let list = if are_decided { &mut decided } else { &mut shared };
                list.push((shared_m2 * there.probability, (other, at)));
            }
        }
        let ordered = |other: (usize, u8)| ((clip, mode).min(other), (clip, mode).max(other));
        let most = [(shared, MAX_PARTNERS), (decided, MAX_DECIDED)].map(|(list, most)| largest(list, most));
        most.into_iter().flatten().map(ordered).collect()
    };
    let mut kept: Vec<((usize, u8), (usize, u8))> =
        modes.par_iter().zip(&boxes).flat_map_iter(partners).collect();
    kept.sort_unstable();
    kept.dedup();
    let mut pairs = Pairs::new();
    for ((a, mode_a), (b, mode_b)) in kept {
        pairs.entry((a, b)).or_default().push((mode_a, mode_b));
    }
    pairs
}

/// Returns the values with the largest weights; of equal ones the first.
fn largest(mut weighed: Vec<(f64, (usize, u8))>, most: usize) -> Vec<(usize, u8)> {
    weighed.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    weighed.into_iter().take(most).map(|(_, value)| value).collect()
}

/// Compares all pairs of clips at the poses where they may see each other, in canonical order. Comparisons
/// of the last merge, `said` of the clips in `known`, are reused.
pub(super) fn compare<E: From<Cancelled>>(
    (known, said): (&[KnownClip], &[Comparison]),
    candidates: &[Candidate],
    cache: &mut Cache<E>,
) -> Result<Vec<Comparison>, E> {
    let before: FxHashMap<&str, &KnownClip> =
        known.iter().map(|known| (&*known.contribution, known)).collect();
    let is_same = |candidate: &Candidate| {
        before.get(&*candidate.member.contribution).is_some_and(|known| candidate.has_modes_of(known))
    };
    let same: Vec<bool> = candidates.iter().map(is_same).collect();
    let said: FxHashMap<(&str, &str), &Comparison> =
        said.iter().map(|one| ((&*one.a, &*one.b), one)).collect();
    let (mut comparisons, mut fresh) = (Vec::new(), Vec::new());
    for ((a, b), modes) in pairs(candidates) {
        let name = |clip: usize| candidates[clip].member.contribution.clone();
        let mut comparison = Comparison { a: name(a), b: name(b), said: Vec::new() };
        let old = said.get(&(&*comparison.a, &*comparison.b)).copied().filter(|_| same[a] && same[b]);
        comparison.said = modes.into_iter().map(|(m, n)| (m, n, Agreement::default())).collect();
        if !old.is_some_and(|old| comparison.reuse(old)) {
            fresh.push((b, a, comparisons.len()));
        }
        comparisons.push(comparison);
    }
    // By the later clip, which is loaded once.
    fresh.sort_unstable();
    for of_one in fresh.chunk_by(|x, y| x.0 == y.0) {
        let mut of_one = of_one.to_vec();
        if downwards(of_one[0].0, candidates.len()) {
            of_one.reverse();
        }
        let later = &candidates[of_one[0].0];
        let others: Vec<&Member> = of_one.iter().map(|(_, a, _)| candidates[*a].member).collect();
        let filled = cache.with_each(later.member, &others, |at, a, b| {
            let (_, first, place) = of_one[at];
            comparisons[place].filled([(&candidates[first], a), (later, b)])
        })?;
        for ((_, _, at), comparison) in of_one.iter().zip(filled) {
            comparisons[*at] = comparison;
        }
    }
    Ok(comparisons)
}

/// Returns whether the partners of a clip are loaded in the reverse order. Each pass over the clips begins with those
/// that the last one loaded, which are still in the cache: the last clip's comparisons go down, its registrations
/// up, and its tiles down again.
pub(super) fn downwards(clip: usize, clips: usize) -> bool {
    (clips - clip) % 2 == 1
}

impl Comparison {
    /// Takes the agreements of an earlier comparison; returns false if it lacks one.
    fn reuse(&mut self, old: &Comparison) -> bool {
        let known: FxHashMap<(u8, u8), Agreement> =
            old.said.iter().map(|(m, n, agreement)| ((*m, *n), *agreement)).collect();
        self.said
            .iter_mut()
            .all(|(m, n, agreement)| known.get(&(*m, *n)).map(|known| *agreement = *known).is_some())
    }

    /// Returns the comparison with its agreements.
    fn filled(&self, clips: [(&Candidate, &Loaded); 2]) -> Comparison {
        let side = |which: usize, mode: u8| {
            let (candidate, loaded) = clips[which];
            let pose = candidate.modes[usize::from(mode)].in_space();
            Side::new(loaded.surface(), &loaded.contribution.views, pose)
        };
        let agreement = |&(m, n, _): &(u8, u8, Agreement)| (m, n, Agreement::of(&side(0, m), &side(1, n)));
        Comparison { said: self.said.par_iter().map(agreement).collect(), ..self.clone() }
    }
}

/// Returns the marginals of all candidates; `None` for those that a person placed.
pub(super) fn marginals(
    candidates: &[Candidate],
    comparisons: &[Comparison],
    forest: &Forest,
    progress: &dyn Progress,
) -> Result<Vec<Option<Marginal>>, Cancelled> {
    let states = |candidate: &Candidate| -> Vec<f64> {
        let listed = candidate.modes.iter().map(|mode| mode.probability);
        // The last state: elsewhere. A state of probability 0 stays possible.
        listed.chain([candidate.elsewhere()]).map(|p| p.max(MIN_PROBABILITY).ln()).collect()
    };
    let mut model = Model { states: candidates.iter().map(states).collect(), pairs: Vec::new() };
    let evidence = Evidence::new(candidates, comparisons, forest.alike);
    let mut matched: FxHashMap<(usize, usize), &Branch> =
        forest.branches.iter().map(|branch| ((branch.a, branch.b), branch)).collect();
    for (a, b, comparison) in &evidence.comparisons {
        let branch = matched.remove(&(*a, *b));
        let weights = evidence.weights([*a, *b], &comparison.said, branch);
        model.pairs.push(Factor { a: *a, b: *b, weights });
    }
    // Clips that see no floor in common at any of their poses.
    for branch in forest.branches.iter().filter(|branch| matched.contains_key(&(branch.a, branch.b))) {
        let weights = evidence.weights([branch.a, branch.b], &[], Some(branch));
        model.pairs.push(Factor { a: branch.a, b: branch.b, weights });
    }
    model.pairs.retain(|pair| pair.weights.iter().any(|weight| *weight != 0.0));
    let marginals = model.marginals(progress)?;
    Ok(candidates.iter().zip(marginals).map(|(candidate, states)| of_modes(candidate, &states)).collect())
}

/// The evidence of the comparisons.
///
/// Contradictions count for every pair. Agreement counts only with clips that have one pose, and for each pose
/// of a clip once, however many of them see the place: rooms that look alike agree as well, and clips of
/// several such rooms would otherwise gather in one of them.
struct Evidence<'a> {
    candidates: &'a [Candidate<'a>],
    /// True for a clip with a pose of its own, by candidate.
    is_decided: Vec<bool>,
    /// With the indices of their candidates.
    comparisons: Vec<(usize, usize, &'a Comparison)>,
    /// Number of decided clips that agree with a clip at a mode.
    supporters: FxHashMap<(usize, u8), u32>,
    /// Modes whose place a decided clip saw.
    seen: FxHashSet<(usize, u8)>,
    /// Maximum log weight of an agreement at one of several likely poses, if no decided clip saw the place of another one.
    alike: f64,
}

impl<'a> Evidence<'a> {
    fn new(candidates: &'a [Candidate<'a>], comparisons: &'a [Comparison], alike: f64) -> Evidence<'a> {
        let place: FxHashMap<&str, usize> = candidates
            .iter()
            .enumerate()
            .map(|(i, candidate)| (&*candidate.member.contribution, i))
            .collect();
        let placed = |one: &'a Comparison| Some((*place.get(&*one.a)?, *place.get(&*one.b)?, one));
        let mut evidence = Evidence {
            candidates,
            is_decided: candidates.iter().map(|candidate| !candidate.is_open()).collect(),
            comparisons: comparisons.iter().filter_map(placed).collect(),
            supporters: FxHashMap::default(),
            seen: FxHashSet::default(),
            alike,
        };
        for (a, b, comparison) in &evidence.comparisons {
            for (m, n, agreement) in &comparison.said {
                if agreement.patches() >= MIN_SEEN {
                    let ends = [((*a, *m), *b), ((*b, *n), *a)].into_iter();
                    let by_decided = ends.filter(|(_, other)| evidence.is_decided[*other]);
                    evidence.seen.extend(by_decided.map(|(mode, _)| mode));
                }
                if agreement.log_likelihood_ratio() > 0.0 {
                    for (one, other) in [((*a, *m), *b), ((*b, *n), *a)] {
                        let counts = evidence.is_decided[other];
                        *evidence.supporters.entry(one).or_default() += u32::from(counts);
                    }
                }
            }
        }
        evidence
    }

    /// Returns the log weights of two clips at all their states, the last of which is elsewhere. A match replaces
    /// the agreement of their surfaces, which is a part of it.
    fn weights(&self, [a, b]: [usize; 2], said: &[(u8, u8, Agreement)], branch: Option<&Branch>) -> Vec<f64> {
        let (of_a, of_b) = (&self.candidates[a].modes, &self.candidates[b].modes);
        let columns = of_b.len() + 1;
        let mut weights = vec![0.0; (of_a.len() + 1) * columns];
        for (m, n, agreement) in said {
            if let Some(weight) = weights.get_mut(usize::from(*m) * columns + usize::from(*n)) {
                let both = self.weight((a, *m), (b, *n), agreement);
                *weight = if branch.is_some() { both.min(0.0) } else { both };
            }
        }
        let Some(branch) = branch else { return weights };
        let clips = [&self.candidates[a], &self.candidates[b]];
        for m in 0..of_a.len() {
            for n in 0..of_b.len() {
                let matched = branch.weight(clips, [m, n]);
                let weight = &mut weights[m * columns + n];
                *weight = if matched > 0.0 { matched } else { *weight };
            }
        }
        // Elsewhere, both may be together.
        weights[of_a.len() * columns + of_b.len()] = branch.log_odds;
        weights
    }

    /// Returns the log weight of two clips at these modes.
    fn weight(&self, a: (usize, u8), b: (usize, u8), agreement: &Agreement) -> f64 {
        let ratio = agreement.log_likelihood_ratio();
        if ratio <= 0.0 {
            return TEMPERING * ratio.max(-MAX_AGAINST);
        }
        let (decided_a, decided_b) = (self.is_decided[a.0], self.is_decided[b.0]);
        let supporters = |mode: (usize, u8), by: bool| {
            if by { self.supporters.get(&mode).copied().unwrap_or_default() } else { 0 }
        };
        let most = supporters(a, decided_b).max(supporters(b, decided_a));
        let bound = if self.is_alike(a) || self.is_alike(b) { MAX_FOR.min(self.alike) } else { MAX_FOR };
        if most == 0 { 0.0 } else { ratio.min(bound) / f64::from(most) }
    }

    /// Returns whether this pose and another one are likely, and no decided clip saw the place of the other one: a surface
    /// there might agree as well.
    fn is_alike(&self, (clip, mode): (usize, u8)) -> bool {
        let candidate = &self.candidates[clip];
        let Some(this) = candidate.modes.get(usize::from(mode)) else { return false };
        let is_rival = |other: &Mode| is_likely(candidate, other) && !is_near(other, this);
        let mut rivals = (0u8..).zip(&candidate.modes).filter(|(_, other)| is_rival(other));
        is_likely(candidate, this) && rivals.any(|(other, _)| !self.seen.contains(&(clip, other)))
    }
}

fn of_modes(candidate: &Candidate, states: &[f64]) -> Option<Marginal> {
    if candidate.is_chosen() {
        return None;
    }
    let best = (0..candidate.modes.len()).rev().max_by(|a, b| states[*a].total_cmp(&states[*b]))?;
    let likeliest = &candidate.modes[best];
    // Alternatives may lie so close together that one is right if the other is.
    let near = candidate.modes.iter().zip(states).filter(|(mode, _)| is_near(mode, likeliest));
    Some(Marginal { mode: best, probability: near.map(|(_, probability)| probability).sum::<f64>().min(1.0) })
}

fn is_near(a: &Mode, b: &Mode) -> bool {
    a.level == b.level && a.map_from_clip.is_within(&b.map_from_clip, NEAR_M, NEAR_RAD)
}

#[cfg(test)]
pub(super) mod tests;
