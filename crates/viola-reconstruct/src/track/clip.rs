//! Tracks the frames of a clip in their order.

use super::agreement::Agreement;
use super::{Track, TrackParams, Tracker};
use crate::error::ReconstructError;
use crate::key_frame::KeyFrame;
use crate::reason::Reason;
use std::cmp::Reverse;
use viola_formats::clip::{Clip, ClipError};
use viola_geometry::Pose3;
use viola_geometry::progress::{self, Progress, Stage};

/// Maximum drift after one metre, in metres, of poses that are not refined ...
const TOLERATED_M: f64 = 0.013;
/// ... and maximum fraction of the disagreement that refined poses may leave.
const MAX_FRACTION_LEFT: f64 = 0.95;

/// Reason code of answers whose frames are too sparse for reliable tracking.
const SPARSE: &str = "sparse_frames";
/// Maximum number of frames decoded at a time.
const BATCH: usize = 8;
/// Maximum number of parts of a clip whose ends are told. A long recording in the dark has thousands.
const MAX_TOLD: usize = 8;

/// Tracked poses of a clip without poses, or its refined poses.
#[derive(Debug, Clone)]
pub struct TrackedClip {
    /// One for each frame of the clip; `None` if it was not tracked or is not in the longest segment.
    pub world_from_camera: Vec<Option<Pose3>>,
    /// True if the poses are the device's, refined, in the device's world.
    pub is_refined: bool,
    /// True if the frames are so far apart that tracking may have failed unnoticed.
    pub is_sparse: bool,
    /// Remarks for the answer.
    pub reasons: Vec<Reason>,
}

/// Tracks some frames of a clip (`indices`, ascending). Frames that cannot be decoded are left out; it is an
/// error if no frame can be decoded.
///
/// Every frame is decoded once, a few at a time; frames in between are needed too, so nothing is skipped.
pub fn track(
    clip: &Clip,
    indices: &[usize],
    params: &TrackParams,
    progress: &dyn Progress,
) -> Result<TrackedClip, ReconstructError> {
    follow(clip, indices, Tracker::new(&with_shutter(clip, params)), progress)
}

/// Returns the parameters with the clip's own shutter, if it states one.
fn with_shutter(clip: &Clip, params: &TrackParams) -> TrackParams {
    TrackParams { shutter: clip.shutter().or(params.shutter), ..params.clone() }
}

fn follow(
    clip: &Clip,
    indices: &[usize],
    mut tracker: Tracker,
    progress: &dyn Progress,
) -> Result<TrackedClip, ReconstructError> {
    let mut followed = Vec::with_capacity(indices.len());
    let mut broken: Option<ClipError> = None;
    let mut frames = clip.stream(indices.to_vec());
    let at_a_time = clip.batch(BATCH);
    for batch in indices.chunks(at_a_time) {
        progress::check(progress)?;
        progress.advance(followed.len() as f64 / indices.len() as f64);
        for (frame, index) in frames.next_batch(at_a_time).into_iter().zip(batch) {
            match frame {
                Ok(frame) => {
                    tracker.add(&frame);
                    followed.push(*index);
                }
                Err(error) if error.is_service_fault() => return Err(ReconstructError::Clip(error)),
                Err(error) => {
                    broken.get_or_insert(error);
                }
            }
        }
    }
    if followed.is_empty()
        && let Some(error) = broken
    {
        return Err(ReconstructError::Clip(error));
    }
    progress::check(progress)?;
    let track = tracker.finish(progress)?;
    let mut world_from_camera = vec![None; clip.frames().len()];
    if let Some(longest) = track.longest() {
        for (pose, index) in track.poses_of(longest).into_iter().zip(&followed) {
            world_from_camera[*index] = pose;
        }
    }
    let number = |place: usize| followed.get(place).map_or(0, |index| clip.frames()[*index].number);
    let reasons = reasons(&track, followed.len(), number);
    let is_sparse = track.longest().is_some_and(|longest| track.wide_turn_rad(longest) > WIDE_TURN_RAD);
    Ok(TrackedClip { world_from_camera, is_refined: false, is_sparse, reasons })
}

/// Refines a device's poses of the key frames by their pictures. Returns `None` if they do not drift, if too
/// little is seen twice to tell, if there are no pictures, or if the readings agree no better afterwards.
pub fn refine(
    clip: &Clip,
    keys: &[KeyFrame],
    params: &TrackParams,
    progress: &dyn Progress,
) -> Result<Option<TrackedClip>, ReconstructError> {
    if !params.refine || !clip.has_color() {
        return Ok(None);
    }
    let agreement = Agreement::of(keys);
    let growth_m = agreement.growth_m();
    let Some(growth_m) = growth_m.filter(|growth_m| *growth_m > TOLERATED_M) else { return Ok(None) };
    progress::begin(progress, Stage::Track)?;
    let indices: Vec<usize> = keys.iter().map(|key| key.index).collect();
    let tracker = Tracker::refining(&with_shutter(clip, params));
    let refined = follow(clip, &indices, tracker, progress)?;
    let left = agreement.fraction_left(keys, &refined.world_from_camera);
    let Some(left) = left.filter(|left| *left <= MAX_FRACTION_LEFT) else { return Ok(None) };
    let detail = format!(
        "the device's poses drift: what is seen again after one metre of way lies {:.0} mm off; they were refined by what \
         the pictures show, which leaves {:.0} % of the disagreement",
        growth_m * 1000.0,
        left * 100.0
    );
    let reasons = vec![Reason::new("poses_refined", detail)];
    Ok(Some(TrackedClip { is_refined: true, is_sparse: false, reasons, ..refined }))
}

/// Maximum turn from frame to frame of a clip that is not sparse; it lies between those of 2.5 Hz and 10 Hz.
/// With tracking at 2.5 Hz, 13 % of the simulated clips reported as aligned were not; at 10 Hz none
/// (docs/experiments.md). The probability does not account for sparse recordings.
const WIDE_TURN_RAD: f64 = 8.0 * std::f64::consts::PI / 180.0;

/// Returns the remarks on the fraction of tracked frames, and on the ends of segments.
fn reasons(track: &Track, frames: usize, number: impl Fn(usize) -> u32) -> Vec<Reason> {
    let Some(longest) = track.longest() else {
        let detail = "the recording has no camera poses, and its pictures do not tell how the camera moved";
        return vec![Reason::new("track_failed", detail)];
    };
    let kept = track.segments[longest].frames;
    let detail = format!(
        "the recording has no camera poses; {kept} of {frames} frames were tracked by their pictures"
    );
    let mut reasons = vec![Reason::new("tracked", detail)];
    let turn_rad = track.wide_turn_rad(longest);
    if turn_rad > WIDE_TURN_RAD {
        let detail = format!(
            "the camera turned by {:.0} degrees from frame to frame, so tracking may have gone wrong unnoticed; \
             record at 10 frames a second or more",
            turn_rad.to_degrees()
        );
        reasons.push(Reason::new(SPARSE, detail));
    }
    let ended = |place: &usize| track.segments[*place].ended.is_some();
    let mut told: Vec<usize> = (0..track.segments.len()).filter(ended).collect();
    told.sort_by_key(|place| (*place != longest, Reverse(track.segments[*place].frames)));
    told.truncate(MAX_TOLD);
    told.sort_unstable();
    for place in told {
        let segment = &track.segments[place];
        let Some(why) = &segment.ended else { continue };
        let used = if place == longest { "the part that is used" } else { "a part that is left out" };
        let detail = format!(
            "{used}, from frame {} for {} frames, ended: {why}",
            number(segment.first),
            segment.frames
        );
        reasons.push(Reason::new(why.code(), detail));
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{Lost, Segment};

    #[test]
    fn the_ends_of_the_used_part_and_of_a_few_others_are_told() {
        let segment = |place: usize| {
            let frames = if place == 70 { 90 } else { 5 + place % 10 };
            Segment { frames, first: 100 * place, ended: Some(Lost::Dark) }
        };
        let segments = (0..80).map(segment).collect();
        let track = Track { poses: Vec::new(), segments, key_frames: 0, loops: 0, key_bytes: 0 };
        let told: Vec<String> = reasons(&track, 8000, |place| place as u32)
            .into_iter()
            .filter(|reason| reason.code == "track_dark")
            .map(|reason| reason.detail)
            .collect();
        assert_eq!(told.len(), MAX_TOLD);
        // The longest of the others, the first of equals, in their order.
        assert!(told[0].starts_with("a part that is left out, from frame 900 for 14 frames"), "{told:?}");
        assert!(told[7].starts_with("the part that is used, from frame 7000 for 90 frames"), "{told:?}");
    }
}
