//! Resolves ambiguous clips: the observations of placed clips decide between the alternatives.

use super::sight::Sights;
use super::surface::{Surface, SurfacePoint};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use viola_geometry::{Point3, Pose2, Pose3, Vector3};
use viola_reconstruct::View;

/// Sampled points of each clip.
const SAMPLES: usize = 2_000;
/// Side of the patches of surface that count as one observation each.
const PATCH_M: f64 = 0.5;
/// Fraction of a patch's points needed to call it agreeing or differing.
const MAJORITY: f64 = 0.6;
/// Agreeing patches per differing patch at the right pose: objects move, and clips err.
const AGREEING_PER_ODD: i32 = 5;
/// Likelihood ratio of one more differing patch: wrong pose over right pose.
const LIKELIHOOD_RATIO: f64 = 1.5;
/// RMS colour difference, of 255, above which surfaces differ.
const COLOR: f64 = 60.0;
/// Minimum probability to place a clip.
const SURE: f64 = 0.95;
/// Minimum agreeing patches to place a clip: without overlap nothing is decided.
const MIN_PATCHES: i32 = 20;

/// A placed clip, as a neighbour of the ambiguous one.
pub(super) struct Neighbour<'a> {
    pub map_from_clip: Pose3,
    pub surface: &'a Surface,
    pub sights: Sights<'a>,
}

/// The ambiguous clip.
pub(super) struct Asked<'a> {
    pub surface: &'a Surface,
    pub views: &'a [View],
}

/// Numbers of surface patches that agree and differ with a neighbour's observations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Agreement {
    pub agree: i32,
    pub differ: i32,
}

/// Compares a clip at one of its alternatives with a neighbour.
pub(super) fn agreement(asked: &Asked, map_from_clip: &Pose3, neighbour: &Neighbour) -> Agreement {
    let patch = |point: &Point3| [point.x, point.y, point.z].map(|c| (c / PATCH_M).floor() as i32);
    let samples: Vec<&SurfacePoint> = asked.surface.some(SAMPLES).filter(|s| s.is_upright()).collect();
    let forward = samples.into_par_iter().map(|sample| {
        let position = map_from_clip * sample.position;
        (patch(&position), ask(&position, &(map_from_clip * sample.normal), sample.color, neighbour))
    });
    // Backward: neighbour points that this clip looked through.
    let sights = Sights::new(asked.views, map_from_clip);
    let samples: Vec<&SurfacePoint> = neighbour.surface.some(SAMPLES).filter(|s| s.is_upright()).collect();
    let backward = samples.into_par_iter().map(|sample| {
        let position = neighbour.map_from_clip * sample.position;
        let (surface, through) = sights.of(&position);
        (patch(&position), if through > 2 * surface { Said::Gone } else { Said::Nothing })
    });
    let mut patches: BTreeMap<[i32; 3], (u32, u32)> = BTreeMap::new();
    for (patch, said) in forward.chain(backward).collect::<Vec<_>>() {
        let votes = patches.entry(patch).or_default();
        votes.0 += u32::from(said == Said::There);
        votes.1 += u32::from(said == Said::Gone);
    }
    let mut sum = Agreement::default();
    for (yes, no) in patches.values().filter(|(yes, no)| yes + no >= 3) {
        let all = f64::from(yes + no);
        sum.agree += i32::from(f64::from(*yes) >= MAJORITY * all);
        sum.differ += i32::from(f64::from(*no) >= MAJORITY * all);
    }
    sum
}

/// One clip's observation of a point of the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Said {
    /// It measured the same surface there.
    There,
    /// It looked through the place.
    Gone,
    Nothing,
}

fn ask(position: &Point3, normal: &Vector3, color: [u8; 3], neighbour: &Neighbour) -> Said {
    let clip_from_map = neighbour.map_from_clip.inverse();
    if let Some(near) = neighbour.surface.nearest(&(clip_from_map * position), &(clip_from_map * normal)) {
        let squared: f64 = (0..3).map(|i| (f64::from(near.color[i]) - f64::from(color[i])).powi(2)).sum();
        if squared < 3.0 * COLOR * COLOR {
            return Said::There;
        }
    }
    let (surface, through) = neighbour.sights.of(position);
    if through > 2 * surface { Said::Gone } else { Said::Nothing }
}

/// Returns the alternative chosen by the neighbours with its probability; none if still ambiguous.
///
/// Only contradictions count. Agreement is no evidence: all alternatives fit the LiDAR map, look-alike rooms
/// agree as well, and the right place may be unseen by all neighbours.
pub(super) fn decide(alternatives: &[(Pose2, f64)], agreements: &[Vec<Agreement>]) -> Option<(usize, f64)> {
    let odd = |one: &Agreement| (one.differ - one.agree / AGREEING_PER_ODD).max(0);
    let logs: Vec<f64> = alternatives
        .iter()
        .zip(agreements)
        .map(|((_, probability), said)| {
            let against: i32 = said.iter().map(odd).sum();
            probability.max(1e-6).ln() - f64::from(against) * LIKELIHOOD_RATIO.ln()
        })
        .collect();
    let (best, most) = logs.iter().enumerate().rev().max_by(|a, b| a.1.total_cmp(b.1))?;
    let sum: f64 = logs.iter().map(|log| (log - most).exp()).sum();
    let enough = agreements[best].iter().map(|one| one.agree).sum::<i32>() >= MIN_PATCHES;
    (enough && 1.0 / sum >= SURE).then_some((best, 1.0 / sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_neighbours_saw_decides() {
        let alternatives = [(Pose2::IDENTITY, 0.5), (Pose2::new(3.0, 0.0, 0.0), 0.5)];
        // ((agree, differ) of each alternative, chosen)
        let cases = [
            ([(0, 0), (0, 0)], None),
            ([(20, 1), (3, 9)], Some(0)),
            ([(1, 9), (22, 2)], Some(1)),
            // The other one is not contradicted: it may be in an unseen place.
            ([(40, 0), (0, 0)], None),
            ([(20, 0), (19, 1)], None),
            // Too few patches of the remaining one were seen.
            ([(15, 0), (0, 30)], None),
        ];
        for (said, chosen) in cases {
            let said = said.map(|(agree, differ)| vec![Agreement { agree, differ }]);
            let decided = decide(&alternatives, &said).map(|(place, _)| place);
            assert_eq!(decided, chosen, "{said:?}");
        }
        assert_eq!(decide(&[], &[]), None);
    }
}
