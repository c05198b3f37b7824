//! Metres per unit of a clip whose unit is unknown: the fourth dimension of the search.
//!
//! The clip is fused in nominal metres, by its median depth. Plausible heights of the first camera above the floor
//! bound the scale. All scales of a geometric grid are searched over SE(2) down to one loss, the modes are refined in
//! pose and scale, and one loss ranks the modes of all scales. The clip is then observed again, in metres.

mod explain;
mod search;
mod shape;

use crate::observe::{self, Observation, Scale};
use crate::refine;
use crate::register::MIN_HITS;
use crate::scan::{self, Hit};
use crate::score::MODEL;
use crate::within::Within;
use crate::{AlignError, AlignParams, Target};
use explain::Explanation;
use shape::{FIRST, IN_DOUBT, Shape};
use std::ops::Range;
use viola_formats::clip::Clip;
use viola_geometry::progress::{self, Progress, Stage};
use viola_reconstruct::{NoFloor, Reason};

/// Median depth in nominal metres.
const MEDIAN_DEPTH_M: f64 = 2.0;
/// Number of frames that give the median depth.
const SAMPLED_FRAMES: usize = 8;
/// Scales with a larger ratio are different explanations.
const CLOSE_LOG: f64 = 0.05;
/// An answer is in doubt if a rival at another scale loses by less.
const DOUBT_M: f64 = 0.015;
/// Distance of the map's walls behind the surface that a clip sees: a map has wall cells behind the surface and none
/// before it, and the first hits of rays are the nearest ones of a rough surface. A room therefore fits best if it is
/// larger by this on each side. By simulated homes (docs/experiments.md).
const BEHIND_SURFACE_M: f64 = 0.025;
/// Maximum number of rivals that the probability counts.
const MAX_RIVALS: usize = 7;

/// Observes a clip; if its unit is unknown, finds its scale in the maps first.
pub fn observe_any_scale(
    targets: &[&Target],
    clip: &Clip,
    frames: Option<Range<u32>>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Observation, AlignError> {
    if clip.info().metric {
        return observe::observe(clip, frames, params, progress);
    }
    match find(targets, clip, frames.clone(), params, progress)? {
        Ok(scale) => {
            let metric = clip.scaled(scale.metres_per_unit);
            let observation = observe::observe(&metric, frames, params, progress)?;
            Ok(Observation { scale: Some(scale), ..observation })
        }
        Err(reasons) => Ok(Observation { reasons, ..Observation::default() }),
    }
}

/// Finds the scale of a clip in the maps; returns the reasons if that is not possible.
pub(super) fn find(
    targets: &[&Target],
    clip: &Clip,
    frames: Option<Range<u32>>,
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Result<Scale, Vec<Reason>>, AlignError> {
    progress::begin(progress, Stage::Track)?;
    let within = Within(progress);
    let Some(depth) = median_depth(clip, frames.as_ref())? else {
        let detail = "the depth pictures of the clip have no reading";
        return Ok(Err(vec![Reason::new("nothing_fused", detail)]));
    };
    let nominal = MEDIAN_DEPTH_M / depth;
    let fusion = match observe::fuse(&clip.scaled(nominal), frames, params, &within)? {
        Ok(fusion) => fusion,
        Err(reasons) => return Ok(Err(reasons)),
    };
    let observation = match fusion.observe_nominal(params, &within)? {
        Ok(observation) => observation,
        Err(why) => return Ok(Err(without_floor(fusion.reasons, why))),
    };
    let (Some(floor), Some(clip_from_world)) = (&observation.floor, observation.clip_from_world) else {
        return Ok(Err(observation.reasons));
    };
    if floor.camera_height_m <= 0.0 {
        let detail = "the first camera is not above the floor, so the scale of the clip cannot be found; record from a usual height";
        return Ok(Err([observation.reasons, vec![Reason::new("scale_unknown", detail)]].concat()));
    }
    let shape = Shape {
        camera_height: floor.camera_height_m,
        cloud_in_clip: scan::upright(observation.cloud_in_clip),
        keys: fusion.into_key_frames(),
        clip_from_world,
    };
    let Some((explanations, complete)) = explanations(&shape, targets, params, &within)? else {
        let detail = format!(
            "the clip shows fewer than {MIN_HITS} standing points on walls and furniture at every plausible scale; film more of the room, and its lower half"
        );
        return Ok(Err([observation.reasons, vec![Reason::new("too_few_hits", detail)]].concat()));
    };
    let Some(best) = explanations.first() else {
        let detail = "at no plausible scale the search found a place in the map where the clip could lie";
        return Ok(Err([observation.reasons, vec![Reason::new("no_candidate", detail)]].concat()));
    };
    let hits = behind_the_surface(shape.hits(best.scale, params));
    let spread = refine::spread_of_scale(&best.map_from_clip, &hits, targets[best.target]);
    let metres_per_unit = nominal * best.scale * spread.mean.exp();
    let rival_gaps_m = rivals(&explanations).map(|rival| rival.loss_m - best.loss_m).collect();
    Ok(Ok(Scale {
        metres_per_unit,
        std: metres_per_unit * MODEL.covariance.scale_std(spread.std, spread.radius_m),
        rival_gaps_m,
        complete,
    }))
}

/// Returns the reasons of a clip of unknown unit without a floor.
fn without_floor(mut reasons: Vec<Reason>, why: NoFloor) -> Vec<Reason> {
    reasons.push(why.reason());
    if let NoFloor::NoPlane { .. } = why {
        reasons.push(Reason::new(
            "scale_unknown",
            "the unit of the clip is unknown, and without a floor in sight its scale cannot be found; include some floor in the recording",
        ));
    }
    reasons
}

/// Returns the hits where the map has their walls.
fn behind_the_surface(hits: Vec<Hit>) -> Vec<Hit> {
    let moved = |hit: Hit| Hit { point_m: hit.point_m - hit.normal * BEHIND_SURFACE_M, ..hit };
    hits.into_iter().map(moved).collect()
}

/// Returns the explanations at all scales, the best first, and whether the search proved the optimum of each scale. If
/// an explanation at another scale is nearly as good as the best one, the search continues. `None` if the clip has too
/// few hits at every scale.
fn explanations(
    shape: &Shape,
    targets: &[&Target],
    params: &AlignParams,
    progress: &dyn Progress,
) -> Result<Option<(Vec<Explanation>, bool)>, AlignError> {
    let by_loss = |a: &Explanation, b: &Explanation| a.loss_m.total_cmp(&b.loss_m);
    let Some((mut found, mut complete)) = explain::explanations(shape, targets, &FIRST, params, progress)?
    else {
        return Ok(None);
    };
    found.sort_by(by_loss);
    let is_near = |best: &Explanation| rivals(&found).any(|rival| rival.loss_m - best.loss_m < DOUBT_M);
    if found.first().is_none_or(is_near)
        && let Some((more, more_complete)) =
            explain::explanations(shape, targets, &IN_DOUBT, params, progress)?
    {
        found.extend(more);
        found.sort_by(by_loss);
        complete &= more_complete;
    }
    Ok(Some((found, complete)))
}

/// Returns the median of the depth of some frames, in the clip's unit; `None` without a reading.
fn median_depth(clip: &Clip, frames: Option<&Range<u32>>) -> Result<Option<f64>, AlignError> {
    let wanted = |number: u32| frames.is_none_or(|frames| frames.contains(&number));
    let headers = clip.frames().iter().enumerate();
    let indices: Vec<usize> =
        headers.filter(|(_, header)| wanted(header.number)).map(|(index, _)| index).collect();
    let some = indices.iter().copied().step_by(indices.len().div_ceil(SAMPLED_FRAMES).max(1));
    let mut depths: Vec<f32> = Vec::new();
    let (mut frames, at_a_time) = (clip.stream(some.collect()), clip.batch(SAMPLED_FRAMES));
    for frame in (0..SAMPLED_FRAMES).flat_map(|_| frames.next_batch(at_a_time)) {
        match frame {
            Ok(frame) => {
                depths.extend(frame.depth.depth_m.iter().filter(|depth| depth.is_finite() && **depth > 0.0))
            }
            Err(error) if error.is_service_fault() => return Err(AlignError::Clip(error)),
            // The fusion counts broken frames.
            Err(_) => {}
        }
    }
    if depths.is_empty() {
        return Ok(None);
    }
    let middle = depths.len() / 2;
    let (_, median, _) = depths.select_nth_unstable_by(middle, f32::total_cmp);
    Ok(Some(f64::from(*median)))
}

/// Returns the explanations at other scales than the first, the best first, each once.
fn rivals(explanations: &[Explanation]) -> impl Iterator<Item = &Explanation> {
    let is_other = |a: &Explanation, b: &Explanation| (a.scale / b.scale).ln().abs() > CLOSE_LOG;
    let mut kept: Vec<&Explanation> = Vec::new();
    for explanation in explanations.iter().skip(1).filter(|other| is_other(other, &explanations[0])) {
        let is_known = |known: &&Explanation| {
            known.target == explanation.target
                && !is_other(known, explanation)
                && !crate::score::is_different(&known.map_from_clip, &explanation.map_from_clip)
        };
        if !kept.iter().any(is_known) {
            kept.push(explanation);
        }
        if kept.len() == MAX_RIVALS {
            break;
        }
    }
    kept.into_iter()
}
