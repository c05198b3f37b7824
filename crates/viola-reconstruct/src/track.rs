//! Tracks the camera of clips without device poses, and refines device poses that drift (docs/method.md, stage 2;
//! the paper's III-A reconstructs with RGB-D SLAM).
//!
//! [`Tracker`] takes frames in the order of their recording, one at a time:
//! - `odometry` aligns each to the latest key frame by grey and depth (`step`), and detects a lost frame;
//! - a lost frame is compared with the key frames; if none shows the same place, a new segment begins;
//! - [`Tracker::finish`] finds key frames that see the same again (`loops`), checks each pair by alignment,
//!   joins segments, and optimises the poses of the key frames (`graph`).
//!
//! Memory grows only with the key frames, each with a picture of a quarter of a million bytes. A clip that
//! cannot be tracked in one piece has several segments, each with the reason why it ended.

mod agreement;
mod clip;
mod conventions;
pub(crate) mod corners;
mod device;
mod graph;
mod keys;
mod loops;
mod lost;
mod odometry;
pub(crate) mod picture;
mod place;
mod reference;
mod shutter;
mod step;

pub use clip::{TrackedClip, refine, track};
pub use conventions::{convention_of_dropped, other_convention};
pub use lost::Lost;

use corners::Describer;
use graph::Edge;
use keys::KeyFrame;
use odometry::Odometry;
use picture::Pyramid;
use shutter::Rolling;
use viola_formats::clip::{Frame, Shutter};
use viola_geometry::progress::{Cancelled, Progress};
use viola_geometry::{Point3, Pose3};

/// Maximum number of key frames that a lost frame is compared with, the most similar first.
const RELOCALISE_TRIES: usize = 12;
/// Minimum number of frames in a segment.
const MIN_SEGMENT_FRAMES: usize = 5;

/// Parameters of the tracking.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackParams {
    pub seed: u64,
    /// True if loops are closed.
    pub close_loops: bool,
    /// Fallback for clips that do not state their shutter.
    pub shutter: Option<Shutter>,
    /// True if device poses that drift are refined by the pictures.
    pub refine: bool,
}

impl Default for TrackParams {
    fn default() -> Self {
        TrackParams { seed: 0, close_loops: true, shutter: None, refine: true }
    }
}

/// A part of the clip that was tracked without an unbridged gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Number of frames with a pose.
    pub frames: usize,
    /// Index of the first of them among the tracked frames.
    pub first: usize,
    /// Reason why it ended before the clip did.
    pub ended: Option<Lost>,
}

/// Result of the tracking.
#[derive(Debug, Clone)]
pub struct Track {
    /// For each frame, its segment and its pose in the segment's world, whose origin is its first camera.
    pub poses: Vec<Option<(usize, Pose3)>>,
    /// In the order of their first frames.
    pub segments: Vec<Segment>,
    pub key_frames: usize,
    /// Number of accepted loops.
    pub loops: usize,
    /// Memory of the key frames.
    pub key_bytes: usize,
}

impl Track {
    /// Returns the segment with most frames, the first of equals.
    pub fn longest(&self) -> Option<usize> {
        (0..self.segments.len()).max_by_key(|i| (self.segments[*i].frames, std::cmp::Reverse(*i)))
    }

    /// Returns the 90th percentile of a segment's turns from frame to frame.
    pub fn wide_turn_rad(&self, segment: usize) -> f64 {
        let poses: Vec<Pose3> = self.poses_of(segment).into_iter().flatten().collect();
        let mut turns_rad: Vec<f64> =
            poses.windows(2).map(|pair| pair[0].rotation.angle_to(&pair[1].rotation)).collect();
        turns_rad.sort_by(f64::total_cmp);
        turns_rad.get(turns_rad.len() * 9 / 10).copied().unwrap_or(0.0)
    }

    /// Returns the poses of one segment.
    pub fn poses_of(&self, segment: usize) -> Vec<Option<Pose3>> {
        self.poses.iter().map(|pose| pose.filter(|(of, _)| *of == segment).map(|(_, pose)| pose)).collect()
    }
}

/// A tracked frame: its pose against a key frame.
#[derive(Debug, Clone, Copy)]
struct Followed {
    key: usize,
    camera_from_key: Pose3,
}

/// Tracks the camera through frames in the order of their recording.
pub struct Tracker {
    params: TrackParams,
    describer: Describer,
    odometry: Odometry,
    keys: Vec<KeyFrame>,
    edges: Vec<Edge>,
    frames: Vec<Option<Followed>>,
    /// Reason why each segment ended, in the order of their beginning.
    ended: Vec<Option<Lost>>,
    is_lost: bool,
    /// Time of the last frame.
    last_s: Option<f64>,
    /// True if the device's poses are used, which are in `devices`.
    has_device: bool,
    devices: Vec<Option<Pose3>>,
}

impl Tracker {
    /// Returns a tracker that ignores the poses of the frames.
    pub fn new(params: &TrackParams) -> Tracker {
        Tracker {
            odometry: Odometry::new(),
            params: params.clone(),
            describer: Describer::new(),
            keys: Vec::new(),
            edges: Vec::new(),
            frames: Vec::new(),
            ended: Vec::new(),
            is_lost: true,
            last_s: None,
            has_device: false,
            devices: Vec::new(),
        }
    }

    /// Returns a tracker that refines the poses of the frames.
    pub fn refining(params: &TrackParams) -> Tracker {
        Tracker { has_device: true, ..Tracker::new(params) }
    }

    /// Adds the next frame.
    pub fn add(&mut self, frame: &Frame) {
        let pyramid = Pyramid::new(frame);
        let rolling = Rolling::new(self.params.shutter, self.last_s, frame.header.time_s);
        self.last_s = frame.header.time_s;
        self.devices.push(frame.header.world_from_camera.filter(|_| self.has_device));
        let followed = if self.is_lost { self.begin(pyramid) } else { self.follow(pyramid, rolling) };
        self.frames.push(followed);
    }

    fn follow(&mut self, pyramid: Pyramid, rolling: Option<Rolling>) -> Option<Followed> {
        let key = self.keys.len() - 1;
        let expected = self.expected(key);
        let moved = Lost::of(&pyramid)
            .map_or_else(|| self.odometry.follow(pyramid.clone(), rolling, expected.as_ref()), Err);
        match moved {
            Ok(moved) => {
                if let Some(first) = &moved.first {
                    let KeyFrame { frame, segment, world_from_key, .. } = self.keys[key];
                    self.keys[key] = KeyFrame::new(frame, segment, world_from_key, first, &self.describer);
                }
                let followed = Followed { key, camera_from_key: moved.step.camera_from_key };
                if moved.is_key {
                    self.edges.push(Edge::of(key, key + 1, &moved.step, false));
                    self.edges.extend(expected.map(|expected| device::edge(key, key + 1, expected)));
                    let pose = self.keys[key].world_from_key * followed.camera_from_key.inverse();
                    let (frame, segment) = (self.frames.len(), self.keys[key].segment);
                    self.keys.push(KeyFrame::new(frame, segment, pose, &moved.pyramid, &self.describer));
                }
                Some(followed)
            }
            Err(why) => {
                if let Some(expected) = expected {
                    return Some(self.carry(pyramid, expected));
                }
                // After a return to a known place it may not be the last segment.
                self.ended[self.keys[key].segment] = Some(why);
                self.is_lost = true;
                self.begin(pyramid)
            }
        }
    }

    /// Starts from a frame: at a known place, or in a new segment.
    fn begin(&mut self, pyramid: Pyramid) -> Option<Followed> {
        if Lost::of(&pyramid).is_some() {
            return None;
        }
        let frame = self.frames.len();
        let world_from_key = self.devices[frame].unwrap_or_else(Pose3::identity);
        let mut key = KeyFrame::new(frame, self.ended.len(), world_from_key, &pyramid, &self.describer);
        if let Some((a, step)) = self.relocalise(&key) {
            key.segment = self.keys[a].segment;
            key.world_from_key = self.keys[a].world_from_key * step.camera_from_key.inverse();
            self.edges.push(Edge::of(a, self.keys.len(), &step, false));
            // The segment continues.
            self.ended[key.segment] = None;
        } else {
            self.ended.push(None);
        }
        Some(self.start(key, pyramid))
    }

    fn start(&mut self, key: KeyFrame, pyramid: Pyramid) -> Followed {
        self.keys.push(key);
        self.odometry.begin(pyramid);
        self.is_lost = false;
        Followed { key: self.keys.len() - 1, camera_from_key: Pose3::identity() }
    }

    /// Returns the key frame that shows the place of a new one.
    fn relocalise(&self, key: &KeyFrame) -> Option<(usize, step::Step)> {
        let mut alike: Vec<(usize, usize)> =
            self.keys.iter().enumerate().map(|(i, other)| (other.similarity(key), i)).collect();
        alike.sort_by(|a, b| b.cmp(a));
        alike.iter().take(RELOCALISE_TRIES).find_map(|&(_, a)| {
            let seed = self.params.seed ^ ((a as u64) << 32) ^ key.frame as u64;
            Some((a, loops::same_place(&self.keys[a], key, seed)?))
        })
    }

    /// Closes the loops and returns the poses of all frames.
    pub fn finish(mut self, progress: &dyn Progress) -> Result<Track, Cancelled> {
        let loops = if self.params.close_loops { self.close_loops(progress)? } else { 0 };
        let key_bytes = self.keys.iter().map(KeyFrame::bytes).sum();
        let mut poses: Vec<Option<(usize, Pose3)>> = self
            .frames
            .iter()
            .map(|followed| {
                followed.map(|Followed { key, camera_from_key }| {
                    let key = &self.keys[key];
                    (key.segment, key.world_from_key * camera_from_key.inverse())
                })
            })
            .collect();
        let segments = segments(&mut poses, &self.ended, MIN_SEGMENT_FRAMES);
        Ok(Track { poses, segments, key_frames: self.keys.len(), loops, key_bytes })
    }

    /// Returns the number of accepted loops.
    fn close_loops(&mut self, progress: &dyn Progress) -> Result<usize, Cancelled> {
        let by_look = loops::by_look(&self.keys, self.params.seed, progress)?;
        self.edges.extend(by_look);
        self.join_segments();
        let mut believed = self.settle(progress)?.into_iter();
        self.edges.retain(|_| believed.next().unwrap_or(true));
        let by_pose = loops::by_pose(&self.keys, &self.edges, progress)?;
        self.edges.extend(by_pose);
        let believed = self.settle(progress)?;
        Ok(self.edges.iter().zip(believed).filter(|(edge, believed)| edge.is_loop && *believed).count())
    }

    /// Moves segments that edges connect into one world.
    fn join_segments(&mut self) {
        loop {
            let pair = |edge: &Edge| {
                let (a, b) = (self.keys[edge.a].segment, self.keys[edge.b].segment);
                (a != b).then(|| (a.min(b), a.max(b)))
            };
            let Some((into, from)) = self.edges.iter().find_map(pair) else { return };
            let moves = self.edges.iter().filter(|edge| pair(edge) == Some((into, from))).map(|edge| {
                let a_from_b = self.keys[edge.a].world_from_key
                    * edge.b_from_a.inverse()
                    * self.keys[edge.b].world_from_key.inverse();
                if self.keys[edge.a].segment == into { a_from_b } else { a_from_b.inverse() }
            });
            let at = self.keys.iter().find(|key| key.segment == from);
            let at = at.map_or_else(Point3::origin, |key| key.world_from_key.translation.vector.into());
            let moved = loops::most_agreed(&moves.collect::<Vec<_>>(), &at);
            // The joined segment ends as the later of the two.
            let last = |segment: usize| self.keys.iter().rposition(|key| key.segment == segment);
            let ends_as_from = last(from) > last(into);
            for key in self.keys.iter_mut().filter(|key| key.segment == from) {
                key.segment = into;
                key.world_from_key = moved * key.world_from_key;
            }
            let ended = self.ended[from].take();
            if ends_as_from {
                self.ended[into] = ended;
            }
        }
    }

    fn settle(&mut self, progress: &dyn Progress) -> Result<Vec<bool>, Cancelled> {
        let mut poses: Vec<Pose3> = self.keys.iter().map(|key| key.world_from_key).collect();
        let believed = graph::settle(&mut poses, &self.edges, progress)?;
        for (key, pose) in self.keys.iter_mut().zip(poses) {
            key.world_from_key = pose;
        }
        Ok(believed)
    }
}

/// Counts the segments' frames, drops short segments, and numbers the rest in the order of first frames.
fn segments(poses: &mut [Option<(usize, Pose3)>], ended: &[Option<Lost>], least: usize) -> Vec<Segment> {
    let mut counts = vec![0; ended.len()];
    poses.iter().flatten().for_each(|(segment, _)| counts[*segment] += 1);
    let mut numbers: Vec<Option<usize>> = vec![None; ended.len()];
    let mut segments: Vec<Segment> = Vec::new();
    for (frame, pose) in poses.iter_mut().enumerate() {
        let Some((segment, world_from_camera)) = *pose else { continue };
        if counts[segment] < least {
            *pose = None;
            continue;
        }
        let number = *numbers[segment].get_or_insert_with(|| {
            segments.push(Segment { frames: counts[segment], first: frame, ended: ended[segment].clone() });
            segments.len() - 1
        });
        *pose = Some((number, world_from_camera));
    }
    segments
}
