//! Table of told changes.

use super::ChangesHome;
use super::kept::Kept;
use super::score::{Score, Scores};
use serde::Serialize;
use std::fmt::Write;

/// Results of one set of homes.
#[derive(Debug, Clone, Serialize)]
pub struct ChangesRow {
    pub set: &'static str,
    pub homes: usize,
    pub clips: usize,
    pub placed: usize,
    pub comparisons: usize,
    pub scores: Scores,
    pub kept: Kept,
}

impl ChangesRow {
    /// Returns the row of the homes of a set.
    pub fn of(set: &'static str, homes: &[ChangesHome]) -> ChangesRow {
        let of_set: Vec<&ChangesHome> = homes.iter().filter(|home| home.set == set).collect();
        let sum = |of: fn(&ChangesHome) -> usize| of_set.iter().map(|home| of(home)).sum();
        let mut scores = Scores::default();
        let mut kept = Kept::default();
        of_set.iter().for_each(|home| {
            scores.add(&home.scores);
            kept.add(home.kept);
        });
        ChangesRow {
            set,
            homes: of_set.len(),
            clips: sum(|home| home.clips),
            placed: sum(|home| home.placed),
            comparisons: sum(|home| home.comparisons),
            scores,
            kept,
        }
    }

    /// Returns the rows as Markdown tables.
    pub fn markdown(rows: &[ChangesRow]) -> String {
        let mut out = String::new();
        for row in rows {
            let ChangesRow { set, homes, clips, placed, comparisons, scores, kept } = row;
            // Writing into a string cannot fail.
            let _ = writeln!(
                out,
                "{set}: {homes} homes, {placed} of {clips} clips in the maps, {comparisons} pairs of revisions; \
                 {} objects discovered and {} lost; {} of {} objects that stay have one id.\n\n\
                 | change | true | told | right | of these with the class | recall | precision |\n\
                 |---|---|---|---|---|---|---|",
                scores.discovered, scores.lost, kept.one_id, kept.objects
            );
            for (kind, score) in [("added", scores.added), ("moved", scores.moved), ("gone", scores.gone)] {
                let Score { truth, told, right, right_class } = score;
                let _ = writeln!(
                    out,
                    "| {kind} | {truth} | {told} | {right} | {right_class} | {} | {} |",
                    fraction(right, truth),
                    fraction(right, told)
                );
            }
            out.push('\n');
        }
        out
    }
}

fn fraction(part: usize, of: usize) -> String {
    if of == 0 { "-".to_owned() } else { format!("{:.0} %", 100.0 * part as f64 / of as f64) }
}
