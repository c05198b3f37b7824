//! The table of a run, for people (Markdown), for programs (JSON) and for plots (CSV, a row a clip).

use super::ClipResult;
use crate::align::AlignmentState;
use serde::Serialize;
use std::fmt::Write;

/// One method on one kind of clip. Errors are over all clips that got a pose; a clip without one counts as
/// a failure in `success_rate` and in the recalls.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableRow {
    pub method: String,
    pub set: String,
    pub frames: usize,
    pub clips: usize,
    pub r_mean_deg: f64,
    pub r_median_deg: f64,
    pub t_mean_m: f64,
    pub t_median_m: f64,
    /// Share of the clips under 10 degrees and 0.3 m.
    pub success_rate: f64,
    /// Share of the clips with a translation error under each distance.
    pub recall_at_m: Vec<Recall>,
    /// Of the clips called `aligned`, the share that is no success; null when none was.
    pub wrong_when_aligned: Option<f64>,
    pub aligned_rate: f64,
    /// Median time of search, refinement and decision.
    pub seconds_median: f64,
    /// Median time of everything from the clip's file to its pose.
    pub seconds_total_median: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recall {
    pub within_m: f64,
    pub share: f64,
}

/// One row for each method and clip length, in the order of their first results.
pub fn tabulate(results: &[ClipResult]) -> Vec<TableRow> {
    let mut keys: Vec<(&str, &str, usize)> = Vec::new();
    for result in results {
        let key = (result.method.as_str(), result.set.as_str(), result.frames);
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    keys.into_iter()
        .map(|(method, set, frames)| {
            let of: Vec<&ClipResult> = results
                .iter()
                .filter(|r| (r.method.as_str(), r.set.as_str(), r.frames) == (method, set, frames))
                .collect();
            row(method, set, frames, &of)
        })
        .collect()
}

fn row(method: &str, set: &str, frames: usize, results: &[&ClipResult]) -> TableRow {
    let with_pose = |value: fn(&ClipResult) -> f64| -> Vec<f64> {
        results.iter().map(|r| value(r)).filter(|v| v.is_finite()).collect()
    };
    let (rotations, translations) =
        (with_pose(|r| r.rotation_error_deg), with_pose(|r| r.translation_error_m));
    let aligned: Vec<_> = results.iter().filter(|r| r.state == AlignmentState::Aligned).collect();
    let wrong = aligned.iter().filter(|r| !r.is_success()).count();
    let share = |count: usize| count as f64 / results.len().max(1) as f64;
    TableRow {
        method: method.to_owned(),
        set: set.to_owned(),
        frames,
        clips: results.len(),
        r_mean_deg: mean(&rotations),
        r_median_deg: median(&rotations),
        t_mean_m: mean(&translations),
        t_median_m: median(&translations),
        success_rate: share(results.iter().filter(|r| r.is_success()).count()),
        recall_at_m: [0.1, 0.3, 0.5, 1.0]
            .map(|within_m| {
                let count = results.iter().filter(|r| r.translation_error_m < within_m).count();
                Recall { within_m, share: share(count) }
            })
            .to_vec(),
        wrong_when_aligned: (!aligned.is_empty()).then(|| wrong as f64 / aligned.len() as f64),
        aligned_rate: share(aligned.len()),
        seconds_median: median(&with_pose(|r| r.register_seconds)),
        seconds_total_median: median(&with_pose(|r| r.seconds)),
    }
}

fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { f64::NAN } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// The lower of the two middle values when their number is even.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied().unwrap_or(f64::NAN)
}

pub fn markdown(rows: &[TableRow]) -> String {
    let mut out = String::from(
        "| method | set | frames | clips | success | R mean | R median | T mean | T median | <0.1 m | <0.5 m | <1 m | aligned | wrong when aligned | register | total |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for r in rows {
        let recall = |i: usize| r.recall_at_m.get(i).map_or(0.0, |recall| 100.0 * recall.share);
        let wrong = r.wrong_when_aligned.map_or("-".to_owned(), |w| format!("{:.1} %", 100.0 * w));
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {:.1} % | {:.2} deg | {:.2} deg | {:.3} m | {:.3} m | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {} | {:.3} s | {:.2} s |",
            r.method,
            r.set,
            r.frames,
            r.clips,
            100.0 * r.success_rate,
            r.r_mean_deg,
            r.r_median_deg,
            r.t_mean_m,
            r.t_median_m,
            recall(0),
            recall(2),
            recall(3),
            100.0 * r.aligned_rate,
            wrong,
            r.seconds_median,
            r.seconds_total_median,
        );
    }
    out
}

pub fn clips_csv(results: &[ClipResult]) -> String {
    let mut out = String::from(
        "method,set,frames,first_frame,last_frame,state,probability,r_error_deg,t_error_m,success,coverage,inliers,register_seconds,seconds\n",
    );
    for r in results {
        let state = match r.state {
            AlignmentState::Aligned => "aligned",
            AlignmentState::Ambiguous => "ambiguous",
            AlignmentState::Failed => "failed",
        };
        let probability = r.probability.map_or(String::new(), |p| format!("{p:.4}"));
        let _ = writeln!(
            out,
            "{},{},{},{},{},{state},{probability},{:.4},{:.4},{},{:.4},{:.4},{:.4},{:.4}",
            r.method,
            r.set,
            r.frames,
            r.first_frame,
            r.last_frame,
            r.rotation_error_deg,
            r.translation_error_m,
            r.is_success(),
            r.coverage,
            r.inliers,
            r.register_seconds,
            r.seconds,
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(state: AlignmentState, rotation_error_deg: f64, translation_error_m: f64) -> ClipResult {
        ClipResult {
            method: "viola".into(),
            set: "s".into(),
            frames: 60,
            first_frame: 0,
            last_frame: 59,
            state,
            probability: None,
            rotation_error_deg,
            translation_error_m,
            coverage: 0.5,
            inliers: 0.9,
            register_seconds: 0.1,
            seconds: 1.0,
        }
    }

    #[test]
    fn a_clip_without_a_pose_is_a_failure_and_no_error() {
        let rows = tabulate(&[
            result(AlignmentState::Aligned, 1.0, 0.05),
            result(AlignmentState::Aligned, 3.0, 0.35),
            result(AlignmentState::Ambiguous, 2.0, 0.2),
            result(AlignmentState::Failed, f64::INFINITY, f64::INFINITY),
        ]);
        assert_eq!(rows.len(), 1);
        let row = &rows[0];
        assert_eq!((row.clips, row.success_rate, row.aligned_rate), (4, 0.5, 0.5));
        assert_eq!(row.wrong_when_aligned, Some(0.5));
        assert!((row.r_mean_deg - 2.0).abs() < 1e-12 && (row.r_median_deg - 2.0).abs() < 1e-12);
        assert_eq!(row.recall_at_m.iter().map(|r| r.share).collect::<Vec<_>>(), [0.25, 0.5, 0.75, 0.75]);
        assert!(markdown(&rows).lines().count() == 3);
    }
}
