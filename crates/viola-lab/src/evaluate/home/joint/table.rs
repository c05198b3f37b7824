//! Table of homes whose clips are placed together.

use super::{JointClip, JointHome};
use crate::evaluate::Calibration;
use serde::Serialize;
use std::fmt::Write;
use viola_align::AlignmentState;
use viola_home::PlacedBy;

/// Results of one set of homes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointRow {
    pub set: String,
    pub homes: usize,
    pub clips: usize,
    pub aligned: usize,
    pub aligned_wrong: usize,
    pub ambiguous: usize,
    /// Ambiguous clips with the true pose among their alternatives.
    pub listed: usize,
    /// Of those, clips that the others at their true poses decide.
    pub decidable: usize,
    pub decidable_placed: usize,
    /// Ambiguous clips that the others placed.
    pub placed: usize,
    pub placed_wrong: usize,
    /// Of the probabilities of all clips with a pose.
    pub calibration: Option<Calibration>,
}

impl JointRow {
    /// Returns the row of `homes`, named `set`.
    pub fn of(set: &str, homes: &[&JointHome]) -> JointRow {
        let clips: Vec<&JointClip> = homes.iter().flat_map(|home| &home.clips).collect();
        let count = |is: &dyn Fn(&JointClip) -> bool| clips.iter().filter(|clip| is(clip)).count();
        let aligned = |clip: &JointClip| clip.alone == AlignmentState::Aligned;
        let placed = |clip: &JointClip| clip.placed_by == Some(PlacedBy::Neighbours);
        let wrong = |clip: &JointClip| clip.is_right == Some(false);
        let answers = clips.iter().filter_map(|clip| clip.probability.zip(clip.is_right));
        JointRow {
            set: set.to_owned(),
            homes: homes.len(),
            clips: clips.len(),
            aligned: count(&aligned),
            aligned_wrong: count(&|clip| aligned(clip) && wrong(clip)),
            ambiguous: count(&|clip| clip.alone == AlignmentState::Ambiguous),
            listed: count(&|clip| {
                clip.alone == AlignmentState::Ambiguous && clip.modes.iter().any(|mode| mode.is_right)
            }),
            decidable: count(&|clip| clip.decidable),
            decidable_placed: count(&|clip| clip.decidable && placed(clip)),
            placed: count(&placed),
            placed_wrong: count(&|clip| placed(clip) && wrong(clip)),
            calibration: Calibration::of_answers(answers),
        }
    }

    /// Returns the rows as a Markdown table.
    pub fn markdown(rows: &[JointRow]) -> String {
        let mut out = String::from(
            "| set | homes | clips | aligned alone | of these wrong | ambiguous alone | true pose listed | decided by the others | \
             of these placed | placed by others | of these wrong | calibration error |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for row in rows {
            let fraction = row.decidable_placed as f64 / row.decidable.max(1) as f64;
            // Writing into a string cannot fail.
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} ({:.0} %) | {} | {} | {} |",
                row.set,
                row.homes,
                row.clips,
                row.aligned,
                row.aligned_wrong,
                row.ambiguous,
                row.listed,
                row.decidable,
                row.decidable_placed,
                100.0 * fraction,
                row.placed,
                row.placed_wrong,
                row.calibration
                    .as_ref()
                    .map_or("-".to_owned(), |c| format!("{:.3}", c.expected_calibration_error)),
            );
        }
        out
    }
}
