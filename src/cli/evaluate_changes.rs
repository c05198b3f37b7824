//! `viola evaluate --changes`: the changes that the maps of simulated homes tell.

use super::evaluate::{EvaluateArguments, homes, save};
use anyhow::{Context, Result};
use std::fs;
use viola_align::AlignParams;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::home::{ChangesHome, ChangesRow, changes};

/// Writes `changes.json` and `changes.md`, and the aligned clips in `clips`.
pub fn run(arguments: &EvaluateArguments) -> Result<()> {
    let folder = arguments.out.join("clips");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let label = arguments.networks.surface_labels()?;
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let homes = homes(arguments);
    let mut done: Vec<ChangesHome> = Vec::new();
    for &set in &homes.sets {
        for seed in homes.seeds.clone() {
            done.push(changes(set, seed, &homes, &params, &folder, &Silent)?);
            eprintln!("{} {seed}", set.name());
        }
    }
    let rows: Vec<ChangesRow> = homes.sets.iter().map(|set| ChangesRow::of(set.name(), &done)).collect();
    let table = ChangesRow::markdown(&rows);
    let json = serde_json::json!({ "rows": rows, "homes": done });
    save(&arguments.out, "changes.json", &serde_json::to_string_pretty(&json)?)?;
    save(&arguments.out, "changes.md", &table)?;
    print!("{table}");
    Ok(())
}
