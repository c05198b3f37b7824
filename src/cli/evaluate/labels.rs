//! `viola evaluate --labels`: classes of points.

use super::{EvaluateArguments, homes, save_json, save_table};
use crate::cli::output;
use crate::cli::progress::{Steps, TerminalProgress};
use anyhow::{Context, Result};
use serde_json::json;
use std::path::Path;
use viola_align::AlignParams;
use viola_formats::clip::Clip;
use viola_geometry::progress::Progress;
use viola_lab::evaluate::labels;
use viola_reconstruct::LabelParams;

/// Writes `labels.json` and `labels.md` of a scene.
pub(super) fn scene(arguments: &EvaluateArguments, scene: &Path) -> Result<()> {
    output::folder(&arguments.out)?;
    let clip = Clip::open(scene).with_context(|| format!("clip {}", scene.display()))?;
    let truth = labels::Truth::open(scene)?;
    let label = arguments.networks.labels()?;
    let segmenter = label.segmenter.clone();
    let by = segmenter.as_ref().map_or("geometry".to_owned(), |segmenter| segmenter.name());
    let surface = label.surface.as_ref().map(|network| network.name().to_owned());
    let label = LabelParams { segmenter: None, ..label };
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let progress = |part: String| -> Box<dyn Progress> { Box::new(TerminalProgress::of_step(part)) };
    let rows = labels::evaluate(&clip, &truth, segmenter.clone(), &params, &progress)?;
    let mut floors = Vec::new();
    for frames in arguments.lengths() {
        for (variant, segmenter) in [("shape alone", None), ("pictures", segmenter.clone())] {
            if variant == "pictures" && segmenter.is_none() {
                continue;
            }
            let label = LabelParams { segmenter, ..LabelParams::default() };
            let params = AlignParams { label, ..params.clone() };
            floors.push(labels::floors(variant, &clip, &truth, frames, &params, &progress)?);
        }
    }
    let table = labels::markdown(&rows) + "\n" + &labels::floors_markdown(&floors);
    let answer = json!({"network": by, "surface_network": surface, "rows": rows, "floors": floors});
    save_json(&arguments.out, "labels.json", &answer)?;
    save_table(&arguments.out, "labels.md", &table)
}

/// Writes `labels.json` and `labels.md` of simulated clips.
pub(super) fn simulated(arguments: &EvaluateArguments) -> Result<()> {
    output::folder(&arguments.out)?;
    let label = arguments.networks.surface_labels()?;
    let surface = label.surface.as_ref().map(|network| network.name().to_owned());
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let homes = homes(arguments);
    let seeds = homes.seeds.end.saturating_sub(homes.seeds.start);
    let steps = Steps::new(seeds * (homes.sets.len() * homes.frames.len()) as u64);
    let rows = labels::simulated(&homes, &params, &|clip| steps.advance(clip))?;
    drop(steps);
    let (rows, objects): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
    let furniture: Vec<String> = objects.iter().map(labels::ObjectsRow::markdown).collect();
    let table = format!("{}\n{}", labels::markdown(&rows), furniture.join("\n"));
    let answer = json!({ "surface_network": surface, "rows": rows, "objects": objects });
    save_json(&arguments.out, "labels.json", &answer)?;
    save_table(&arguments.out, "labels.md", &table)
}
