//! TUM RGB-D: `rgb.txt` and `depth.txt` list pictures by time, `groundtruth.txt` lists poses
//! (Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", 2012, and the data set's pages).
//!
//! The three lists are not synchronised. Colour and depth pictures nearest in time form a frame; its time is
//! the depth picture's, and its pose is interpolated to the readout of that picture's middle row.

use super::associate::associate;
use super::inertial::Forces;
use super::text::{
    MAX_DISTANCE_M, listed_path, parse_row, pose_from_quaternion, read_intrinsics, read_table,
};
use super::trajectory::{Timed, no_pose_near, pose_at, times};
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source, incomplete,
    no_pose_without, only_root, roots_of,
};
use crate::clip::files::find_file;
use crate::clip::{MAX_FRAMES, Shutter, picture};
use crate::container::Container;
use nalgebra::Quaternion;
use viola_geometry::{Pose3, Vector3};

const INTRINSICS: &str = "camera-intrinsics.txt";
const POSES: &str = "groundtruth.txt";
/// Maximum time between the pictures of a frame.
const MAX_GAP_S: f64 = 0.02;
/// Limits of [`max_pose_gap_s`]. Motion capture has 100 poses a second, and the slowest odometry has 10: between two poses
/// 0.22 s apart, a hand that accelerates by 1 m/s2 is at most 6 mm from the straight line.
const POSE_GAPS_S: (f64, f64) = (0.02, 0.11);
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
    let is_root = |root: &&str| has(root, "rgb.txt") || has(root, POSES);
    let Some(root) = only_root(roots_of(container, "depth.txt").filter(is_root))? else {
        return Ok(None);
    };
    let mut notes = Vec::new();
    let color = read_list(container, root, "rgb.txt", &mut notes)?;
    let has_color = !color.present.is_empty() || color.missing > 0;
    let depth = read_list(container, root, "depth.txt", &mut notes)?;
    let poses = read_poses(container, &format!("{root}{POSES}"), &mut notes)?;
    let forces = read_forces(container, &format!("{root}accelerometer.txt"), &mut notes)?;
    let max_pose_gap_s = max_pose_gap_s(&poses);
    let (color_pictures, depth_pictures) = (color.present.len(), depth.present.len());

    let pictures_of: Vec<(Option<usize>, usize)> = if has_color {
        let pairs = associate(&times(&color.present), &times(&depth.present), MAX_GAP_S);
        pairs.into_iter().map(|(color, depth)| (Some(color), depth)).collect()
    } else {
        (0..depth_pictures).map(|depth| (None, depth)).collect()
    };
    let incomplete =
        incomplete(color_pictures, depth_pictures, pictures_of.len()) + color.missing + depth.missing;
    let file = find_file(container, &format!("{root}{INTRINSICS}"));
    let first = depth.present.first().filter(|_| file.is_none());
    if first.is_some_and(|picture| is_not_of_kinect(container, &picture.value)) {
        return Err(ClipError::MissingIntrinsics { name: format!("{root}{INTRINSICS}") });
    }
    let (cameras, shutter, intrinsics) = if let Some(file) = file {
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
         between poses at most {:.2} s apart",
        late_s * 1e3,
        2.0 * max_pose_gap_s
    ));
    let sources = pictures_of.iter().enumerate().map(|(number, &(color_index, depth_index))| {
        let picture = &depth.present[depth_index];
        let color =
            color_index.map_or(ColorAt::Absent, |index| ColorAt::File(color.present[index].value.clone()));
        Source {
            time_s: Some(picture.time_s),
            world_from_camera: pose_at(&poses, picture.time_s - late_s, max_pose_gap_s),
            ..Source::new(number as u32, color, DepthAt::Png(picture.value.clone()))
        }
    });
    let gravity = if forces.is_empty() { "unknown" } else { "as the accelerometer felt it" };
    Ok(Some(Layout {
        pose_files: POSES,
        no_pose: no_pose(has(root, POSES), &poses, &times(&depth.present), max_pose_gap_s),
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
        ..Layout::new("tum_rgbd", cameras, sources.collect())
    }))
}

/// Returns the reason if no frame has a pose.
fn no_pose(has_file: bool, poses: &[Timed<Pose3>], depth_s: &[f64], max_gap_s: f64) -> Option<String> {
    if has_file { no_pose_near(POSES, poses, depth_s, max_gap_s) } else { Some(no_pose_without(POSES)) }
}

/// Returns the maximum time between a picture and the nearer of the poses around it; these are at most twice as far apart.
/// It is a tenth more than the usual interval of the poses, within [`POSE_GAPS_S`]: a missing pose is bridged, and lost
/// tracking is not. The benchmark's `evaluate_rpe.py` takes poses up to twice their median interval away.
fn max_pose_gap_s(poses: &[Timed<Pose3>]) -> f64 {
    let mut intervals_s: Vec<f64> = poses.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
    intervals_s.sort_by(f64::total_cmp);
    let usual_s = intervals_s.get(intervals_s.len() / 2).copied().unwrap_or_default();
    (1.1 * usual_s).clamp(POSE_GAPS_S.0, POSE_GAPS_S.1)
}

/// Returns whether a picture has another aspect ratio than a Kinect's 4:3, up to cropping by some pixels.
pub(super) fn is_not_of_kinect(container: &dyn Container, name: &str) -> bool {
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
fn read_list(
    container: &dyn Container,
    root: &str,
    file: &str,
    notes: &mut Vec<String>,
) -> Result<List, ClipError> {
    let name = format!("{root}{file}");
    let (mut list, mut more) = (List { present: Vec::new(), missing: 0 }, 0);
    if !container.contains(&name) {
        return Ok(list);
    }
    read_table(container, &name)?.read_rows(notes, |text| {
        let (time, picture) =
            text.split_once(char::is_whitespace).ok_or("expected a time and a file name")?;
        let time_s = time.parse().ok().filter(|t: &f64| t.is_finite()).ok_or("bad time")?;
        match find_file(container, &format!("{root}{}", listed_path(picture.trim()))) {
            // They are counted only: a hostile list has millions.
            Some(_) if list.present.len() == MAX_FRAMES => more += 1,
            Some(value) => list.present.push(Timed { time_s, value }),
            None => list.missing += 1,
        }
        Ok(())
    })?;
    if more > 0 {
        return Err(ClipError::TooManyFrames { frames: MAX_FRAMES + more, max: MAX_FRAMES });
    }
    list.present.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(list)
}

/// Reads the accelerometer's forces in the camera's axes. Empty without the file.
///
/// A Kinect's accelerometer has x and y opposite to its camera's. So rotated, the forces of `freiburg1_rpy`
/// are upright in the motion capture's world to 4 degrees; no other right-angled rotation does that.
fn read_forces(container: &dyn Container, name: &str, notes: &mut Vec<String>) -> Result<Forces, ClipError> {
    let mut samples = Vec::new();
    if container.contains(name) {
        read_table(container, name)?.read_rows(notes, |text| {
            let [time_s, ax, ay, az] = parse_row(text).ok_or("expected 4 numbers: time ax ay az")?;
            samples.push(Timed { time_s, value: Vector3::new(-ax, -ay, az) });
            Ok(())
        })?;
    }
    Ok(Forces::new(samples))
}

/// Reads the trajectory in the order of time; rows without a finite pose are skipped. Empty without the file.
pub(super) fn read_poses(
    container: &dyn Container,
    name: &str,
    notes: &mut Vec<String>,
) -> Result<Vec<Timed<Pose3>>, ClipError> {
    let (mut poses, mut far) = (Vec::new(), 0);
    if !container.contains(name) {
        return Ok(poses);
    }
    read_table(container, name)?.read_rows(notes, |text| {
        let [time_s, tx, ty, tz, qx, qy, qz, qw] =
            parse_row(text).ok_or("expected 8 numbers: time tx ty tz qx qy qz qw")?;
        let at = Vector3::new(tx, ty, tz);
        far += usize::from((MAX_DISTANCE_M..f64::INFINITY).contains(&at.norm()));
        let pose = pose_from_quaternion(Quaternion::new(qw, qx, qy, qz), at);
        if let (true, Some(value)) = (time_s.is_finite(), pose) {
            poses.push(Timed { time_s, value });
        }
        Ok(())
    })?;
    if far > 0 {
        notes.push(format!(
            "{far} poses of {name} are {:.0} km or more from the origin, and were left out; subtract the same offset from all \
             positions",
            MAX_DISTANCE_M / 1e3
        ));
    }
    poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(poses)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_taken_from_as_far_as_they_usually_are_apart() {
        for (times_s, gap_s) in [
            (&[5.0][..], 0.02),
            (&[], 0.02),
            // Motion capture that lost its markers once, odometry of 16 Hz that lacks a pose, and key frames.
            (&[0.0, 0.01, 0.02, 0.9, 0.91, 0.92], 0.02),
            (&[0.0, 0.0625, 0.1875, 0.25], 0.06875),
            (&[0.0, 1.0, 2.5], 0.11),
        ] {
            let pose = |&time_s: &f64| Timed { time_s, value: Pose3::identity() };
            let poses: Vec<_> = times_s.iter().map(pose).collect();
            let found_s = max_pose_gap_s(&poses);
            assert!((found_s - gap_s).abs() < 1e-9, "{times_s:?}: {found_s} instead of {gap_s}");
        }
    }
}
