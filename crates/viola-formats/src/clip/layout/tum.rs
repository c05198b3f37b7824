//! TUM RGB-D: `rgb.txt` and `depth.txt` list pictures by time, `groundtruth.txt` lists poses
//! (Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", 2012, and the data set's pages).
//!
//! The three lists are not synchronised. Colour and depth pictures nearest in time form a frame; its time is
//! the depth picture's, and its pose is interpolated to the readout of that picture's middle row.

use super::associate::associate;
use super::inertial::Forces;
use super::text::{listed_path, parse_row, pose_from_quaternion, read_intrinsics, read_table};
use super::trajectory::{Timed, pose_at, times};
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source, incomplete, only_root,
    roots_of,
};
use crate::clip::{Shutter, picture};
use crate::container::Container;
use nalgebra::Quaternion;
use viola_geometry::{Pose3, Vector3};

const INTRINSICS: &str = "camera-intrinsics.txt";
/// Maximum time between the pictures of a frame, and between a frame and the poses around it.
const MAX_GAP_S: f64 = 0.02;
/// The default calibration of ROS drivers and of the data set's pages, for a Kinect's 640x480 pictures.
pub(super) const KINECT: Numbers =
    Numbers { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, of: Of::Size(640, 480) };

/// Readout times of a Kinect (Ringaby and Forssen, "Scan Rectification for Structured Light Range Sensors
/// with Rolling Shutters", 2011).
const KINECT_SHUTTER: Shutter = Shutter { color_s: 0.0261, depth_s: 0.0306 };

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let has = |root: &str, file: &str| container.contains(&format!("{root}{file}"));
    // Without colour, the poses are needed: there is nothing to track the camera by.
    let is_root = |root: &&str| has(root, "rgb.txt") || has(root, "groundtruth.txt");
    let Some(root) = only_root(roots_of(container, "depth.txt").filter(is_root))? else {
        return Ok(None);
    };
    let color = read_list(container, root, "rgb.txt")?;
    let has_color = !color.present.is_empty() || color.missing > 0;
    let depth = read_list(container, root, "depth.txt")?;
    let poses = read_poses(container, &format!("{root}groundtruth.txt"))?;
    let (color_pictures, depth_pictures) = (color.present.len(), depth.present.len());

    let pictures_of: Vec<(Option<usize>, usize)> = if has_color {
        let pairs = associate(&times(&color.present), &times(&depth.present), MAX_GAP_S);
        pairs.into_iter().map(|(color, depth)| (Some(color), depth)).collect()
    } else {
        (0..depth_pictures).map(|depth| (None, depth)).collect()
    };
    let incomplete =
        incomplete(color_pictures, depth_pictures, pictures_of.len()) + color.missing + depth.missing;
    let mut notes = Vec::new();
    let file = format!("{root}{INTRINSICS}");
    let is_given = container.contains(&file);
    if !is_given && depth.present.first().is_some_and(|picture| is_not_of_kinect(container, &picture.value)) {
        return Err(ClipError::MissingIntrinsics { name: file });
    }
    let (cameras, shutter, intrinsics) = if is_given {
        let cameras = Cameras::One(read_intrinsics(container, &file, Of::Depth)?);
        (cameras, None, format!("{INTRINSICS}, for colour and depth"))
    } else {
        notes.push(format!("there is no {INTRINSICS}; the Kinect's usual calibration was assumed"));
        let assumed = Intrinsics { name: format!("{INTRINSICS} (assumed)"), numbers: KINECT };
        let words = "assumed: fx = fy = 525, cx = 319.5, cy = 239.5 for 640x480, scaled to the pictures";
        (Cameras::One(assumed), Some(KINECT_SHUTTER), words.to_string())
    };
    // A picture's time is its complete arrival; its middle row was read before. By the camera's turn rates,
    // the pictures of `freiburg1_rpy` are 14 ms behind the motion capture (docs/experiments.md).
    let late_s = shutter.map_or(0.0, |shutter: Shutter| shutter.depth_s / 2.0);
    if has_color {
        notes.push(format!("colour and depth were paired by nearest time within {MAX_GAP_S} s"));
    }
    notes.push(format!(
        "poses were interpolated to when the depth picture's middle row was read, {:.0} ms before its time, \
         from those within {MAX_GAP_S} s of it",
        late_s * 1e3
    ));
    let sources = pictures_of.iter().enumerate().map(|(number, &(color_index, depth_index))| {
        let picture = &depth.present[depth_index];
        Source {
            number: number as u32,
            time_s: Some(picture.time_s),
            world_from_camera: pose_at(&poses, picture.time_s - late_s, MAX_GAP_S),
            color: color_index
                .map_or(ColorAt::Absent, |index| ColorAt::File(color.present[index].value.clone())),
            depth: DepthAt::Png(picture.value.clone()),
            confidence: None,
            numbers: None,
        }
    });
    let sources = sources.collect();

    let forces = read_forces(container, &format!("{root}accelerometer.txt"))?;
    let gravity = if forces.is_empty() { "unknown" } else { "as the accelerometer felt it" };
    Ok(Some(Layout {
        pose_files: "groundtruth.txt",
        depth_unit: "5000 a metre (16-bit PNG)",
        depth_units_per_m: 5000.0,
        gravity: gravity.to_string(),
        forces,
        color_pictures,
        depth_pictures,
        shutter,
        incomplete,
        intrinsics,
        notes,
        ..Layout::new("tum_rgbd", cameras, sources)
    }))
}

/// Returns whether a picture has another aspect ratio than a Kinect's 4:3, up to cropping by some pixels.
fn is_not_of_kinect(container: &dyn Container, name: &str) -> bool {
    let ratio = |(width, height): (u32, u32)| f64::from(width) * 0.75 / f64::from(height);
    // A damaged picture is refused later.
    picture::size(container, name).is_ok_and(|size| (ratio(size) - 1.0).abs() > 0.02)
}

/// The pictures of a list in the order of their times, and the number of missing ones.
struct List {
    present: Vec<Timed<String>>,
    missing: usize,
}

/// Empty without the file.
fn read_list(container: &dyn Container, root: &str, file: &str) -> Result<List, ClipError> {
    let name = format!("{root}{file}");
    let mut list = List { present: Vec::new(), missing: 0 };
    if !container.contains(&name) {
        return Ok(list);
    }
    for (line, text) in read_table(container, &name)?.rows() {
        let bad = |reason: &str| ClipError::BadIndex { name: name.clone(), line, reason: reason.to_string() };
        let (time, picture) =
            text.split_once(char::is_whitespace).ok_or_else(|| bad("expected a time and a file name"))?;
        let time_s = time.parse().ok().filter(|t: &f64| t.is_finite()).ok_or_else(|| bad("bad time"))?;
        let value = format!("{root}{}", listed_path(picture.trim()));
        if container.contains(&value) {
            list.present.push(Timed { time_s, value });
        } else {
            list.missing += 1;
        }
    }
    list.present.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(list)
}

/// Reads the accelerometer's forces in the camera's axes. Empty without the file.
///
/// A Kinect's accelerometer has x and y opposite to its camera's. So rotated, the forces of `freiburg1_rpy`
/// are upright in the motion capture's world to 4 degrees; no other right-angled rotation does that.
fn read_forces(container: &dyn Container, name: &str) -> Result<Forces, ClipError> {
    let mut samples = Vec::new();
    if container.contains(name) {
        for (line, text) in read_table(container, name)?.rows() {
            let [time_s, ax, ay, az] = parse_row(text).ok_or_else(|| ClipError::BadIndex {
                name: name.to_string(),
                line,
                reason: "expected 4 numbers: time ax ay az".to_string(),
            })?;
            samples.push(Timed { time_s, value: Vector3::new(-ax, -ay, az) });
        }
    }
    Ok(Forces::new(samples))
}

/// Reads the trajectory in the order of time; rows without a finite pose are skipped. Empty without the file.
pub(super) fn read_poses(container: &dyn Container, name: &str) -> Result<Vec<Timed<Pose3>>, ClipError> {
    let mut poses = Vec::new();
    if !container.contains(name) {
        return Ok(poses);
    }
    for (line, text) in read_table(container, name)?.rows() {
        let [time_s, tx, ty, tz, qx, qy, qz, qw] = parse_row(text).ok_or_else(|| ClipError::BadIndex {
            name: name.to_string(),
            line,
            reason: "expected 8 numbers: time tx ty tz qx qy qz qw".to_string(),
        })?;
        let pose = pose_from_quaternion(Quaternion::new(qw, qx, qy, qz), Vector3::new(tx, ty, tz));
        if let (true, Some(value)) = (time_s.is_finite(), pose) {
            poses.push(Timed { time_s, value });
        }
    }
    poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(poses)
}
