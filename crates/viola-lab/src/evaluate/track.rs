//! `viola evaluate --track`: trajectory errors by the measures of Sturm et al. ("A Benchmark for the
//! Evaluation of RGB-D SLAM Systems", 2012).

mod measure;

pub use measure::{TrajectoryErrors, measure};

use super::memory::peak_memory_bytes;
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::time::Instant;
use viola_formats::clip::Frame;
use viola_geometry::Pose3;
use viola_geometry::progress::{Cancelled, Silent};
use viola_reconstruct::TrackParams;
use viola_reconstruct::track::{Lost, Tracker};

/// Result of one tracking method on one clip.
#[derive(Debug, Clone, Serialize)]
pub struct TrackRow {
    pub clip: String,
    pub method: String,
    pub frames: usize,
    pub tracked: usize,
    /// None if nothing was tracked.
    pub errors: Option<TrajectoryErrors>,
    pub frame_ms: f64,
    /// Memory of the method's key frames at the end, or peak memory of the process for other programs.
    pub memory_mb: f64,
    pub key_frames: Option<usize>,
    pub loops: Option<usize>,
    pub segments: usize,
    /// Reasons why segments ended, in clip order.
    pub lost: Vec<String>,
}

/// A trajectory of another program on the same frames.
#[derive(Debug, Clone, Deserialize)]
pub struct Foreign {
    pub clip: String,
    pub method: String,
    /// World-from-camera matrix of each frame, row-major; null without a pose.
    pub poses: Vec<Option<[[f64; 4]; 4]>>,
    pub frame_ms: f64,
    pub memory_mb: f64,
}

/// Returns our rows: odometry only, and with loops. Decoding `frames` is not timed.
pub fn ours(
    clip: &str,
    frames: &[Frame],
    truth: &[Option<Pose3>],
    params: &TrackParams,
) -> Result<Vec<TrackRow>, Cancelled> {
    [("viola, odometry only", false), ("viola", true)]
        .into_iter()
        .map(|(method, close_loops)| -> Result<TrackRow, Cancelled> {
            let params = TrackParams { close_loops, ..params.clone() };
            let since = Instant::now();
            let mut tracker = Tracker::new(&params);
            frames.iter().for_each(|frame| tracker.add(frame));
            let track = tracker.finish(&Silent)?;
            let seconds = since.elapsed().as_secs_f64();
            let poses = track.longest().map_or_else(Vec::new, |longest| track.poses_of(longest));
            let reason = |why: &Lost| why.code().to_owned();
            Ok(TrackRow {
                clip: clip.to_owned(),
                method: method.to_owned(),
                frames: frames.len(),
                tracked: poses.iter().flatten().count(),
                errors: measure(&poses, truth),
                frame_ms: 1e3 * seconds / frames.len().max(1) as f64,
                memory_mb: track.key_bytes as f64 / 1e6,
                key_frames: Some(track.key_frames),
                loops: close_loops.then_some(track.loops),
                segments: track.segments.len(),
                lost: track
                    .segments
                    .iter()
                    .filter_map(|segment| segment.ended.as_ref())
                    .map(reason)
                    .collect(),
            })
        })
        .collect()
}

/// Returns the row of another program.
pub fn foreign(other: &Foreign, truth: &[Option<Pose3>]) -> TrackRow {
    let poses: Vec<Option<Pose3>> = other.poses.iter().map(|rows| rows.as_ref().map(pose)).collect();
    TrackRow {
        clip: other.clip.clone(),
        method: other.method.clone(),
        frames: truth.len(),
        tracked: poses.iter().flatten().count(),
        errors: measure(&poses, truth),
        frame_ms: other.frame_ms,
        memory_mb: other.memory_mb,
        key_frames: None,
        loops: None,
        segments: 1,
        lost: Vec::new(),
    }
}

fn pose(rows: &[[f64; 4]; 4]) -> Pose3 {
    let turn = nalgebra::Matrix3::from_fn(|r, c| rows[r][c]);
    let shift = nalgebra::Vector3::from_fn(|r, _| rows[r][3]);
    Pose3::from_parts(shift.into(), nalgebra::UnitQuaternion::from_matrix(&turn))
}

/// Returns the medians and the number of lost clips of a set, as a table. A clip is lost if less than 90 % of
/// its frames have a pose, or if its error exceeds 10 % of its path.
pub fn summary(rows: &[TrackRow]) -> String {
    let mut methods: Vec<&str> = Vec::new();
    for row in rows {
        if !methods.contains(&row.method.as_str()) {
            methods.push(&row.method);
        }
    }
    let mut text = String::from(
        "| method | clips | ATE median | of the path, median | worst | lost | without a reason | time a frame |\n|---|---|---|---|---|---|---|---|\n",
    );
    for method in methods {
        let of: Vec<&TrackRow> = rows.iter().filter(|row| row.method == method).collect();
        let is_lost = |row: &TrackRow| {
            row.tracked * 10 < row.frames * 9 || row.errors.as_ref().is_none_or(|e| e.fraction_of_path > 0.1)
        };
        let lost = of.iter().filter(|row| is_lost(row)).count();
        let silent = of.iter().filter(|row| is_lost(row) && row.lost.is_empty()).count();
        let sorted = |pick: &dyn Fn(&TrajectoryErrors) -> f64| {
            let mut values: Vec<f64> = of.iter().filter_map(|row| row.errors.as_ref()).map(pick).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let median = |values: &[f64]| values.get(values.len() / 2).copied().unwrap_or(f64::NAN);
        let (ate, fraction) = (sorted(&|e| e.ate_m), sorted(&|e| e.fraction_of_path));
        let time = of.iter().map(|row| row.frame_ms).sum::<f64>() / of.len().max(1) as f64;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {method} | {} | {:.2} cm | {:.2} % | {:.2} % | {lost} | {silent} | {time:.1} ms |",
            of.len(),
            100.0 * median(&ate),
            100.0 * median(&fraction),
            100.0 * fraction.last().copied().unwrap_or(f64::NAN),
        );
    }
    text
}

/// Returns a table with one row per clip and method.
pub fn markdown(rows: &[TrackRow]) -> String {
    let mut text = String::from(
        "| clip | method | tracked | ATE rmse | of the path | rotation rmse | RPE a metre | RPE a degree | time a frame | memory | key frames | loops | segments, why they ended |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let errors = row.errors.as_ref().map_or("- | - | - | - | -".to_owned(), |e| {
            format!(
                "{:.2} cm | {:.2} % | {:.2} deg | {:.2} cm | {:.4} deg",
                100.0 * e.ate_m,
                100.0 * e.fraction_of_path,
                e.rotation_deg,
                100.0 * e.rpe_m_per_m,
                e.rpe_deg_per_deg
            )
        });
        let count = |count: Option<usize>| count.map_or("-".to_owned(), |count| count.to_string());
        let _ = writeln!(
            text,
            "| {} | {} | {}/{} | {errors} | {:.1} ms | {:.1} MB | {} | {} | {} {} |",
            row.clip,
            row.method,
            row.tracked,
            row.frames,
            row.frame_ms,
            row.memory_mb,
            count(row.key_frames),
            count(row.loops),
            row.segments,
            row.lost.join(", ")
        );
    }
    if let Some(peak) = peak_memory_bytes() {
        let _ = writeln!(
            text,
            "\nPeak memory of this process, all frames of a clip decoded in it: {} MiB.",
            peak >> 20
        );
    }
    text
}
