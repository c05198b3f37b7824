//! A clip whose frames are read in their order and tracked.

use super::agreement::Agreement;
use super::{Track, TrackParams, Tracker};
use crate::error::ReconstructError;
use crate::key_frame::KeyFrame;
use crate::reason::Reason;
use viola_formats::clip::{Clip, ClipError, FrameHeader};
use viola_geometry::Pose3;
use viola_geometry::progress::{self, Progress, Stage};

/// Poses by which readings disagree after one metre by no more than this do not drift ...
const TOLERATED_M: f64 = 0.013;
/// ... and refined ones that leave more than this share of the disagreement are no better.
const MOST_LEFT: f64 = 0.95;

/// The reason's code that an answer has whose frames were too few to track them for sure.
const SPARSE: &str = "sparse_frames";
/// Frames that are decoded at a time.
const BATCH: usize = 8;

/// A clip's poses where it has none of its own, or better ones than its own.
#[derive(Debug, Clone)]
pub struct TrackedClip {
    /// For every frame of the clip; none where it was not tracked, or not in the segment that counts.
    pub world_from_camera: Vec<Option<Pose3>>,
    /// Whether the poses are the device's, refined, in the device's world.
    pub is_refined: bool,
    /// Whether the frames are so far apart that tracking may have gone wrong unnoticed.
    pub is_sparse: bool,
    /// What the answer should tell of it.
    pub reasons: Vec<Reason>,
    pub track: Track,
}

impl TrackedClip {
    /// The frames that have a pose.
    pub fn posed<'a>(&'a self, clip: &'a Clip) -> impl Iterator<Item = (&'a FrameHeader, &'a Pose3)> {
        clip.frames()
            .iter()
            .zip(&self.world_from_camera)
            .filter_map(|(frame, pose)| Some((frame, pose.as_ref()?)))
    }
}

/// Tracks some frames of a clip (`indices`, ascending places in it). A frame that cannot be decoded is left out; none
/// that can be is an error.
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

/// The clip knows its camera best.
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
    for batch in indices.chunks(BATCH) {
        progress::check(progress)?;
        progress.advance(followed.len() as f64 / indices.len() as f64);
        for (frame, index) in frames.next_batch(BATCH).into_iter().zip(batch) {
            match frame {
                Ok(frame) => {
                    tracker.add(&frame);
                    followed.push(*index);
                }
                Err(error) if error.is_ours() => return Err(ReconstructError::Clip(error)),
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
    let track = tracker.finish();
    let mut world_from_camera = vec![None; clip.frames().len()];
    if let Some(longest) = track.longest() {
        for (pose, index) in track.poses_of(longest).into_iter().zip(&followed) {
            world_from_camera[*index] = pose;
        }
    }
    let number = |place: usize| followed.get(place).map_or(0, |index| clip.frames()[*index].number);
    let reasons = reasons(&track, followed.len(), number);
    let is_sparse = track.longest().is_some_and(|longest| track.wide_turn_rad(longest) > WIDE_TURN_RAD);
    Ok(TrackedClip { world_from_camera, is_refined: false, is_sparse, reasons, track })
}

/// Refines the poses that a device gave the key frames by what they show. None where these do not drift, where too little is
/// seen twice to tell, or where what is read agrees no better afterwards.
pub fn refine(
    clip: &Clip,
    keys: &[KeyFrame],
    params: &TrackParams,
    progress: &dyn Progress,
) -> Result<Option<TrackedClip>, ReconstructError> {
    if !params.refine {
        return Ok(None);
    }
    let agreement = Agreement::of(keys);
    let growth_m = agreement.growth_m();
    let Some(growth_m) = growth_m.filter(|growth_m| *growth_m > TOLERATED_M) else { return Ok(None) };
    progress::begin(progress, Stage::Track)?;
    let indices: Vec<usize> = keys.iter().map(|key| key.index).collect();
    let tracker = Tracker::refining(&with_shutter(clip, params));
    let refined = follow(clip, &indices, tracker, progress)?;
    let left = agreement.share_left(keys, &refined.world_from_camera);
    let Some(left) = left.filter(|left| *left <= MOST_LEFT) else { return Ok(None) };
    let detail = format!(
        "the device's poses drift: what is seen again after one metre of way lies {:.0} mm off; they were refined by what \
         the pictures show, which leaves {:.0} % of the disagreement",
        growth_m * 1000.0,
        left * 100.0
    );
    let reasons = vec![Reason::new("poses_refined", detail)];
    Ok(Some(TrackedClip { is_refined: true, is_sparse: false, reasons, ..refined }))
}

/// Where poses come by tracking at 2.5 Hz, 13 % of the simulated clips that were called aligned were not; at 10 Hz none
/// (BENCHMARKS.md). The probability does not know how sparse a recording was: beyond this turn from frame to frame, which
/// lies between the two, the clip is sparse.
const WIDE_TURN_RAD: f64 = 8.0 * std::f64::consts::PI / 180.0;

/// In words: how much was followed, and why not all.
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
            "the camera turned by {:.0} degrees from frame to frame, so that tracking may have gone wrong unnoticed; \
             record at 10 frames a second or more",
            turn_rad.to_degrees()
        );
        reasons.push(Reason::new(SPARSE, detail));
    }
    for (place, segment) in track.segments.iter().enumerate() {
        let Some(why) = &segment.ended else { continue };
        let used = if place == longest { "the part that is used" } else { "a part that is left out" };
        let detail = format!(
            "{used}, from frame {} on for {} frames, ended: {why}",
            number(segment.first),
            segment.frames
        );
        reasons.push(Reason::new(why.code(), detail));
    }
    reasons
}
