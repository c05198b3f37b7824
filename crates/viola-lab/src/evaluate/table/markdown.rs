//! Tables of a run as Markdown.

use super::TableRow;
use std::fmt::Write;

/// Note below the tables.
const CONDITIONS: &str = "\nR and T are of the clips with a pose on the true level, even ambiguous ones. NEES/3 is of the right poses; 1 is expected.\n";

/// Returns two tables, accuracy and confidence of the methods, and one of the scales if a clip has one.
pub fn markdown(rows: &[TableRow]) -> String {
    let mut out = accuracy_markdown(rows) + "\n" + &confidence_markdown(rows);
    if rows.iter().any(|row| row.scale.is_some()) {
        out += "\n";
        out += &scale_markdown(rows);
    }
    out += CONDITIONS;
    for row in rows {
        if let Some(aligned) = row.aligned_in_another_home {
            // Writing into a string cannot fail.
            let _ = writeln!(
                out,
                "\n{}, {} frames, {}: called aligned in another home: {aligned} of {}.",
                row.set, row.frames, row.method, row.clips
            );
        }
    }
    out
}

fn number(value: f64, decimals: usize, unit: &str) -> String {
    if value.is_nan() { "-".to_owned() } else { format!("{value:.decimals$}{unit}") }
}

fn percent(fraction: f64) -> String {
    number(100.0 * fraction, 1, " %")
}

fn optional(value: Option<impl ToString>) -> String {
    value.map_or("-".to_owned(), |value| value.to_string())
}

/// Returns the first cells of a row.
fn key(row: &TableRow) -> String {
    format!("| {} | {} | {} | {} |", row.set, row.frames, row.clips, row.method)
}

fn accuracy_markdown(rows: &[TableRow]) -> String {
    let mut out = String::from(
        "| set | frames | clips | method | success | with a pose | R mean | R median | T mean | T median | <0.1 m | <0.3 m | <0.5 m | <1 m | register | total |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for r in rows {
        let _ = write!(
            out,
            "{} {} | {} | {} | {} | {} | {} |",
            key(r),
            percent(r.success_rate),
            r.clips_with_pose,
            number(r.r_mean_deg, 2, " deg"),
            number(r.r_median_deg, 2, " deg"),
            number(r.t_mean_m, 3, " m"),
            number(r.t_median_m, 3, " m"),
        );
        for recall in &r.recall_at_m {
            let _ = write!(out, " {} |", percent(recall.fraction));
        }
        let [register, total] =
            [(r.seconds_median, 3), (r.seconds_total_median, 2)].map(|(s, d)| number(s, d, " s"));
        let _ = writeln!(out, " {register} | {total} |");
    }
    out
}

fn confidence_markdown(rows: &[TableRow]) -> String {
    let mut out = String::from(
        "| set | frames | clips | method | aligned | wrong when aligned | right level | calibration error | NEES/3, right poses | unknowable | of those admitted |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for r in rows {
        let _ = writeln!(
            out,
            "{} {} | {} | {} | {} | {} | {} | {} |",
            key(r),
            percent(r.aligned_rate),
            optional(r.wrong_when_aligned.map(percent)),
            optional(r.right_level_when_aligned.map(percent)),
            optional(r.expected_calibration_error.map(|error| number(error, 3, ""))),
            optional(r.nees.map(|nees| number(nees, 2, ""))),
            optional(r.unknowable_clips),
            optional(r.unknowable_admitted.map(percent)),
        );
    }
    out
}

fn scale_markdown(rows: &[TableRow]) -> String {
    let mut out = String::from(
        "| set | frames | clips | method | scales | scale, median error | worst | within 2 % |\n|---|---|---|---|---|---|---|---|\n",
    );
    for r in rows {
        let scale = r.scale.as_ref();
        let _ = writeln!(
            out,
            "{} {} | {} | {} | {} |",
            key(r),
            scale.map_or(0, |scale| scale.answers),
            optional(scale.map(|scale| percent(scale.median))),
            optional(scale.map(|scale| percent(scale.worst))),
            scale.map_or(0, |scale| scale.within),
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::{ScaleErrors, clips_csv, tabulate};
    use super::*;
    use crate::evaluate::ClipResult;
    use viola_align::AlignmentState;

    /// Returns the cell of the row of `set` in the first table that has `column`.
    fn cell(text: &str, set: &str, column: &str) -> String {
        let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
        let mut lines = text.lines().skip_while(|line| !cells(line).iter().any(|cell| cell == column));
        let place = cells(lines.next().unwrap()).iter().position(|cell| cell == column).unwrap();
        let row = lines.map(cells).find(|row| row.get(1).is_some_and(|name| name == set)).unwrap();
        row[place].clone()
    }

    #[test]
    fn in_the_map_of_another_home_nothing_is_right_and_nothing_has_an_error() {
        let clip = |state| ClipResult {
            set: "normal-foreign".into(),
            foreign: true,
            coverage: None,
            unknowable: None,
            ..ClipResult::example(state, None)
        };
        let clips = [AlignmentState::Aligned, AlignmentState::Ambiguous, AlignmentState::Failed].map(clip);
        let rows = tabulate(&clips);
        let text = markdown(&rows);
        for column in ["success", "R median", "T mean", "<0.3 m", "NEES/3, right poses", "unknowable"] {
            assert_eq!(cell(&text, "normal-foreign", column), "-", "{column}");
        }
        assert!(text.contains("viola: called aligned in another home: 1 of 3.\n"), "{text}");
        let json = serde_json::to_value(&rows[0]).unwrap();
        assert!(json["success_rate"].is_null() && json["recall_at_m"][0]["share"].is_null(), "{json}");
        let csv = clips_csv(&clips);
        let [header, row] = [0, 1].map(|line| csv.lines().nth(line).unwrap().split(',').collect::<Vec<_>>());
        let at = |name: &str| row[header.iter().position(|column| *column == name).unwrap()];
        assert_eq!(["success", "coverage", "unknowable", "t_error_m"].map(at), [""; 4]);
    }

    #[test]
    fn tables_say_of_how_many_clips_the_errors_are() {
        let text = markdown(&tabulate(&[
            ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.05))),
            ClipResult::example(AlignmentState::Ambiguous, Some((2.0, 2.0))),
            ClipResult::example(AlignmentState::Failed, None),
        ]));
        assert_eq!(["clips", "with a pose"].map(|column| cell(&text, "normal", column)), ["3", "2"]);
        assert!(text.contains("R and T are of the clips with a pose"), "{text}");
        // Nobody withheld the unit.
        assert!(!text.contains("scale"), "{text}");
    }

    #[test]
    fn scales_have_a_table_if_the_unit_was_withheld() {
        let clip = |scale_error| ClipResult {
            scale_error,
            ..ClipResult::example(AlignmentState::Aligned, Some((1.0, 0.05)))
        };
        let rows = tabulate(&[clip(Some(0.01)), clip(Some(-0.02)), clip(Some(0.5)), clip(None)]);
        let wanted = ScaleErrors { answers: 3, median: 0.02, worst: 0.5, within: 2 };
        assert_eq!(rows[0].scale, Some(wanted));
        let text = markdown(&rows);
        let columns = ["scales", "scale, median error", "worst", "within 2 %"];
        assert_eq!(columns.map(|column| cell(&text, "normal", column)), ["3", "2.0 %", "50.0 %", "2"]);
    }
}
