//! Reads `data.jsonl` line by line: it has hundreds of lines per second.

use crate::clip::ClipError;
use crate::clip::layout::json::or_default;
use crate::clip::layout::text::pose_from_rows;
use crate::clip::layout::trajectory::Timed;
use crate::clip::layout::{Numbers, Of};
use crate::container::{Container, ContainerError};
use crate::json;
use serde::Deserialize;
use serde_json::{Map, Value};
use std::io::{BufRead, BufReader, Read};
use viola_geometry::{Pose3, Vector3};

const MAX_BYTES: u64 = 4 << 30;
const MAX_LINE_BYTES: u64 = 64 << 10;

#[derive(Deserialize)]
pub(super) struct Line {
    time: Option<f64>,
    number: Option<u32>,
    frames: Option<Vec<FrameEntry>>,
    #[serde(flatten)]
    others: Map<String, Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct FrameEntry {
    #[serde(default, deserialize_with = "or_default")]
    camera_ind: u32,
    camera_parameters: Option<Parameters>,
    imu_to_camera: Option<[[f64; 4]; 4]>,
    /// Metres per unit of the depth picture.
    depth_scale: Option<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Parameters {
    focal_length_x: f64,
    focal_length_y: f64,
    principal_point_x: f64,
    principal_point_y: f64,
}

#[derive(Deserialize)]
pub(super) struct Position {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

#[derive(Deserialize)]
pub(super) struct Orientation {
    pub w: f64,
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

#[derive(Deserialize)]
struct PoseEntry {
    position: Position,
    orientation: Orientation,
}

/// A pose of the device, by the ground truth or by a method.
pub(super) struct PoseLine<'a> {
    pub time_s: f64,
    /// `groundTruth`, or the method's name.
    pub method: &'a str,
    pub position: Position,
    pub orientation: Orientation,
}

/// Data of a frame.
pub(super) struct FrameLine {
    pub number: u32,
    pub time_s: f64,
    pub numbers: Option<Numbers>,
    pub camera_from_imu: Option<Pose3>,
    /// Metres per unit of the depth picture.
    pub depth_scale: Option<f64>,
}

/// A reading of one of the device's sensors.
#[derive(Deserialize)]
struct Sensor {
    #[serde(rename = "type")]
    kind: String,
    values: Vec<f64>,
}

impl Line {
    /// Returns the accelerometer's force, in the axes of the device's sensors.
    pub fn force(&self) -> Option<Timed<Vector3>> {
        let sensor = Sensor::deserialize(self.others.get("sensor")?).ok()?;
        let [x, y, z] = *sensor.values.as_slice() else { return None };
        let value = Vector3::new(x, y, z);
        (sensor.kind == "accelerometer").then_some(Timed { time_s: self.time?, value })
    }

    pub fn pose(&self) -> Option<PoseLine<'_>> {
        let time_s = self.time.filter(|time_s| time_s.is_finite())?;
        let is_pose = |entry: &(&String, &Value)| entry.1.get("orientation").is_some();
        // A line may have the poses of several methods.
        let truth = self.others.get_key_value(super::TRUTH).filter(is_pose);
        let (name, entry) = truth.or_else(|| self.others.iter().find(is_pose))?;
        let PoseEntry { position, orientation } = PoseEntry::deserialize(entry).ok()?;
        Some(PoseLine { time_s, method: name, position, orientation })
    }

    pub fn frame(&self) -> Option<FrameLine> {
        let time_s = self.time.filter(|time_s| time_s.is_finite())?;
        let entries = self.frames.as_ref()?;
        let color = entries.iter().find(|entry| entry.camera_ind == 0)?;
        Some(FrameLine {
            number: self.number?,
            time_s,
            numbers: color.camera_parameters.as_ref().map(|p| Numbers {
                fx: p.focal_length_x,
                fy: p.focal_length_y,
                cx: p.principal_point_x,
                cy: p.principal_point_y,
                of: Of::Color,
            }),
            camera_from_imu: color.imu_to_camera.as_ref().and_then(|m| pose_from_rows(m.as_flattened())),
            depth_scale: entries.iter().find_map(|entry| entry.depth_scale),
        })
    }
}

/// Passes every line to `take`.
pub(super) fn read(
    container: &dyn Container,
    name: &str,
    mut take: impl FnMut(Line) -> Result<(), ClipError>,
) -> Result<(), ClipError> {
    let region = container.region(name, MAX_BYTES)?;
    let mut reader = BufReader::new(region.reader());
    let mut text = Vec::new();
    for number in 1.. {
        text.clear();
        let bad = |reason: String| ClipError::BadIndex { name: name.to_string(), line: number, reason };
        let unreadable = |source| ContainerError::Unreadable { name: name.to_string(), source };
        reader.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut text).map_err(unreadable)?;
        if text.is_empty() {
            break;
        }
        if text.len() as u64 == MAX_LINE_BYTES {
            return Err(bad(format!("a line has at most {MAX_LINE_BYTES} bytes")));
        }
        if text.trim_ascii().is_empty() {
            continue;
        }
        let line = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);
        take(json::parse(line).map_err(bad)?)?;
    }
    Ok(())
}
