//! Spectacular AI's recordings: `data.jsonl`, colour as `data.mp4` or `data.mov` (or pictures in `frames/`), depth as
//! pictures in `frames2/`, `calibration.json` (SpectacularAI/docs, other/DATA_FORMAT.md; depth's scale: their
//! sdk-examples, issue 123).
//!
//! Depth as a second video is not read: mp4 cannot hold 16 bits.

mod lines;

use super::inertial::Forces;
use super::json::read_json;
use super::numbered::{number, numbered_under};
use super::text::{pose_from_quaternion, pose_from_rows};
use super::trajectory::{Timed, pose_at};
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, OPENCV, Of, Source, only_root,
    roots_of, video,
};
use crate::clip::MAX_FRAMES;
use crate::container::Container;
use crate::geometry::{Pose3, Vector3};
use nalgebra::Quaternion;
use serde::Deserialize;

const DATA: &str = "data.jsonl";
const CALIBRATION: &str = "calibration.json";
const MAX_CALIBRATION_BYTES: u64 = 1 << 20;
/// A frame lies between two poses that are at most this far from it.
const MAX_POSE_GAP_S: f64 = 0.05;
const TRUTH: &str = "groundTruth";
/// An hour and more at a hundred poses a second; those behind are not read.
const MAX_POSES: usize = 500_000;
/// As many of the accelerometer's.
const MAX_FORCES: usize = 500_000;
/// Depth of micrometres, and of decimetres, that nobody records.
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
    imu_to_camera: Option<[[f64; 4]; 4]>,
    #[serde(default)]
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

/// Finds the recording in a container; none when there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some(root) = only_root(roots_of(container, DATA))? else { return Ok(None) };
    let pictures = |folder: &str| {
        numbered_under(container, &format!("{root}{folder}/"), |file| {
            let (stem, ending) = file.rsplit_once('.')?;
            number(stem).filter(|_| matches!(ending, "png" | "jpg" | "jpeg"))
        })
    };
    let depth = pictures("frames2")?;
    if depth.is_empty() {
        for file in ["data2.mkv", "data2.mp4", "data2.mov"] {
            let name = format!("{root}{file}");
            if container.contains(&name) {
                return Err(ClipError::DepthVideo { name });
            }
        }
    }
    let color = pictures("frames")?;
    let video =
        if color.is_empty() { video::find(container, root, &["data.mp4", "data.mov"])? } else { None };
    let calibration = format!("{root}{CALIBRATION}");
    let first = if container.contains(&calibration) {
        let file: Calibration = read_json(container, &calibration, MAX_CALIBRATION_BYTES)?;
        file.cameras.into_iter().next()
    } else {
        None
    };

    let name = format!("{root}{DATA}");
    let mut poses: Vec<Timed<Pose3>> = Vec::new();
    let mut frames = Vec::new();
    let mut method: Option<String> = None;
    let mut felt: Vec<Timed<Vector3>> = Vec::new();
    lines::read(container, &name, |line| {
        if let Some(pose) = line.pose() {
            // The truth where there is one, else the method that comes first; never two at once.
            let is_better = pose.method == TRUTH && method.as_deref() != Some(TRUTH);
            if is_better || method.is_none() {
                poses.clear();
                method = Some(pose.method.to_string());
            }
            if method.as_deref() == Some(pose.method) && poses.len() < MAX_POSES {
                let rotation = Quaternion::new(
                    pose.orientation.w,
                    pose.orientation.x,
                    pose.orientation.y,
                    pose.orientation.z,
                );
                let position = Vector3::new(pose.position.x, pose.position.y, pose.position.z);
                poses.extend(
                    pose_from_quaternion(rotation, position)
                        .map(|value| Timed { time_s: pose.time_s, value }),
                );
            }
        }
        felt.extend(line.force().filter(|_| felt.len() < MAX_FORCES));
        frames.extend(line.frame());
        if frames.len() > MAX_FRAMES {
            return Err(ClipError::TooManyFrames { frames: frames.len(), max: MAX_FRAMES });
        }
        Ok(())
    })?;
    poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    frames.sort_by_key(|frame: &lines::FrameLine| frame.number);
    frames.dedup_by_key(|frame| frame.number);

    let calibrated =
        first.as_ref().and_then(|camera| pose_from_rows(camera.imu_to_camera.as_ref()?.as_flattened()));
    let calibrated = calibrated.unwrap_or_else(Pose3::identity);
    // The cameras stay where they are mounted.
    let mounted = frames.first().and_then(|frame| frame.camera_from_imu).unwrap_or(calibrated);
    felt.iter_mut().for_each(|sample| sample.value = mounted.rotation * sample.value);
    let forces = Forces::new(felt);

    let shown = video.as_ref().map_or(0, |(_, _, info)| info.time_s.len());
    let mut units_per_m = None;
    let mut intrinsics = first.as_ref().map(CalibratedCamera::numbers);
    let mut sources = Vec::new();
    for frame in &frames {
        let number = frame.number;
        intrinsics = intrinsics.or(frame.numbers);
        let color = match &video {
            Some((_, _, info)) if (number as usize) < shown => {
                Some(ColorAt::Video { frame: number, size: (info.width, info.height) })
            }
            Some(_) => None,
            None => color.get(&number).map(|name| ColorAt::File(name.to_string())),
        };
        let (Some(color), Some(depth)) = (color, depth.get(&number)) else { continue };
        if let Some(scale) = frame.depth_scale {
            if !DEPTH_SCALES_M.contains(&scale) {
                let reason = format!("{scale} m for a unit of depth (depthScale) cannot be");
                return Err(ClipError::NotMetric { name, reason });
            }
            units_per_m.get_or_insert((1.0 / scale) as f32);
        }
        let camera_from_imu = frame.camera_from_imu.unwrap_or(calibrated);
        sources.push(Source {
            number,
            time_s: Some(frame.time_s),
            world_from_camera: pose_at(&poses, frame.time_s, MAX_POSE_GAP_S)
                .map(|world_from_imu| world_from_imu * camera_from_imu.inverse()),
            color,
            depth: DepthAt::Png(depth.to_string()),
            confidence: None,
            numbers: frame.numbers,
        });
    }
    let color_pictures = color.len() + shown;
    let incomplete = frames.len().max(depth.len()) - sources.len();
    let Some(numbers) = intrinsics else {
        return Err(ClipError::MissingIntrinsics {
            name: format!("{calibration}, or cameraParameters of frames"),
        });
    };
    let mut notes = vec![format!("poses are those of {}", method.as_deref().unwrap_or("nobody"))];
    if let Some((name, _, info)) = &video {
        notes.push(video::words(name, info));
    }
    if units_per_m.is_none() {
        notes.push("frames have no depthScale: millimetres were assumed".to_string());
    }
    if first.is_some_and(|camera| camera.distortion_coefficients.iter().any(|k| k.abs() > 1e-3)) {
        notes.push("the lens distortion of calibration.json was not undone".to_string());
    }
    Ok(Some(Layout {
        name: "spectacular_ai",
        pose_convention: OPENCV,
        pose_files: "data.jsonl, groundTruth or a method's output",
        depth_unit: "depthScale, else millimetres (16-bit PNG)",
        depth_units_per_m: units_per_m.unwrap_or(1000.0),
        gravity: "world z is up (layout)".to_string(),
        up_in_world: Some(Vector3::z()),
        forces,
        color_pictures,
        depth_pictures: depth.len(),
        shutter: None,
        incomplete,
        cameras: Cameras::One(Intrinsics { name, numbers }),
        intrinsics: "cameraParameters of each frame, else calibration.json; depth is scaled to it"
            .to_string(),
        sources,
        region: None,
        video: video.map(|(name, region, _)| (name, region)),
        notes,
    }))
}
