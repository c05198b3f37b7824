//! The matches that count: the most certain ones, without loops.
//!
//! Clips of one place repeat the same mistake, as in two rooms that look alike. A loop of matches would count it
//! several times, so each clip counts by the most certain chain of matches only.

use super::{Candidate, ClipMatch};
use crate::assemble::members::Mode;
use rustc_hash::FxHashMap;
use viola_geometry::{Pose2, groups};

/// Poses that differ by less are consistent with a match.
const NEAR_M: f64 = 0.3;
const NEAR_RAD: f64 = 10f64.to_radians();
/// Maximum poses of a clip that matches add, and the rounds in which they are passed on along chains of clips.
const MAX_ADDED: usize = 8;
const ROUNDS: usize = 8;
/// Minimum probability of a pose that is passed on.
const MIN_PASSED_PROBABILITY: f64 = 0.02;

/// Minimum probability of a pose in a room that looks alike on the map, as a fraction of that of the clip's likeliest pose.
const ALIKE: f64 = 0.3;

/// The matches that count, and how far the clips of one home can be trusted to tell rooms that look alike on the map.
#[derive(Debug, Clone, Default)]
pub(in crate::assemble) struct Forest {
    pub branches: Vec<Branch>,
    /// Maximum logarithm of the odds that equal surface is the same surface, in rooms that look alike on the map.
    pub alike: f64,
}

/// A match between two candidates, by their indices.
#[derive(Debug, Clone, Copy)]
pub(in crate::assemble) struct Branch {
    pub a: usize,
    pub b: usize,
    pub b_from_a: Pose2,
    /// Logarithm of the odds that the match is right.
    pub log_odds: f64,
    /// The same against two rooms that look alike on the map: these may look alike in pictures, too.
    pub against_alike: f64,
}

impl Branch {
    /// Returns whether modes of the two clips are consistent with the match.
    fn joins(&self, a: &Mode, b: &Mode) -> bool {
        a.level == b.level && is_near(&a.map_from_clip.compose(&self.b_from_a.inverse()), &b.map_from_clip)
    }

    /// Returns the log weight of two clips at these modes.
    pub fn weight(&self, [a, b]: [&Candidate; 2], [m, n]: [usize; 2]) -> f64 {
        let (at_a, at_b) = (&a.modes[m], &b.modes[n]);
        if self.joins(at_a, at_b) {
            return self.log_odds;
        }
        // Another likely pose of one of the clips is consistent with the match: its rooms look alike.
        let of_a = is_likely(a, at_a) && likely(a).any(|mode| self.joins(mode, at_b));
        let of_b = is_likely(b, at_b) && likely(b).any(|mode| self.joins(at_a, mode));
        if of_a || of_b { self.log_odds - self.against_alike } else { 0.0 }
    }
}

/// Returns whether a pose of a clip is about as likely as its likeliest one, before its surface is compared with others.
pub(in crate::assemble) fn is_likely(clip: &Candidate, mode: &Mode) -> bool {
    let most = clip.modes.iter().map(|mode| mode.probability).fold(0.0, f64::max);
    mode.probability > 0.0 && mode.probability >= ALIKE * most
}

fn likely<'a>(clip: &'a Candidate) -> impl Iterator<Item = &'a Mode> {
    clip.modes.iter().filter(|mode| is_likely(clip, mode))
}

pub(super) fn is_near(a: &Pose2, b: &Pose2) -> bool {
    a.is_within(b, NEAR_M, NEAR_RAD)
}

/// Odds that a match of many places is right before a home's own clips tell: weights of the right and of the wrong
/// ones.
const RIGHT_BEFORE: f64 = 2.0;
const WRONG_BEFORE: f64 = 0.5;
/// The same for rooms that look alike on the map.
const ALIKE_RIGHT_BEFORE: f64 = 1.0;
const ALIKE_WRONG_BEFORE: f64 = 1.0;
/// Logarithm of the odds by places and surfaces from which a match tells whether rooms look alike.
const TELLING: f64 = 2.0;

/// Returns the numbers of matches of many places in this home that are right and wrong by the clips that are aligned
/// by themselves. In a home whose rooms look alike, matches contradict their poses.
fn match_weights(candidates: &[Candidate], branches: &[Branch]) -> (f64, f64) {
    let (mut right, mut wrong) = (0.0, 0.0);
    for branch in branches.iter().filter(|branch| branch.log_odds >= TELLING) {
        let [a, b] = [branch.a, branch.b].map(|clip| &candidates[clip]);
        if a.is_open() || b.is_open() {
            continue;
        }
        let (Some(at_a), Some(at_b)) = (a.modes.first(), b.modes.first()) else { continue };
        let sure = at_a.probability * at_b.probability;
        if branch.joins(at_a, at_b) {
            right += sure;
        } else {
            wrong += (2.0 * sure - 1.0).max(0.0);
        }
    }
    (right, wrong)
}

/// Returns the spanning forest of the matches with the largest odds, in canonical order.
pub(in crate::assemble) fn forest(candidates: &[Candidate], clip_matches: &[ClipMatch]) -> Forest {
    let place: FxHashMap<&str, usize> =
        candidates.iter().enumerate().map(|(i, candidate)| (&*candidate.member.contribution, i)).collect();
    let branch = |clip_match: &ClipMatch| {
        let log_odds = clip_match.log_odds()?;
        let (a, b) = (*place.get(&*clip_match.a)?, *place.get(&*clip_match.b)?);
        (log_odds > 0.0).then_some(Branch {
            a,
            b,
            b_from_a: clip_match.b_from_a(),
            log_odds,
            against_alike: 0.0,
        })
    };
    let mut branches: Vec<Branch> = clip_matches.iter().filter_map(branch).collect();
    let (right, wrong) = match_weights(candidates, &branches);
    let most = ((RIGHT_BEFORE + right) / (WRONG_BEFORE + wrong)).ln();
    let alike = ((ALIKE_RIGHT_BEFORE + right) / (ALIKE_WRONG_BEFORE + wrong)).ln().max(0.0);
    if most <= 0.0 {
        return Forest { branches: Vec::new(), alike };
    }
    branches.sort_by(|x, y| y.log_odds.total_cmp(&x.log_odds).then((x.a, x.b).cmp(&(y.a, y.b))));
    let mut trees: Vec<u32> = (0..candidates.len() as u32).collect();
    branches.retain(|branch| groups::join(&mut trees, branch.a as u32, branch.b as u32));
    branches.sort_by_key(|branch| (branch.a, branch.b));
    for branch in &mut branches {
        branch.log_odds = branch.log_odds.min(most);
        branch.against_alike = branch.log_odds.min(alike);
    }
    Forest { branches, alike }
}

/// Adds the poses that matches give to clips whose own alignment left the pose open. Each of them, and all places that
/// are still unlisted together, get an equal part of the probability that the clip is at none of its own poses.
pub(in crate::assemble) fn pass_poses(candidates: &mut [Candidate], forest: &[Branch]) {
    let own: Vec<usize> = candidates.iter().map(|candidate| candidate.modes.len()).collect();
    let elsewhere: Vec<f64> = candidates.iter().map(Candidate::elsewhere).collect();
    for _ in 0..ROUNDS {
        let mut passed: Vec<(usize, Mode)> = Vec::new();
        for branch in forest {
            let ends =
                [(branch.a, branch.b, branch.b_from_a), (branch.b, branch.a, branch.b_from_a.inverse())];
            for (from, to, to_from_from) in ends {
                if !candidates[to].is_open() {
                    continue;
                }
                for mode in
                    candidates[from].modes.iter().filter(|mode| mode.probability >= MIN_PASSED_PROBABILITY)
                {
                    let map_from_clip = mode.map_from_clip.compose(&to_from_from.inverse());
                    // Above the floor of its own answer.
                    passed.push((to, Mode { map_from_clip, rise_m: 0.0, ..*mode }));
                }
            }
        }
        // Stable: equal ones stay in canonical order.
        passed.sort_by(|x, y| x.0.cmp(&y.0).then(y.1.probability.total_cmp(&x.1.probability)));
        let mut changed = false;
        for (clip, mode) in passed {
            let modes = &mut candidates[clip].modes;
            let is_known = |known: &Mode| {
                known.level == mode.level && is_near(&known.map_from_clip, &mode.map_from_clip)
            };
            let is_new = !modes.iter().any(is_known);
            if is_new && modes.len() < own[clip] + MAX_ADDED {
                modes.push(mode);
                changed = true;
            }
        }
        for (clip, candidate) in candidates.iter_mut().enumerate() {
            let added = &mut candidate.modes[own[clip]..];
            let fraction = elsewhere[clip] / (added.len() + 1) as f64;
            added.iter_mut().for_each(|mode| mode.probability = fraction);
        }
        if !changed {
            break;
        }
    }
}
