//! `viola evaluate --joint`: the clips of simulated homes, placed together.

use super::each_home::each_home;
use super::{EvaluateArguments, save, save_table};
use anyhow::Result;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::home::{JointHome, JointRow, joint};

/// Writes `joint.json` and `joint.md`, and the aligned clips in `clips`.
pub fn run(arguments: &EvaluateArguments) -> Result<()> {
    let done: Vec<JointHome> = each_home(arguments, |set, seed, homes, params, folder| {
        Ok(joint(set, seed, homes, params, folder, &Silent)?)
    })?;
    let of_set =
        |set: &str| JointRow::of(set, &done.iter().filter(|home| home.set == set).collect::<Vec<_>>());
    let mut rows: Vec<JointRow> = arguments.set.iter().map(|set| of_set(set.name())).collect();
    if rows.len() > 1 {
        rows.push(JointRow::of("all", &done.iter().collect::<Vec<_>>()));
    }
    let table = JointRow::markdown(&rows);
    let json = serde_json::json!({ "rows": rows, "homes": done });
    save(&arguments.out, "joint.json", &json.to_string())?;
    save_table(&arguments.out, "joint.md", &table)
}
