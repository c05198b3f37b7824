//! `viola evaluate --scene ... --home`: a home's map, rooms and objects against a labelled mesh.

use super::evaluate::{EvaluateArguments, save, scene_of};
use super::progress::TerminalProgress;
use crate::align::AlignParams;
use crate::evaluate::home::{consecutive, evaluate};
use crate::home;
use anyhow::{Context, Result};
use std::fs;
use std::path::Path;

/// Writes `home.json`, `home.md` and the plan as PNG, SVG and GeoJSON.
pub fn run(arguments: &EvaluateArguments, path: &Path) -> Result<()> {
    let out = &arguments.out;
    fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let scene = scene_of(arguments, path)?;
    let label = arguments.networks.labels()?;
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let length = arguments.frames.first().copied().unwrap_or(60);
    let ranges = consecutive(scene.clip.frames().len(), length);
    let progress = TerminalProgress::new();
    let (report, plan) = evaluate(&scene, path, &ranges, &params, &progress)?;
    progress.finish();
    save(out, "home.json", &serde_json::to_string_pretty(&report)?)?;
    save(out, "home.md", &report.markdown())?;
    save(out, "plan.svg", &home::plan_svg(&plan))?;
    save(out, "plan.geojson", &home::plan_geojson(&plan).to_string())?;
    let picture = out.join("plan.png");
    fs::write(&picture, home::plan_png(&plan))
        .with_context(|| format!("cannot write {}", picture.display()))?;
    print!("{}", report.markdown());
    Ok(())
}
