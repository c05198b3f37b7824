//! Spectacular AI's recordings: `data.jsonl`, colour as `data.mp4` or `data.mov` (or pictures in `frames/`),
//! depth as pictures in `frames2/`, `calibration.json` (SpectacularAI/docs, other/DATA_FORMAT.md; depth's
//! scale: their sdk-examples, issue 123).
//!
//! Depth as a second video is not read: mp4 cannot hold 16 bits.

mod lines;

use super::inertial::Forces;
use super::json::{or_default, read_json};
use super::numbered::{PICTURES, pictures_under};
use super::text::{pose_from_quaternion, pose_from_rows};
use super::trajectory::{Timed, pose_at};
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source, only_root, roots_of, video,
};
use crate::clip::MAX_FRAMES;
use crate::clip::files::find_file;
use crate::container::Container;
use crate::video::VideoInfo;
use nalgebra::Quaternion;
use serde::Deserialize;
use std::collections::BTreeMap;
use viola_geometry::{Pose3, Vector3};

const DATA: &str = "data.jsonl";
const CALIBRATION: &str = "calibration.json";
const MAX_CALIBRATION_BYTES: u64 = 1 << 20;
/// Maximum time between a frame and the poses before and after it.
const MAX_POSE_GAP_S: f64 = 0.05;
const TRUTH: &str = "groundTruth";
/// More than an hour at a hundred poses per second; later ones are ignored.
const MAX_POSES: usize = 500_000;
/// The same number of accelerometer samples.
const MAX_FORCES: usize = 500_000;
/// From a micrometre to a decimetre per unit of depth; no recorder uses other units.
const DEPTH_SCALES_M: std::ops::RangeInclusive<f64> = 1e-6..=0.1;

#[derive(Deserialize)]
struct Calibration {
    cameras: Vec<CalibratedCamera>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct CalibratedCamera {
    focal_length_x: f64,
    focal_length_y: f64,
    principal_point_x: f64,
    principal_point_y: f64,
    image_width: Option<u32>,
    image_height: Option<u32>,
    #[serde(alias = "imuToCameraMatrix")]
    imu_to_camera: Option<[[f64; 4]; 4]>,
    #[serde(default, deserialize_with = "or_default")]
    distortion_coefficients: Vec<f64>,
}

impl CalibratedCamera {
    fn numbers(&self) -> Numbers {
        let of = match (self.image_width, self.image_height) {
            (Some(width), Some(height)) => Of::Size(width, height),
            _ => Of::Color,
        };
        let (fx, fy) = (self.focal_length_x, self.focal_length_y);
        Numbers { fx, fy, cx: self.principal_point_x, cy: self.principal_point_y, of }
    }
}

/// The lines of `data.jsonl`, in the order of their times and numbers.
#[derive(Default)]
struct Recorded {
    poses: Vec<Timed<Pose3>>,
    /// The method of these poses.
    method: Option<String>,
    frames: Vec<lines::FrameLine>,
    felt: Vec<Timed<Vector3>>,
}

impl Recorded {
    fn read(container: &dyn Container, name: &str) -> Result<Recorded, ClipError> {
        let mut all = Recorded::default();
        lines::read(container, name, |line| {
            if let Some(pose) = line.pose() {
                all.add_pose(&pose);
            }
            all.felt.extend(line.force().filter(|_| all.felt.len() < MAX_FORCES));
            all.frames.extend(line.frame());
            if all.frames.len() > MAX_FRAMES {
                return Err(ClipError::TooManyFrames { frames: all.frames.len(), max: MAX_FRAMES });
            }
            Ok(())
        })?;
        all.poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        all.frames.sort_by_key(|frame| frame.number);
        all.frames.dedup_by_key(|frame| frame.number);
        Ok(all)
    }

    /// Keeps the poses of the ground truth if there is one, else of the first method; never of two.
    fn add_pose(&mut self, pose: &lines::PoseLine) {
        let is_better = pose.method == TRUTH && self.method.as_deref() != Some(TRUTH);
        if is_better || self.method.is_none() {
            self.poses.clear();
            self.method = Some(pose.method.to_string());
        }
        if self.method.as_deref() == Some(pose.method) && self.poses.len() < MAX_POSES {
            let lines::Orientation { w, x, y, z } = pose.orientation;
            let position = Vector3::new(pose.position.x, pose.position.y, pose.position.z);
            let value = pose_from_quaternion(Quaternion::new(w, x, y, z), position);
            self.poses.extend(value.map(|value| Timed { time_s: pose.time_s, value }));
        }
    }
}

/// Refuses depth as a video, with another error than for missing depth.
fn refuse_depth_video(container: &dyn Container, root: &str) -> Result<(), ClipError> {
    let names = ["data2.mkv", "data2.mp4", "data2.mov"].map(|file| format!("{root}{file}"));
    match names.iter().find_map(|name| find_file(container, name)) {
        Some(name) => Err(ClipError::DepthVideo { name }),
        None => Ok(()),
    }
}

fn first_camera(container: &dyn Container, calibration: &str) -> Result<Option<CalibratedCamera>, ClipError> {
    if !container.contains(calibration) {
        return Ok(None);
    }
    let file: Calibration = read_json(container, calibration, MAX_CALIBRATION_BYTES)?;
    Ok(file.cameras.into_iter().next())
}

fn units_per_m_of(scale_m: f64, name: &str) -> Result<f32, ClipError> {
    if !DEPTH_SCALES_M.contains(&scale_m) {
        let reason = format!("{scale_m} m for a unit of depth (depthScale) cannot be");
        return Err(ClipError::NotMetric { name: name.to_owned(), reason });
    }
    Ok((1.0 / scale_m) as f32)
}

fn notes(
    method: &str,
    are_millimetres_assumed: bool,
    is_distorted: bool,
    is_mounting_missing: bool,
) -> Vec<String> {
    let mut notes = vec![format!("poses are those of {method}")];
    if are_millimetres_assumed {
        notes.push("frames have no depthScale: millimetres were assumed".to_string());
    }
    if is_distorted {
        notes.push("the lens distortion of calibration.json was not undone".to_string());
    }
    if is_mounting_missing {
        notes.push(
            "the camera's place on the device (imuToCamera) is missing, so the poses are not used"
                .to_string(),
        );
    }
    notes
}

/// Returns the accelerometer's forces in the camera's axes; the cameras' mounting is constant.
fn forces_of(mut felt: Vec<Timed<Vector3>>, camera_from_imu: &Pose3) -> Forces {
    felt.iter_mut().for_each(|sample| sample.value = camera_from_imu.rotation * sample.value);
    Forces::new(felt)
}

/// Returns the place of a frame's colour: in the video if there is one, else in a picture.
fn color_of(number: u32, video: Option<&VideoInfo>, pictures: &BTreeMap<u32, &str>) -> Option<ColorAt> {
    let Some(info) = video else {
        return pictures.get(&number).map(|name| ColorAt::File(name.to_string()));
    };
    let is_shown = (number as usize) < info.time_s.len();
    is_shown.then_some(ColorAt::Video { frame: number, size: (info.width, info.height) })
}

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some(root) = only_root(roots_of(container, DATA))? else { return Ok(None) };
    let pictures = |folder: &str| pictures_under(container, &format!("{root}{folder}/"), &PICTURES);
    let depth = pictures("frames2")?;
    if depth.is_empty() {
        refuse_depth_video(container, root)?;
    }
    let color = pictures("frames")?;
    let video =
        if color.is_empty() { video::find(container, root, &["data.mp4", "data.mov"])? } else { None };
    let calibration = format!("{root}{CALIBRATION}");
    let first = first_camera(container, &calibration)?;
    let name = format!("{root}{DATA}");
    let Recorded { poses, method, frames, felt } = Recorded::read(container, &name)?;

    let calibrated =
        first.as_ref().and_then(|camera| pose_from_rows(camera.imu_to_camera.as_ref()?.as_flattened()));
    let mounted = frames.first().and_then(|frame| frame.camera_from_imu).or(calibrated);

    let shown = video.as_ref().map_or(0, |(_, _, info)| info.time_s.len());
    let mut units_per_m = None;
    let mut intrinsics = first.as_ref().map(CalibratedCamera::numbers);
    let mut sources = Vec::new();
    for frame in &frames {
        let number = frame.number;
        intrinsics = intrinsics.or(frame.numbers);
        let color = color_of(number, video.as_ref().map(|(_, _, info)| info), &color);
        let (Some(color), Some(depth)) = (color, depth.get(&number)) else { continue };
        if let Some(scale_m) = frame.depth_scale {
            let units = units_per_m_of(scale_m, &name)?;
            units_per_m.get_or_insert(units);
        }
        let camera_from_imu = frame.camera_from_imu.or(calibrated);
        sources.push(Source {
            time_s: Some(frame.time_s),
            world_from_camera: pose_at(&poses, frame.time_s, MAX_POSE_GAP_S)
                .zip(camera_from_imu)
                .map(|(world_from_imu, camera_from_imu)| world_from_imu * camera_from_imu.inverse()),
            numbers: frame.numbers,
            ..Source::new(number, color, DepthAt::Png(depth.to_string()))
        });
    }
    let color_pictures = color.len() + shown;
    let incomplete = frames.len().max(depth.len()) - sources.len();
    let Some(numbers) = intrinsics else {
        return Err(ClipError::MissingIntrinsics {
            name: format!("{calibration}, or cameraParameters of frames"),
        });
    };
    let method = method.as_deref().unwrap_or("nobody");
    let is_distorted =
        first.is_some_and(|camera| camera.distortion_coefficients.iter().any(|k| k.abs() > 1e-3));
    let mut notes = notes(method, units_per_m.is_none(), is_distorted, mounted.is_none());
    notes.extend(video.as_ref().map(|(name, _, info)| video::words(name, info)));
    Ok(Some(Layout {
        pose_files: "data.jsonl, groundTruth or a method's output",
        depth_unit: "depthScale, else millimetres (16-bit PNG)",
        depth_units_per_m: units_per_m.unwrap_or(1000.0),
        gravity: "world z is up (rule of the layout)".to_string(),
        up_in_world: Some(Vector3::z()),
        forces: mounted.map(|mounted| forces_of(felt, &mounted)).unwrap_or_default(),
        color_pictures,
        depth_pictures: depth.len(),
        incomplete,
        intrinsics: "cameraParameters of each frame, else calibration.json; depth is scaled to it"
            .to_string(),
        video: video.map(|(name, region, _)| (name, region)),
        notes,
        ..Layout::new("spectacular_ai", Cameras::One(Intrinsics { name, numbers }), sources)
    }))
}
