//! Tables, calibration and plots of handmade results.

use viola_align::AlignmentState::{self, Aligned, Ambiguous, Failed};
use viola_lab::evaluate::{Calibration, ClipResult, clips_csv, markdown, plot, tabulate};

fn result(state: AlignmentState, errors: Option<(f64, f64)>) -> ClipResult {
    ClipResult {
        method: "viola".into(),
        set: "home".into(),
        frames: 60,
        clip: "0".into(),
        first_frame: 0,
        last_frame: 59,
        state,
        reasons: vec!["several_modes".into(), "weak_evidence".into()],
        probability: None,
        foreign: false,
        rotation_error_deg: errors.map(|e| e.0),
        translation_error_m: errors.map(|e| e.1),
        right_level: None,
        coverage: Some(0.5),
        inliers: None,
        floor_seen: true,
        floor_in_sight: None,
        unknowable: Some(false),
        scale_error: None,
        truth_rank: None,
        alternatives: Vec::new(),
        hits: 150,
        placement: None,
        register_seconds: 0.1,
        seconds: 1.0,
    }
}

#[test]
fn a_clip_without_a_pose_is_a_failure_and_no_error() {
    let rows = tabulate(&[
        result(Aligned, Some((1.0, 0.05))),
        result(Aligned, Some((3.0, 0.35))),
        result(Ambiguous, Some((2.0, 0.2))),
        result(Failed, None),
    ]);
    assert_eq!(rows.len(), 1);
    let row = &rows[0];
    assert_eq!((row.clips, row.success_rate, row.aligned_rate), (4, 0.5, 0.5));
    assert_eq!(row.wrong_when_aligned, Some(0.5));
    assert!((row.r_mean_deg - 2.0).abs() < 1e-12 && (row.r_median_deg - 2.0).abs() < 1e-12);
    assert!((row.t_mean_m - 0.2).abs() < 1e-12 && (row.t_median_m - 0.2).abs() < 1e-12);
    assert_eq!(row.recall_at_m.iter().map(|r| r.fraction).collect::<Vec<_>>(), [0.25, 0.5, 0.75, 0.75]);
    assert_eq!(row.expected_calibration_error, None);
}

#[test]
fn success_needs_both_bounds() {
    for (errors, is_success) in
        [((9.9, 0.29), true), ((10.0, 0.0), false), ((0.0, 0.3), false), ((180.0, 9.0), false)]
    {
        assert_eq!(result(Aligned, Some(errors)).is_success(), is_success, "{errors:?}");
    }
}

#[test]
fn rows_are_apart_by_method_set_and_length() {
    let mut results = vec![result(Aligned, Some((1.0, 0.1))); 5];
    results[1].method = "paper".into();
    results[2].frames = 40;
    results[3].set = "other".into();
    let rows = tabulate(&results);
    let keys: Vec<_> = rows.iter().map(|r| (r.set.as_str(), r.frames, r.method.as_str(), r.clips)).collect();
    let expected = [
        ("home", 60, "viola", 2),
        ("home", 60, "paper", 1),
        ("home", 40, "viola", 1),
        ("other", 60, "viola", 1),
    ];
    assert_eq!(keys, expected);
    assert_eq!(markdown(&rows).lines().filter(|line| line.starts_with("| home")).count(), 6, "two tables");
    let csv = clips_csv(&results);
    let columns: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert!(columns.iter().all(|count| *count == columns[0]) && columns.len() == 6, "{csv}");
}

#[test]
fn unknowable_clips_are_admitted_by_doubt_that_lists_the_truth() {
    let unknowable = |state, truth_rank| ClipResult {
        unknowable: Some(true),
        truth_rank,
        ..result(state, Some((90.0, 3.0)))
    };
    let row = &tabulate(&[
        unknowable(Ambiguous, Some(1)),
        unknowable(Ambiguous, None),
        unknowable(Aligned, Some(0)),
        unknowable(Ambiguous, Some(0)),
        result(Ambiguous, Some((1.0, 0.1))),
    ])[0];
    assert_eq!((row.unknowable_clips, row.unknowable_admitted), (Some(4), Some(0.5)));
}

#[test]
fn the_right_level_is_counted_among_aligned_clips() {
    let on = |state, right_level| ClipResult { right_level, ..result(state, Some((1.0, 0.1))) };
    let mut results = vec![on(Aligned, Some(true)); 3];
    // Without a pose on the true level there are no errors.
    results.push(ClipResult {
        rotation_error_deg: None,
        translation_error_m: None,
        ..on(Aligned, Some(false))
    });
    results.push(on(Ambiguous, Some(false)));
    let row = &tabulate(&results)[0];
    assert_eq!((row.right_level_when_aligned, row.wrong_when_aligned), (Some(0.75), Some(0.25)));
    assert_eq!(tabulate(&[on(Aligned, None)])[0].right_level_when_aligned, None);
}

#[test]
fn calibration_error_is_the_mean_gap_over_answers() {
    let said = |probability, is_right: bool| ClipResult {
        probability: Some(probability),
        ..result(Aligned, Some(if is_right { (1.0, 0.1) } else { (90.0, 3.0) }))
    };
    // A bin of four at 0.95, three right, a bin of one at 0.25, wrong, and a result without probability.
    let results = [
        said(0.95, true),
        said(0.95, true),
        said(0.95, true),
        said(0.95, false),
        said(0.25, false),
        result(Aligned, None),
    ];
    let calibration = Calibration::of(&results).unwrap();
    let expected = (4.0 * (0.95 - 0.75) + 1.0 * (0.25 - 0.0)) / 5.0;
    assert!((calibration.expected_calibration_error - expected).abs() < 1e-12, "{calibration:?}");
    assert_eq!(calibration.bins.map(|bin| bin.count), [0, 0, 1, 0, 0, 0, 0, 0, 0, 4]);
    assert_eq!(Calibration::of(&[said(1.0, true)]).unwrap().bins[9].count, 1, "certainty is in the last bin");
    assert!(Calibration::of(&[result(Aligned, None)]).is_none());
    let svg = plot::reliability(&results).unwrap();
    assert!(svg.contains("viola 0.210") && svg.contains(">4</text>"), "{svg}");
    assert!(plot::reliability(&[result(Aligned, None)]).is_none());
}

#[test]
fn every_clip_is_a_dot_in_both_plots() {
    let results =
        [result(Aligned, Some((1.0, 0.05))), result(Aligned, None), result(Ambiguous, Some((0.0, 0.0)))];
    let svg = plot::error_against_coverage(&results);
    assert_eq!(svg.matches("r=\"3\"").count(), 6, "{svg}");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
}
