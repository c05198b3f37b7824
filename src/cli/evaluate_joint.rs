//! `viola evaluate --joint`: the clips of simulated homes, placed together.

use super::evaluate::{EvaluateArguments, homes, save};
use anyhow::{Context, Result};
use std::fs;
use viola_align::AlignParams;
use viola_geometry::progress::Silent;
use viola_lab::evaluate::home::{JointHome, JointRow, joint};

/// Writes `joint.json` and `joint.md`, and the aligned clips in `clips`.
pub fn run(arguments: &EvaluateArguments) -> Result<()> {
    let folder = arguments.out.join("clips");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let label = arguments.networks.surface_labels()?;
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let homes = homes(arguments);
    let mut done: Vec<JointHome> = Vec::new();
    for &set in &homes.sets {
        for seed in homes.seeds.clone() {
            done.push(joint(set, seed, &homes, &params, &folder, &Silent)?);
            eprintln!("{} {seed}", set.name());
        }
    }
    let of_set =
        |set: &str| JointRow::of(set, &done.iter().filter(|home| home.set == set).collect::<Vec<_>>());
    let mut rows: Vec<JointRow> = homes.sets.iter().map(|set| of_set(set.name())).collect();
    if rows.len() > 1 {
        rows.push(JointRow::of("all", &done.iter().collect::<Vec<_>>()));
    }
    let table = JointRow::markdown(&rows);
    save(
        &arguments.out,
        "joint.json",
        &serde_json::to_string(&serde_json::json!({ "rows": rows, "homes": done }))?,
    )?;
    save(&arguments.out, "joint.md", &table)?;
    print!("{table}");
    Ok(())
}
