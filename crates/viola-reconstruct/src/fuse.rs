//! Selects key frames by motion, decodes them in batches and fuses them in order (paper III-A).

use super::cloud::PointCloud;
use super::error::ReconstructError;
use super::features::{MAX_PICTURES, Picture};
use super::key_frame::{KeyFrame, Readings};
use super::reason::Reason;
use super::tsdf::{MAX_BYTES, Tsdf};
use std::ops::Range;
use viola_formats::clip::{Clip, ClipError};
use viola_formats::lidar::MAX_SIDE_M;
use viola_geometry::progress::{self, Progress};
use viola_geometry::{Pose3, Vector3};

/// A frame becomes a key frame if the camera moved this far since the last one ...
const KEY_DISTANCE_M: f64 = 0.08;
/// ... or turned this far.
const KEY_ANGLE_RAD: f64 = 6f64.to_radians();
/// Maximum number of key frames; more are subsampled evenly.
const MAX_KEY_FRAMES: usize = 2_000;
/// Maximum number of pixels of all key frames together: they are decoded in about 50 s on two cores.
const MAX_KEY_PIXELS: u64 = 4_000_000_000;
/// Maximum fraction of key frames that may fail to decode before the clip is refused.
const MAX_BROKEN_FRACTION: f64 = 0.1;

/// The fused clip.
#[derive(Debug, Clone)]
pub struct Fused {
    pub cloud_in_world: PointCloud,
    pub key_frames: Vec<KeyFrame>,
    /// Of some key frames, evenly spread, for the clip's features.
    pub pictures: Vec<Picture>,
    /// Key frames whose pictures could not be decoded.
    pub broken: usize,
    /// True if surface beyond the memory bound was left out.
    pub truncated: bool,
}

impl Fused {
    /// Returns the remarks on the fusion for the answer.
    pub fn remarks(&self) -> Vec<Reason> {
        let mut remarks = Vec::new();
        if self.broken > 0 {
            let detail = format!("{} key frame(s) could not be decoded and were left out", self.broken);
            remarks.push(Reason::new("frames_broken", detail));
        }
        if self.truncated {
            remarks.push(Reason::new("clip_too_large", "surface beyond the memory bound was left out"));
        }
        remarks
    }
}

/// Reason why there is nothing to align.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NotFused {
    /// The range holds no frame.
    NoFrame,
    /// No frame in the range has a pose.
    NoPosedFrame,
    /// The cameras are further apart than any home is wide.
    TooFarApart { extent_m: f64 },
}

impl NotFused {
    /// Returns the reason for the answer.
    pub fn reason(self, clip: &Clip) -> Reason {
        match self {
            NotFused::NoFrame => {
                let numbers = clip.frames().iter().map(|frame| frame.number);
                let (first, last) = (numbers.clone().min().unwrap_or(0), numbers.max().unwrap_or(0));
                let detail = format!(
                    "no frame of the clip is in the range; its frames are numbered {first} to {last}"
                );
                Reason::new("no_frame_in_range", detail)
            }
            NotFused::NoPosedFrame => Reason::new(
                "no_posed_frame",
                "no frame in the range has a camera pose; record with an app that stores device poses",
            ),
            NotFused::TooFarApart { extent_m } => {
                let detail = format!(
                    "the camera poses extend over {extent_m:.0} m, and a home may have {MAX_SIDE_M} m a side; check that \
                     the poses are in metres, or split the recording into several clips"
                );
                Reason::new("clip_extent_too_large", detail)
            }
        }
    }
}

/// Returns the longest side of the box around the cameras.
fn extent_m(chosen: &[(usize, Pose3)]) -> f64 {
    let at = |(_, pose): &(usize, Pose3)| pose.translation.vector;
    let Some(first) = chosen.first().map(at) else { return 0.0 };
    let (low, high) =
        chosen.iter().map(at).fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    (high - low).max()
}

/// Poses that replace those of a clip, one for each of its frames.
#[derive(Debug, Clone, Copy)]
pub struct Poses<'a> {
    pub world_from_camera: &'a [Option<Pose3>],
    /// True if only key frames have a pose. All of them stay key frames, though refined ones may lie closer together.
    pub is_of_key_frames: bool,
}

/// Fuses the key frames of `frames` (frame numbers of the layout; all if `None`). `poses` replaces the clip's own.
pub fn fuse(
    clip: &Clip,
    frames: Option<Range<u32>>,
    poses: Option<Poses>,
    progress: &dyn Progress,
) -> Result<Result<Fused, NotFused>, ReconstructError> {
    let chosen = choose(clip, frames.as_ref(), poses);
    if chosen.is_empty() {
        let any = clip.frames().iter().any(|frame| frames.as_ref().is_none_or(|f| f.contains(&frame.number)));
        return Ok(Err(if any { NotFused::NoPosedFrame } else { NotFused::NoFrame }));
    }
    let extent_m = extent_m(&chosen);
    if extent_m > MAX_SIDE_M {
        return Ok(Err(NotFused::TooFarApart { extent_m }));
    }
    let mut tsdf = Tsdf::new(MAX_BYTES);
    let mut key_frames = Vec::with_capacity(chosen.len());
    let mut pictures = Vec::new();
    let every = chosen.len().div_ceil(MAX_PICTURES);
    let mut broken: Option<ClipError> = None;
    let mut broken_count = 0;
    let mut frames = clip.stream(chosen.iter().map(|(index, _)| *index).collect());
    let at_a_time = clip.batch(BATCH);
    for (done, batch) in chosen.chunks(at_a_time).enumerate() {
        progress::check(progress)?;
        progress.advance((done * at_a_time) as f64 / chosen.len() as f64);
        for (frame, (index, world_from_camera)) in frames.next_batch(at_a_time).into_iter().zip(batch) {
            match frame {
                Ok(frame) => {
                    // One thread alone creates the blocks of a frame.
                    let ((), sharpness) = rayon::join(
                        || tsdf.integrate(&frame, world_from_camera),
                        || frame.color.as_ref().map_or(0.0, sharpness),
                    );
                    if key_frames.len() % every == 0 && frame.color.is_some() {
                        pictures.push(Picture::new(&frame, world_from_camera));
                    }
                    key_frames.push(KeyFrame {
                        index: *index,
                        number: frame.header.number,
                        world_from_camera: *world_from_camera,
                        sharpness,
                        readings: Readings::thin(&frame.depth, frame.depth_camera),
                    });
                }
                // The frame may be valid, and the answer without it would differ.
                Err(error) if error.is_service_fault() => return Err(ReconstructError::Clip(error)),
                Err(error) => {
                    broken_count += 1;
                    broken.get_or_insert(error);
                }
            }
        }
        if broken_count as f64 > (MAX_BROKEN_FRACTION * chosen.len() as f64).max(1.0)
            && let Some(error) = broken.take()
        {
            return Err(ReconstructError::Clip(error));
        }
    }
    if key_frames.is_empty()
        && let Some(error) = broken
    {
        return Err(ReconstructError::Clip(error));
    }
    Ok(Ok(Fused {
        cloud_in_world: tsdf.surface(),
        key_frames,
        pictures,
        broken: broken_count,
        truncated: tsdf.is_full(),
    }))
}

/// Maximum number of frames in memory at a time: enough to keep many cores busy with decoding. Memory then grows only with
/// the surface, not with the length of the clip.
const BATCH: usize = 16;

/// Returns the posed frames far enough from the one chosen before, with their indices in the clip.
pub fn choose(clip: &Clip, frames: Option<&Range<u32>>, poses: Option<Poses>) -> Vec<(usize, Pose3)> {
    let wanted = |number: u32| frames.is_none_or(|range| range.contains(&number));
    let mut chosen: Vec<(usize, Pose3)> = Vec::new();
    for (index, header) in clip.frames().iter().enumerate() {
        let given = poses.map(|poses| poses.world_from_camera.get(index).copied().flatten());
        let pose = given.unwrap_or(header.world_from_camera);
        let Some(pose) = pose.filter(|_| wanted(header.number)) else { continue };
        let moved = chosen.last().is_none_or(|(_, last)| {
            let step = last.inverse() * pose;
            step.translation.vector.norm() >= KEY_DISTANCE_M || step.rotation.angle() >= KEY_ANGLE_RAD
        });
        if moved || poses.is_some_and(|poses| poses.is_of_key_frames) {
            chosen.push((index, pose));
        }
    }
    let most = usize::try_from(MAX_KEY_PIXELS / clip.pixels_a_frame().max(1)).unwrap_or(MAX_KEY_FRAMES);
    let stride = chosen.len().div_ceil(most.clamp(1, MAX_KEY_FRAMES)).max(1);
    chosen.into_iter().step_by(stride).collect()
}

/// Returns the variance of the Laplacian of a picture's green channel at a quarter of its size. Motion blur
/// lowers it (Pech-Pacheco et al., 2000).
pub fn sharpness(picture: &image::RgbImage) -> f32 {
    const STEP: u32 = 2;
    let (width, height) = picture.dimensions();
    let green = |x: u32, y: u32| f32::from(picture.get_pixel(x, y).0[1]);
    let (mut sum, mut squares, mut count) = (0f64, 0f64, 0u32);
    for y in (STEP..height.saturating_sub(STEP)).step_by(2 * STEP as usize) {
        for x in (STEP..width.saturating_sub(STEP)).step_by(2 * STEP as usize) {
            let around = green(x - STEP, y) + green(x + STEP, y) + green(x, y - STEP) + green(x, y + STEP);
            let bend = f64::from(around - 4.0 * green(x, y));
            sum += bend;
            squares += bend * bend;
            count += 1;
        }
    }
    let count = f64::from(count.max(1));
    (squares / count - (sum / count).powi(2)) as f32
}

/// Returns the mean of the cameras' upward picture axes, the fallback for unknown gravity: devices are mostly
/// held upright. `None` if the cameras contradict each other.
pub fn mean_camera_up(key_frames: &[KeyFrame]) -> Option<Vector3> {
    let sum: Vector3 = key_frames.iter().map(|k| k.world_from_camera.rotation * -Vector3::y()).sum();
    (sum.norm() > 0.2 * key_frames.len() as f64).then(|| sum.normalize())
}
