//! Clips as files that other tools read: Stray Scanner, TUM RGB-D, ScanNet's export.

mod encode;
mod scannet;
mod sink;
mod stray;
mod tum;

pub use sink::{FolderSink, Sink, ZipSink};

use super::{Clip, ClipError, Frame};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;
use viola_geometry::progress::{Cancelled, Progress};
use viola_geometry::{Pinhole, Pose3, Vector3};

/// Frames decoded and encoded at a time; they are written in order.
const BATCH: usize = 8;
/// Seconds from one frame to the next for clips without times.
const STEP_S: f64 = 1.0 / 30.0;
/// A note is added if the views of two cameras differ by more than this ratio.
const MAX_VIEW_RATIO: f64 = 1.01;

/// A layout that clips are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WrittenLayout {
    StrayScanner,
    TumRgbd,
    Scannet,
}

/// Errors of writing a clip.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    #[error(transparent)]
    Clip(#[from] ClipError),
    #[error("cannot encode a picture: {0}")]
    Picture(#[from] image::ImageError),
    #[error("cannot write {name}: {source}")]
    Write { name: String, source: std::io::Error },
    #[error("no frame has a pose, and this layout needs them; TUM RGB-D does not")]
    NoPose,
    #[error("none of {frames} frames can be decoded; the first one: {source}")]
    NotDecoded { frames: usize, source: ClipError },
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Summary of a written clip.
#[derive(Debug, Clone)]
pub struct WrittenClip {
    pub frames: usize,
    /// Data that the layout cannot hold, and assumptions made.
    pub notes: Vec<String>,
}

/// The writer of a layout: files for each frame first, those of the whole clip at the end.
trait Writer: Sync {
    /// Returns the files of one frame, the `place`-th that is written.
    fn frame(&self, place: usize, frame: &Frame) -> Result<Vec<(String, Vec<u8>)>, WriteError>;
    /// Records the frame's data for the closing files.
    fn record(&mut self, place: usize, frame: &Frame);
    fn close(&mut self) -> Vec<(String, Vec<u8>)>;
}

/// Writes the frames that can be decoded and have a pose; TUM RGB-D takes those without one, too.
pub fn write(
    clip: &Clip,
    layout: WrittenLayout,
    sink: &mut dyn Sink,
    progress: &dyn Progress,
) -> Result<WrittenClip, WriteError> {
    let is_taken =
        |i: &usize| layout == WrittenLayout::TumRgbd || clip.frames()[*i].world_from_camera.is_some();
    let taken: Vec<usize> = (0..clip.frames().len()).filter(is_taken).collect();
    let mut notes = Vec::new();
    let without = clip.frames().len() - taken.len();
    if without > 0 {
        notes.push(format!("{without} frames without a pose were left out"));
    }
    let times_s: Vec<Option<f64>> = taken.iter().map(|&index| clip.frames()[index].time_s).collect();
    let has_times = increase(&times_s);
    if !has_times && layout != WrittenLayout::Scannet {
        let times = if times_s.contains(&None) { "has no times" } else { "has times that do not increase" };
        notes.push(format!("the clip {times}: 30 frames a second were assumed"));
    }
    let turn = upright(clip, layout, &mut notes);
    let mut writer = writer(layout);
    let (mut written, mut broken, mut first_error) = (0, 0, None);
    let (mut first_camera, mut other_cameras) = (None, 0);
    let mut frames = clip.stream(taken.clone());
    for done in (0..taken.len()).step_by(BATCH) {
        viola_geometry::progress::check(progress)?;
        progress.advance(done as f64 / taken.len() as f64);
        let mut batch = Vec::new();
        for frame in frames.next_batch(BATCH) {
            match frame {
                Ok(mut frame) => {
                    let place = written + batch.len();
                    let header = &mut frame.header;
                    header.world_from_camera = header.world_from_camera.map(|pose| turn * pose);
                    header.time_s = header.time_s.filter(|_| has_times).or(Some(place as f64 * STEP_S));
                    batch.push((place, frame));
                }
                Err(error) => {
                    broken += 1;
                    first_error.get_or_insert(error);
                }
            }
        }
        if let Some((0, first)) = batch.first() {
            notes.extend(one_camera(first).filter(|_| layout != WrittenLayout::Scannet));
            notes.extend(other_size(first).filter(|_| layout == WrittenLayout::TumRgbd));
        }
        let encoded: Vec<_> = batch.par_iter().map(|(place, frame)| writer.frame(*place, frame)).collect();
        for ((place, frame), files) in batch.iter().zip(encoded) {
            for (name, bytes) in files? {
                sink.put(&name, &bytes)?;
            }
            writer.record(*place, frame);
            let first = first_camera.get_or_insert(frame.depth_camera);
            other_cameras += usize::from(!is_same_view(first, &frame.depth_camera));
        }
        written += batch.len();
    }
    if written == 0 {
        let frames = taken.len();
        return Err(
            first_error.map_or(WriteError::NoPose, |source| WriteError::NotDecoded { frames, source })
        );
    }
    if broken > 0 {
        notes.push(format!("{broken} frames could not be decoded and were left out"));
    }
    if other_cameras > 0 {
        notes.push(format!(
            "{other_cameras} frames have other intrinsics than the first one, and one set was written for all"
        ));
    }
    for (name, bytes) in writer.close() {
        sink.put(&name, &bytes)?;
    }
    Ok(WrittenClip { frames: written, notes })
}

fn writer(layout: WrittenLayout) -> Box<dyn Writer> {
    match layout {
        WrittenLayout::StrayScanner => Box::new(stray::Stray::default()),
        WrittenLayout::TumRgbd => Box::new(tum::Tum::default()),
        WrittenLayout::Scannet => Box::new(scannet::Scannet::default()),
    }
}

/// Returns whether all times are known and increase by at least their last written digit: files are named by them.
fn increase(times_s: &[Option<f64>]) -> bool {
    const DIGIT_S: f64 = 1e-6;
    let known: Vec<f64> = times_s.iter().copied().flatten().collect();
    known.len() == times_s.len() && known.is_sorted_by(|a, b| b - a >= DIGIT_S)
}

/// Returns the rotation of the clip's world that makes the layout's axis up.
fn upright(clip: &Clip, layout: WrittenLayout, notes: &mut Vec<String>) -> Pose3 {
    let wanted = match layout {
        WrittenLayout::StrayScanner => Vector3::y(),
        WrittenLayout::Scannet => Vector3::z(),
        WrittenLayout::TumRgbd => {
            if clip.up_in_world().is_some() {
                notes.push(
                    "the up direction is known, and the layout has no place for it: it is lost".to_string(),
                );
            }
            return Pose3::identity();
        }
    };
    let Some(up) = clip.up_in_world() else {
        notes.push(
            "the up direction is not known, and readers of the layout take its world as upright: TUM RGB-D leaves it unknown"
                .to_string(),
        );
        return Pose3::identity();
    };
    let turn = UnitQuaternion::rotation_between(&up.direction, &wanted)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    Pose3::from_parts(Translation3::identity(), turn)
}

/// Returns a note if the views of the two cameras differ: these layouts have one set of intrinsics.
fn one_camera(frame: &Frame) -> Option<String> {
    (!is_same_view(&frame.color_camera, &frame.depth_camera)).then(|| {
        "colour and depth see differently, and the layout has one set of intrinsics: the depth's was written"
            .to_string()
    })
}

/// Returns whether two cameras have the same view, in pictures of their own sizes.
fn is_same_view(camera: &Pinhole, other: &Pinhole) -> bool {
    let camera = camera.resized(other.width, other.height);
    let near = |a: f64, b: f64| a < b * MAX_VIEW_RATIO && b < a * MAX_VIEW_RATIO;
    near(camera.fx, other.fx)
        && near(camera.fy, other.fy)
        && (camera.cx - other.cx).abs() < 2.0
        && (camera.cy - other.cy).abs() < 2.0
}

/// Returns a note if colour has other pixels than depth: tools of the benchmark take one set of intrinsics for both.
fn other_size(frame: &Frame) -> Option<String> {
    let (width, height) = frame.color.as_ref()?.dimensions();
    let depth = (frame.depth.width, frame.depth.height);
    ((width, height) != depth).then(|| {
        let (depth_width, depth_height) = depth;
        format!(
            "camera-intrinsics.txt is for the {depth_width}x{depth_height} pixels of the depth; colour has \
             {width}x{height}"
        )
    })
}

/// Returns the colour picture as a file; `None` if the clip has no colour.
fn color_file(frame: &Frame, name: String) -> Result<Option<(String, Vec<u8>)>, WriteError> {
    let Some(picture) = &frame.color else { return Ok(None) };
    Ok(Some((name, encode::jpeg(picture)?)))
}

/// Converts depth to integers, 0 for no reading; values that do not fit are dropped.
fn depth_units(frame: &Frame, units_per_m: f32) -> Vec<u16> {
    let units = |depth_m: &f32| match (depth_m * units_per_m).round() {
        units if units < f32::from(u16::MAX) => units as u16,
        _ => 0,
    };
    frame.depth.depth_m.iter().map(units).collect()
}

/// Formats a row, with the digits that restore the same numbers.
fn row(numbers: &[f64], separator: &str) -> String {
    numbers.iter().map(|value| format!("{value}")).collect::<Vec<_>>().join(separator) + "\n"
}
