//! Key frames by motion, decoded a few at a time and fused in order (paper III-A).

use super::cloud::PointCloud;
use super::tsdf::{Tsdf, TsdfParams};
use super::{AlignError, Reason};
use crate::clip::{Clip, ClipError, DepthImage};
use crate::geometry::{Pinhole, Point3, Pose3, Vector3};
use crate::progress::{self, Progress};
use std::ops::Range;

/// How key frames are chosen and fused.
#[derive(Debug, Clone, PartialEq)]
pub struct FuseParams {
    /// A frame becomes a key frame when the camera moved this far since the last one ...
    pub key_distance_m: f64,
    /// ... or turned this far.
    pub key_angle_rad: f64,
    /// Key frames closer together than needed are thinned to this many, evenly.
    pub max_key_frames: usize,
    /// The share of key frames that may fail to decode before the clip is refused.
    pub max_broken_share: f64,
    pub tsdf: TsdfParams,
}

impl Default for FuseParams {
    fn default() -> Self {
        FuseParams {
            key_distance_m: 0.08,
            key_angle_rad: 6f64.to_radians(),
            max_key_frames: 2_000,
            max_broken_share: 0.1,
            tsdf: TsdfParams::default(),
        }
    }
}

/// A frame that was fused.
#[derive(Debug, Clone)]
pub struct KeyFrame {
    /// Its place in the clip.
    pub index: usize,
    pub number: u32,
    pub world_from_camera: Pose3,
    /// How sharp its colour picture is, to compare it with others of the clip.
    pub sharpness: f32,
    /// Some of its readings, as points in the camera frame: enough to know what the camera saw through.
    pub readings: Readings,
}

/// What a key frame saw, as the clip's other answers have it.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    pub clip_from_camera: Pose3,
    pub readings: Readings,
}

/// A thinned depth picture: a few thousand numbers, because every key frame keeps one.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    camera: Pinhole,
    width: u16,
    /// Millimetres, row after row; 0 where there is none.
    depth_mm: Vec<u16>,
    stride: u16,
}

impl Readings {
    fn thin(depth: &DepthImage, camera: Pinhole, params: &TsdfParams) -> Readings {
        let stride = (depth.width / 64).max(1);
        let mut depth_mm = Vec::new();
        let mut width = 0;
        for y in (stride / 2..depth.height).step_by(stride as usize) {
            width = 0;
            for x in (stride / 2..depth.width).step_by(stride as usize) {
                let depth_m = depth.at(x, y);
                let known = (params.min_depth_m..=params.max_depth_m).contains(&depth_m);
                depth_mm.push(if known { (depth_m * 1000.0) as u16 } else { 0 });
                width += 1;
            }
        }
        Readings { camera, width, depth_mm, stride: stride as u16 }
    }

    /// Readings from their parts, none when these do not belong together.
    pub fn new(camera: Pinhole, width: u16, stride: u16, depth_mm: Vec<u16>) -> Option<Readings> {
        let rows_fit = width > 0 && depth_mm.len().is_multiple_of(usize::from(width));
        (camera.is_plausible() && stride > 0 && rows_fit).then_some(Readings {
            camera,
            width,
            depth_mm,
            stride,
        })
    }

    pub fn width(&self) -> u16 {
        self.width
    }

    /// Pixels of the camera's picture from one reading to the next.
    pub fn stride(&self) -> u16 {
        self.stride
    }

    /// Millimetres, row after row; 0 where there is none.
    pub fn depth_mm(&self) -> &[u16] {
        &self.depth_mm
    }

    /// The depth measured at a place of the picture, in metres; none where nothing was measured.
    pub fn depth_at(&self, u: f64, v: f64) -> Option<f64> {
        if u < 0.0 || v < 0.0 || u >= f64::from(self.camera.width) || v >= f64::from(self.camera.height) {
            return None;
        }
        let (x, y) = (u as usize / usize::from(self.stride), v as usize / usize::from(self.stride));
        let at = y * usize::from(self.width) + x.min(usize::from(self.width) - 1);
        self.depth_mm.get(at).filter(|mm| **mm > 0).map(|mm| f64::from(*mm) / 1000.0)
    }

    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// What was hit, in the camera frame.
    pub fn points_in_camera(&self) -> impl Iterator<Item = Point3> + '_ {
        let first = self.stride / 2;
        self.depth_mm.iter().enumerate().filter(|(_, mm)| **mm > 0).map(move |(i, &mm)| {
            let (x, y) = (i % usize::from(self.width), i / usize::from(self.width));
            let pixel = |at: usize| at as f64 * f64::from(self.stride) + f64::from(first);
            self.camera.unproject(pixel(x), pixel(y), f64::from(mm) / 1000.0)
        })
    }
}

#[cfg(test)]
impl KeyFrame {
    /// A key frame that read this depth.
    pub(super) fn that_read(world_from_camera: Pose3, depth: &DepthImage, camera: Pinhole) -> KeyFrame {
        let readings = Readings::thin(depth, camera, &TsdfParams::default());
        KeyFrame { readings, ..KeyFrame::blind(world_from_camera) }
    }

    /// A key frame that read nothing.
    pub(super) fn blind(world_from_camera: Pose3) -> KeyFrame {
        let camera = Pinhole { width: 4, height: 3, fx: 4.0, fy: 4.0, cx: 1.5, cy: 1.0 };
        let readings = Readings { camera, width: 4, depth_mm: Vec::new(), stride: 1 };
        KeyFrame { index: 0, number: 0, world_from_camera, sharpness: 0.0, readings }
    }
}

/// The fused clip.
#[derive(Debug, Clone)]
pub struct Fused {
    pub cloud_in_world: PointCloud,
    pub key_frames: Vec<KeyFrame>,
    /// Key frames whose pictures could not be decoded.
    pub broken: usize,
    /// Surface beyond the memory bound was left out.
    pub truncated: bool,
}

impl Fused {
    /// What the answer should tell about the fusion.
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

/// Why there is nothing to align.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotFused {
    /// The range holds no frame.
    NoFrame,
    /// No frame in the range has a pose.
    NoPosedFrame,
}

impl NotFused {
    /// The same for the answer.
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
        }
    }
}

/// Fuses the key frames of `frames` (numbers as the layout gives them; all when none). `tracked` are poses for all of the
/// clip's frames where it has none of its own.
pub fn fuse(
    clip: &Clip,
    frames: Option<Range<u32>>,
    tracked: Option<&[Option<Pose3>]>,
    params: &FuseParams,
    progress: &dyn Progress,
) -> Result<Result<Fused, NotFused>, AlignError> {
    let chosen = choose(clip, frames.as_ref(), tracked, params);
    if chosen.is_empty() {
        let any = clip.frames().iter().any(|frame| frames.as_ref().is_none_or(|f| f.contains(&frame.number)));
        return Ok(Err(if any { NotFused::NoPosedFrame } else { NotFused::NoFrame }));
    }
    let mut tsdf = Tsdf::new(params.tsdf.clone());
    let mut key_frames = Vec::with_capacity(chosen.len());
    let mut broken: Option<ClipError> = None;
    let mut broken_count = 0;
    let mut frames = clip.stream(chosen.iter().map(|(index, _)| *index).collect());
    for (done, batch) in chosen.chunks(BATCH).enumerate() {
        progress::check(progress)?;
        progress.advance((done * BATCH) as f64 / chosen.len() as f64);
        for (frame, (index, world_from_camera)) in frames.next_batch(BATCH).into_iter().zip(batch) {
            match frame {
                Ok(frame) => {
                    tsdf.integrate(&frame, world_from_camera);
                    key_frames.push(KeyFrame {
                        index: *index,
                        number: frame.header.number,
                        world_from_camera: *world_from_camera,
                        sharpness: sharpness(&frame.color),
                        readings: Readings::thin(&frame.depth, frame.depth_camera, &params.tsdf),
                    });
                }
                Err(error) => {
                    broken_count += 1;
                    broken.get_or_insert(error);
                }
            }
        }
        if broken_count as f64 > (params.max_broken_share * chosen.len() as f64).max(1.0)
            && let Some(error) = broken.take()
        {
            return Err(AlignError::Clip(error));
        }
    }
    if key_frames.is_empty()
        && let Some(error) = broken
    {
        return Err(AlignError::Clip(error));
    }
    Ok(Ok(Fused {
        cloud_in_world: tsdf.surface(),
        key_frames,
        broken: broken_count,
        truncated: tsdf.is_full(),
    }))
}

/// Frames in memory at a time: enough to keep many cores busy with decoding, and all that a long clip needs
/// more than a short one is its surface.
const BATCH: usize = 16;

/// The posed frames far enough from the one chosen before, with their places in the clip.
pub(super) fn choose(
    clip: &Clip,
    frames: Option<&Range<u32>>,
    tracked: Option<&[Option<Pose3>]>,
    params: &FuseParams,
) -> Vec<(usize, Pose3)> {
    let wanted = |number: u32| frames.is_none_or(|range| range.contains(&number));
    let mut chosen: Vec<(usize, Pose3)> = Vec::new();
    for (index, header) in clip.frames().iter().enumerate() {
        let pose = tracked.map_or(header.world_from_camera, |poses| poses.get(index).copied().flatten());
        let Some(pose) = pose.filter(|_| wanted(header.number)) else { continue };
        let moved = chosen.last().is_none_or(|(_, last)| {
            let step = last.inverse() * pose;
            step.translation.vector.norm() >= params.key_distance_m
                || step.rotation.angle() >= params.key_angle_rad
        });
        if moved {
            chosen.push((index, pose));
        }
    }
    let stride = chosen.len().div_ceil(params.max_key_frames).max(1);
    chosen.into_iter().step_by(stride).collect()
}

/// The variance of the Laplacian of a picture's green channel at a quarter of its size: motion blurs it away
/// (Pech-Pacheco et al., 2000).
fn sharpness(picture: &image::RgbImage) -> f32 {
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

/// The mean of the cameras' upward picture axes: which way is up when nothing better is known, for a device
/// that was held upright more often than not. None when the cameras contradict each other.
pub fn mean_camera_up(key_frames: &[KeyFrame]) -> Option<Vector3> {
    let sum: Vector3 = key_frames.iter().map(|k| k.world_from_camera.rotation * -Vector3::y()).sum();
    (sum.norm() > 0.2 * key_frames.len() as f64).then(|| sum.normalize())
}
