//! Maps from CARMEN logs: laser scans of a robot with its wheel odometry. The messages are those of CARMEN's
//! `logger_playback` page.
//!
//! The map's frame is the log's odometry frame, held at its first scan.

mod matcher;
mod raster;
mod scan;

use self::matcher::align_scans;
use super::build::{Parts, build, occupied_centres};
use super::{LidarError, LidarMap, MapMarks};
use scan::Scan;
use std::f64::consts::PI;
use viola_geometry::{Point2, Pose2};

/// Minimum motion between two used scans: closer ones add little.
const SCAN_STEP_M: f64 = 0.15;
const SCAN_STEP_RAD: f64 = 0.14;
/// Maximum number of scans of one log: 600 m of driving.
const MAX_SCANS: usize = 4_000;
const MAX_READINGS: usize = 4_096;
/// Maximum number of readings that are used of a scan.
const KEPT_READINGS: usize = 361;
/// Farther readings are outdoors, glass, or invalid.
const MAX_RANGE_M: f64 = 30.0;
const MIN_RANGE_M: f64 = 0.02;
const MAX_POSITION_M: f64 = 1e4;
const MESSAGES: [&str; 12] = [
    "PARAM",
    "SYNC",
    "ODOM",
    "FLASER",
    "RLASER",
    "RAWLASER1",
    "RAWLASER2",
    "ROBOTLASER1",
    "ROBOTLASER2",
    "TRUEPOS",
    "MARKER",
    "BUMPER",
];

/// A line with a scan of the log.
struct Message {
    pose: Pose2,
    start_rad: f64,
    step_rad: f64,
    max_range_m: f64,
    ranges_m: Vec<f64>,
}

/// Returns whether any line is a message of CARMEN's: other programs' messages may come first.
pub(super) fn is_log(text: &[u8]) -> bool {
    let mut names = text.split(|b| *b == b'\n').map(message_name);
    names.any(|name| MESSAGES.iter().any(|message| message.as_bytes() == name))
}

/// Returns the first word of a line.
fn message_name(line: &[u8]) -> &[u8] {
    line.trim_ascii_start().split(u8::is_ascii_whitespace).next().unwrap_or_default()
}

pub(super) fn read(bytes: &[u8]) -> Result<LidarMap, LidarError> {
    let mut notes = Vec::new();
    let scans = scans(bytes, &mut notes)?;
    let poses = align_scans(&scans)?;
    let last = (scans.last(), poses.last());
    if let (Some(scan), Some(pose)) = last {
        let moved_m = pose.distance_m(&scan.by_odometry);
        notes.push(format!(
            "{} scans were matched to each other; at the end that is {moved_m:.2} m from where the odometry ends",
            scans.len()
        ));
    }
    let grid = raster::raster(&scans, &poses)?;
    build(Parts {
        format: "carmen_log",
        frame: "metres, the log's odometry frame at its first scan, x right, y up",
        occupied_m: occupied_centres(&grid)?,
        cells: Some(grid),
        marks: MapMarks { robot: poses.last().copied(), ..MapMarks::default() },
        notes,
        ..Parts::default()
    })
}

/// Returns the front laser's scans, at least the minimum motion apart.
fn scans(bytes: &[u8], notes: &mut Vec<String>) -> Result<Vec<Scan>, LidarError> {
    let mut scans: Vec<Scan> = Vec::new();
    let (mut old, mut is_full) = (false, false);
    for (index, line) in bytes.split(|b| *b == b'\n').enumerate() {
        let bad = |reason: &str| LidarError::BadLog { line: index + 1, reason: reason.to_string() };
        if !matches!(message_name(line), b"FLASER" | b"ROBOTLASER1") {
            continue;
        }
        let line = std::str::from_utf8(line).map_err(|_| bad("it is not text"))?;
        let mut words = line.split_ascii_whitespace();
        let is_old = words.next() == Some("FLASER");
        old |= is_old;
        let message = if is_old { old_message(words) } else { message(words) };
        let message = message.ok_or_else(|| bad("its numbers are not those of a laser scan"))?;
        if !message.pose.is_finite() || message.pose.translation().amax() > MAX_POSITION_M {
            return Err(bad("its pose is not finite, or ten kilometres away"));
        }
        let is_near = |scan: &Scan| scan.by_odometry.is_within(&message.pose, SCAN_STEP_M, SCAN_STEP_RAD);
        if scans.last().is_some_and(is_near) {
            continue;
        }
        if scans.len() == MAX_SCANS {
            is_full = true;
            break;
        }
        let hits_m = message.hits_m();
        if !hits_m.is_empty() {
            scans.push(Scan { by_odometry: message.pose, hits_m });
        }
    }
    if scans.is_empty() {
        let reason = "it has no scan of a front laser (FLASER, ROBOTLASER1) with a reading".to_string();
        return Err(LidarError::BadLog { line: 1, reason });
    }
    if old {
        notes.push(
            "FLASER has no angles: half a circle was assumed, and its first pose was taken as the laser's"
                .to_string(),
        );
    }
    if is_full {
        notes.push(format!("only the first {MAX_SCANS} scans were used"));
    }
    Ok(scans)
}

/// Parses `FLASER n ranges... x y theta odom_x odom_y odom_theta time host time`.
fn old_message<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Message> {
    let count: usize = words.next()?.parse().ok()?;
    let ranges_m = numbers(&mut words, count)?;
    let [x_m, y_m, yaw_rad] = array(&mut words)?;
    // 181 readings cover each degree with both ends, 180 omit the last.
    let gaps = if count % 2 == 1 { count.saturating_sub(1) } else { count }.max(1);
    Some(Message {
        pose: Pose2::new(x_m, y_m, yaw_rad),
        start_rad: -PI / 2.0,
        step_rad: PI / gaps as f64,
        max_range_m: MAX_RANGE_M,
        ranges_m,
    })
}

/// Parses `ROBOTLASER1 type start fov step max accuracy remission_mode n ranges... m remissions... laser_x
/// laser_y laser_theta robot_x ...`.
fn message<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Message> {
    let [_, start_rad, fov_rad, step_rad, max_range_m, _, _] = array(&mut words)?;
    let count: usize = words.next()?.parse().ok()?;
    let ranges_m = numbers(&mut words, count)?;
    let remissions: usize = words.next()?.parse().ok()?;
    numbers(&mut words, remissions)?;
    let [x_m, y_m, yaw_rad] = array(&mut words)?;
    let is_angle = |v: f64| v.abs() <= 4.0 * PI;
    if !is_angle(start_rad) || !is_angle(fov_rad) || !is_angle(step_rad) || count == 0 {
        return None;
    }
    // Some loggers omit the step.
    let step_rad = if step_rad == 0.0 { fov_rad / count as f64 } else { step_rad };
    let max_range_m = if max_range_m > 0.0 { max_range_m.min(MAX_RANGE_M) } else { MAX_RANGE_M };
    Some(Message { pose: Pose2::new(x_m, y_m, yaw_rad), start_rad, step_rad, max_range_m, ranges_m })
}

/// Parses `count` numbers, at most `MAX_READINGS`.
fn numbers<'a>(words: &mut impl Iterator<Item = &'a str>, count: usize) -> Option<Vec<f64>> {
    if count > MAX_READINGS {
        return None;
    }
    (0..count).map(|_| words.next()?.parse().ok()).collect()
}

fn array<'a, const N: usize>(words: &mut impl Iterator<Item = &'a str>) -> Option<[f64; N]> {
    numbers(words, N)?.try_into().ok()
}

impl Message {
    fn hits_m(&self) -> Vec<Point2> {
        let every = self.ranges_m.len().div_ceil(KEPT_READINGS).max(1);
        let readings = self.ranges_m.iter().enumerate().step_by(every);
        // A reading at the maximum range is no hit. NaN fails both comparisons.
        let hits = readings.filter(|(_, range)| **range > MIN_RANGE_M && **range < self.max_range_m - 0.01);
        hits.map(|(index, range)| {
            let (s, c) = (self.start_rad + index as f64 * self.step_rad).sin_cos();
            Point2::new(range * c, range * s)
        })
        .collect()
    }
}
