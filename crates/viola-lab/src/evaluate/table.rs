//! Table of a run: Markdown for people, JSON for programs, CSV (one row per clip) for plots.

mod markdown;

pub use markdown::markdown;

use super::{Calibration, ClipResult};
use serde::Serialize;
use std::borrow::Cow;
use std::fmt::Write;
use viola_align::AlignmentState;

/// Results of one method on one kind of clip. Errors are over all clips with a pose, even ambiguous ones; a
/// clip without a pose counts as a failure in `success_rate` and in the recalls. A figure without a clip is NaN, which is
/// null in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableRow {
    pub method: String,
    pub set: String,
    pub frames: usize,
    pub clips: usize,
    /// Number of clips with errors: those with a pose on the true level.
    pub clips_with_pose: usize,
    pub r_mean_deg: f64,
    pub r_median_deg: f64,
    pub t_mean_m: f64,
    pub t_median_m: f64,
    /// Fraction of the clips under 10 degrees and 0.3 m. NaN, like the recalls, if the map is of another home.
    pub success_rate: f64,
    /// Fractions of the clips with a translation error under each distance.
    pub recall_at_m: Vec<Recall>,
    /// Fraction of the `aligned` clips that are no success; null if there are none.
    pub wrong_when_aligned: Option<f64>,
    pub aligned_rate: f64,
    /// Number of `aligned` clips if the map is of another home.
    pub aligned_in_another_home: Option<usize>,
    /// Fraction of the `aligned` clips that have the true level; null for homes with one level.
    pub right_level_when_aligned: Option<f64>,
    /// Calibration error of the probabilities; null without probabilities.
    pub expected_calibration_error: Option<f64>,
    /// Mean normalised squared error of the right poses over its expectation of 3; null without covariances.
    pub nees: Option<f64>,
    /// Number of clips that fit the map equally well in several places; null if that is unknown.
    pub unknowable_clips: Option<usize>,
    /// Fraction of those with state `ambiguous` and the truth among the alternatives; null if there are none.
    pub unknowable_admitted: Option<f64>,
    /// Null if no clip has a scale error.
    pub scale: Option<ScaleErrors>,
    /// Median time of search, refinement and decision, on one thread, over the clips that were registered.
    pub seconds_median: f64,
    /// Median time from the clip's pictures to its pose, on one thread. For simulated clips it includes
    /// rendering the pictures.
    pub seconds_total_median: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recall {
    pub within_m: f64,
    #[serde(rename = "share")]
    pub fraction: f64,
}

/// Errors of the scales of clips whose unit was withheld, as fractions of the true ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScaleErrors {
    /// Number of clips with a scale.
    pub answers: usize,
    pub median: f64,
    pub worst: f64,
    /// Number of clips with an error of at most 2 %.
    pub within: usize,
}

impl ScaleErrors {
    fn of(results: &[&ClipResult]) -> Option<ScaleErrors> {
        const GOOD: f64 = 0.02;
        let errors: Vec<f64> = results.iter().filter_map(|r| Some(r.scale_error?.abs())).collect();
        Some(ScaleErrors {
            answers: errors.len(),
            median: median(&errors),
            worst: errors.iter().copied().max_by(f64::total_cmp)?,
            within: errors.iter().filter(|error| **error <= GOOD).count(),
        })
    }
}

/// Suffixes of the set in rows of only the clips that show the floor: by the truth, or if that is unknown by the
/// method itself.
const FLOOR_IN_SIGHT: &str = " (floor in sight)";
const FLOOR_FOUND: &str = " (floor found)";

/// Returns one row per method, set and clip length, in the order of their first results. If some of the clips do
/// not show the floor, a second row is of the others alone.
pub fn tabulate(results: &[ClipResult]) -> Vec<TableRow> {
    let mut keys: Vec<(&str, usize, &str)> = Vec::new();
    for result in results {
        let key = (result.set.as_str(), result.frames, result.method.as_str());
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    keys.into_iter()
        .flat_map(|(set, frames, method)| {
            let of: Vec<&ClipResult> = results
                .iter()
                .filter(|r| (r.set.as_str(), r.frames, r.method.as_str()) == (set, frames, method))
                .collect();
            let is_known = of.iter().any(|r| r.floor_in_sight.is_some());
            let suffix = if is_known { FLOOR_IN_SIGHT } else { FLOOR_FOUND };
            let shows =
                |r: &&ClipResult| if is_known { r.floor_in_sight == Some(true) } else { r.floor_seen };
            let seen: Vec<&ClipResult> = of.iter().copied().filter(shows).collect();
            let is_part = !seen.is_empty() && seen.len() < of.len();
            let with_floor = is_part.then(|| row(method, &format!("{set}{suffix}"), frames, &seen));
            std::iter::once(row(method, set, frames, &of)).chain(with_floor)
        })
        .collect()
}

fn row(method: &str, set: &str, frames: usize, results: &[&ClipResult]) -> TableRow {
    let rotations: Vec<f64> = results.iter().filter_map(|r| r.rotation_error_deg).collect();
    let translations: Vec<f64> = results.iter().filter_map(|r| r.translation_error_m).collect();
    let register: Vec<f64> = results.iter().map(|r| r.register_seconds).filter(|s| *s > 0.0).collect();
    let total: Vec<f64> = results.iter().map(|r| r.seconds).collect();
    let fraction = |count: usize| count as f64 / results.len().max(1) as f64;
    let count = |is: &dyn Fn(&ClipResult) -> bool| results.iter().filter(|r| is(r)).count();
    let part = |part: usize, whole: usize| (whole > 0).then(|| part as f64 / whole as f64);
    let aligned = count(&|r| r.state == AlignmentState::Aligned);
    let wrong = count(&|r| r.state == AlignmentState::Aligned && !r.is_success());
    let aligned_on =
        |right: bool| count(&|r| r.state == AlignmentState::Aligned && r.right_level == Some(right));
    let unknowable = count(&|r| r.unknowable == Some(true));
    let is_foreign = results.iter().any(|r| r.foreign);
    let right_fraction = |count: usize| if is_foreign { f64::NAN } else { fraction(count) };
    let right = results.iter().filter(|r| r.is_success());
    let nees: Vec<f64> = right.filter_map(|r| r.placement.as_ref()).map(|p| p.nees() / 3.0).collect();
    let admitted = count(&|r| {
        r.unknowable == Some(true) && r.state == AlignmentState::Ambiguous && r.truth_rank.is_some()
    });
    TableRow {
        method: method.to_owned(),
        set: set.to_owned(),
        frames,
        clips: results.len(),
        clips_with_pose: rotations.len(),
        r_mean_deg: mean(&rotations),
        r_median_deg: median(&rotations),
        t_mean_m: mean(&translations),
        t_median_m: median(&translations),
        success_rate: right_fraction(count(&ClipResult::is_success)),
        recall_at_m: [0.1, 0.3, 0.5, 1.0]
            .map(|within_m| {
                let found = count(&|r| r.translation_error_m.is_some_and(|e| e < within_m));
                Recall { within_m, fraction: right_fraction(found) }
            })
            .to_vec(),
        wrong_when_aligned: part(wrong, aligned),
        aligned_rate: fraction(aligned),
        aligned_in_another_home: is_foreign.then_some(aligned),
        right_level_when_aligned: part(aligned_on(true), aligned_on(true) + aligned_on(false)),
        expected_calibration_error: Calibration::of(results.iter().copied())
            .map(|calibration| calibration.expected_calibration_error),
        nees: (!nees.is_empty()).then(|| mean(&nees)),
        unknowable_clips: results.iter().any(|r| r.unknowable.is_some()).then_some(unknowable),
        unknowable_admitted: part(admitted, unknowable),
        scale: ScaleErrors::of(results),
        seconds_median: median(&register),
        seconds_total_median: median(&total),
    }
}

fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { f64::NAN } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// Returns the median; the lower of two middle values.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied().unwrap_or(f64::NAN)
}

/// Returns one row per clip and method. Unknown values, such as errors without a pose, are empty.
pub fn clips_csv(results: &[ClipResult]) -> String {
    let mut out = String::from(
        "method,set,frames,clip,first_frame,last_frame,state,reasons,probability,r_error_deg,t_error_m,right_level,success,coverage,inliers,unknowable,truth_rank,register_seconds,seconds,floor_in_sight,scale_error\n",
    );
    let decimals = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.4}"));
    let known = |value: Option<bool>| value.map_or(String::new(), |value| value.to_string());
    for r in results {
        let state = match r.state {
            AlignmentState::Aligned => "aligned",
            AlignmentState::Ambiguous => "ambiguous",
            AlignmentState::Failed => "failed",
        };
        let _ = writeln!(
            out,
            "{},{},{},{},{},{},{state},{},{},{},{},{},{},{},{},{},{},{:.4},{:.4},{},{}",
            r.method,
            field(&r.set),
            r.frames,
            r.clip,
            r.first_frame,
            r.last_frame,
            r.reasons.join(" "),
            decimals(r.probability),
            decimals(r.rotation_error_deg),
            decimals(r.translation_error_m),
            known(r.right_level),
            known((!r.foreign).then(|| r.is_success())),
            decimals(r.coverage),
            decimals(r.inliers),
            known(r.unknowable),
            r.truth_rank.map_or(String::new(), |rank| rank.to_string()),
            r.register_seconds,
            r.seconds,
            known(r.floor_in_sight),
            decimals(r.scale_error),
        );
    }
    out
}

/// Returns text as a CSV field (RFC 4180): a set may have the name of a folder.
fn field(text: &str) -> Cow<'_, str> {
    let is_plain = !text.contains([',', '"', '\n', '\r']);
    if is_plain { Cow::Borrowed(text) } else { Cow::Owned(format!("\"{}\"", text.replace('"', "\"\""))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_set_is_one_field() {
        let example = ClipResult::example(AlignmentState::Failed, None);
        for (set, wanted) in [
            ("scene_0", "viola,scene_0,60,"),
            ("flat, north", "viola,\"flat, north\",60,"),
            ("the \"attic\"", "viola,\"the \"\"attic\"\"\",60,"),
        ] {
            let csv = clips_csv(&[ClipResult { set: set.to_owned(), ..example.clone() }]);
            let row = csv.lines().nth(1).unwrap();
            assert!(row.starts_with(wanted), "{row}");
        }
    }

    #[test]
    fn a_clip_without_a_pose_is_a_failure_and_no_error() {
        let rows = tabulate(&[
            ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.05))),
            ClipResult::example(AlignmentState::Aligned, Some((3.0, 0.35))),
            ClipResult::example(AlignmentState::Ambiguous, Some((2.0, 0.2))),
            ClipResult::example(AlignmentState::Failed, None),
        ]);
        assert_eq!(rows.len(), 1);
        let row = &rows[0];
        assert_eq!((row.clips, row.success_rate, row.aligned_rate), (4, 0.5, 0.5));
        assert_eq!(row.wrong_when_aligned, Some(0.5));
        assert!((row.r_mean_deg - 2.0).abs() < 1e-12 && (row.r_median_deg - 2.0).abs() < 1e-12);
        let recalls: Vec<(f64, f64)> = row.recall_at_m.iter().map(|r| (r.within_m, r.fraction)).collect();
        assert_eq!(recalls, [(0.1, 0.25), (0.3, 0.5), (0.5, 0.75), (1.0, 0.75)]);
        assert_eq!((row.unknowable_clips, row.unknowable_admitted), (Some(0), None));
    }

    #[test]
    fn clips_that_show_the_floor_have_a_row_of_their_own() {
        let clip = |floor_seen, floor_in_sight| ClipResult {
            floor_seen,
            floor_in_sight,
            ..ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.05)))
        };
        for (clips, rows) in [
            // The method missed a floor that is there, and invented one.
            (
                vec![clip(true, Some(true)), clip(false, Some(true)), clip(true, Some(false))],
                vec![("normal", 3), ("normal (floor in sight)", 2)],
            ),
            (vec![clip(true, None), clip(false, None)], vec![("normal", 2), ("normal (floor found)", 1)]),
            (vec![clip(true, None)], vec![("normal", 1)]),
            (vec![clip(false, Some(true))], vec![("normal", 1)]),
        ] {
            let table = tabulate(&clips);
            let found: Vec<(&str, usize)> = table.iter().map(|row| (row.set.as_str(), row.clips)).collect();
            assert_eq!(found, rows);
        }
    }
}
