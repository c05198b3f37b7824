//! Drops outliers among a device's poses: poses that a hand-held camera cannot reach from those around them.

use super::Reason;
use std::ops::Range;
use viola_formats::clip::{Clip, FrameHeader};
use viola_geometry::Pose3;

/// Maximum speed and turn rate of a camera in a home.
const MAX_SPEED_MPS: f64 = 10.0;
const MAX_TURN_RADPS: f64 = 10.0;
/// Maximum correction that a device makes to its own poses from one frame to the next.
const CORRECTION_M: f64 = 1.0;
const CORRECTION_RAD: f64 = 0.6;
/// Maximum step from frame to frame if times are unknown: the range of a depth sensor, beyond which two
/// frames share no surface.
const MAX_STEP_M: f64 = 5.0;
/// Minimum time between frames; smaller differences are errors, because no camera records faster.
const MIN_STEP_S: f64 = 1e-3;
/// Maximum number of groups compared with a frame, so that the time is linear in the number of frames.
const OPEN_GROUPS: usize = 32;

/// The poses of a clip without its outliers.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// One for each frame of the clip; `None` if it has no pose, is out of range, or its pose is an outlier.
    pub world_from_camera: Vec<Option<Pose3>>,
    /// Remark for the answer.
    pub reason: Reason,
}

/// Returns the frames that have one of the poses, which are one for each frame of a clip.
pub fn posed<'a>(
    clip: &'a Clip,
    world_from_camera: &'a [Option<Pose3>],
) -> impl Iterator<Item = (&'a FrameHeader, &'a Pose3)> {
    let frames = clip.frames().iter().zip(world_from_camera);
    frames.filter_map(|(frame, pose)| Some((frame, pose.as_ref()?)))
}

/// Drops the outliers among the poses of the frames in `range` (all if `None`); `None` without outliers.
pub fn without_outliers(clip: &Clip, range: Option<&Range<u32>>) -> Option<Trajectory> {
    let wanted = |header: &FrameHeader| range.is_none_or(|range| range.contains(&header.number));
    let frames = clip.frames();
    let posed: Vec<Posed> = frames
        .iter()
        .enumerate()
        .filter(|(_, header)| wanted(header))
        .filter_map(|(index, header)| {
            Some(Posed { index, time_s: header.time_s, pose: header.world_from_camera? })
        })
        .collect();
    let kept = largest_group(&posed);
    let dropped: Vec<&Posed> =
        posed.iter().zip(&kept).filter(|(_, kept)| !**kept).map(|(posed, _)| posed).collect();
    let first = frames[dropped.first()?.index].number;
    let detail = format!(
        "{} of {} camera poses, the first of them of frame {first}, were dropped: no camera moves that fast from the frames \
         around them; the clip is aligned by the rest",
        dropped.len(),
        posed.len()
    );
    let mut world_from_camera = vec![None; frames.len()];
    for (posed, _) in posed.iter().zip(&kept).filter(|(_, kept)| **kept) {
        world_from_camera[posed.index] = Some(posed.pose);
    }
    Some(Trajectory { world_from_camera, reason: Reason::new("poses_dropped", detail) })
}

/// A frame that has a pose.
struct Posed {
    /// Index of the frame in the clip.
    index: usize,
    time_s: Option<f64>,
    pose: Pose3,
}

impl Posed {
    /// Returns whether a camera can have moved here from an earlier frame.
    fn can_follow(&self, earlier: &Posed) -> bool {
        let moved_m = (self.pose.translation.vector - earlier.pose.translation.vector).norm();
        let elapsed_s = self.time_s.zip(earlier.time_s).map(|(now, then)| now - then);
        match elapsed_s.filter(|s| *s >= MIN_STEP_S) {
            Some(s) => {
                moved_m <= CORRECTION_M + MAX_SPEED_MPS * s
                    && self.pose.rotation.angle_to(&earlier.pose.rotation)
                        <= CORRECTION_RAD + MAX_TURN_RADPS * s
            }
            None => moved_m <= MAX_STEP_M * (self.index - earlier.index) as f64,
        }
    }
}

/// Frames that can follow each other one by one.
#[derive(Clone, Copy)]
struct Group {
    number: usize,
    /// Index of the last one among the posed frames.
    last: usize,
    frames: usize,
}

/// Returns for each frame whether it is in the largest group, the earliest of equals.
///
/// A frame joins the group of the frame before it, or else the largest group that it can follow. Frames after
/// a few wild poses thus rejoin their group, and a second segment elsewhere stays apart.
fn largest_group(posed: &[Posed]) -> Vec<bool> {
    let mut group_of = Vec::with_capacity(posed.len());
    let mut frames_of: Vec<usize> = Vec::new();
    // The last entry is the group of the previous frame.
    let mut open: Vec<Group> = Vec::new();
    for (place, frame) in posed.iter().enumerate() {
        let follows = |group: &Group| frame.can_follow(&posed[group.last]);
        let at = match open.last() {
            Some(group) if follows(group) => Some(open.len() - 1),
            _ => {
                let possible = open.iter().enumerate().filter(|(_, group)| follows(group));
                possible.max_by_key(|(_, g)| (g.frames, std::cmp::Reverse(g.number))).map(|(at, _)| at)
            }
        };
        let mut group = match at {
            Some(at) => open.remove(at),
            None => {
                frames_of.push(0);
                Group { number: frames_of.len() - 1, last: place, frames: 0 }
            }
        };
        group.last = place;
        group.frames += 1;
        frames_of[group.number] = group.frames;
        group_of.push(group.number);
        open.push(group);
        if open.len() > OPEN_GROUPS {
            let earlier = open[..OPEN_GROUPS].iter().enumerate();
            let smallest = earlier.min_by_key(|(_, g)| (g.frames, g.last)).map(|(at, _)| at);
            open.remove(smallest.unwrap_or(0));
        }
    }
    let largest = (0..frames_of.len()).max_by_key(|number| (frames_of[*number], std::cmp::Reverse(*number)));
    group_of.into_iter().map(|number| Some(number) == largest).collect()
}

#[cfg(test)]
mod tests;
