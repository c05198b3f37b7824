//! `viola evaluate --changes`: the changes that the maps of simulated homes tell.

use super::each_home::each_home;
use super::{EvaluateArguments, save_json, save_table};
use anyhow::Result;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::home::{ChangesHome, ChangesRow, changes};

/// Writes `changes.json` and `changes.md`, and the aligned clips in `clips`.
pub fn run(arguments: &EvaluateArguments) -> Result<()> {
    let done: Vec<ChangesHome> = each_home(arguments, |set, seed, homes, params, folder| {
        Ok(changes(set, seed, homes, params, folder, &Silent)?)
    })?;
    let rows: Vec<ChangesRow> = arguments.set.iter().map(|set| ChangesRow::of(set.name(), &done)).collect();
    let table = ChangesRow::markdown(&rows);
    let json = serde_json::json!({ "rows": rows, "homes": done });
    save_json(&arguments.out, "changes.json", &json)?;
    save_table(&arguments.out, "changes.md", &table)
}
