//! `viola evaluate --home`: compares a home's map, rooms and objects with a mesh or a simulated truth.

use super::evaluate::{EvaluateArguments, save, scene_of};
use super::progress::TerminalProgress;
use anyhow::{Context, Result};
use std::fs;
use std::path::Path;
use viola_align::AlignParams;
use viola_geometry::progress::Silent;
use viola_home as home;
use viola_lab::evaluate::home as lab;
use viola_lab::evaluate::home::{RecordParams, SampleParams, Source, consecutive, evaluate};
use viola_lab::simulate::{HomeParams, Set};

/// Writes `home.json`, `home.md` and the plan as PNG, SVG and GeoJSON.
pub fn scene(arguments: &EvaluateArguments, path: &Path) -> Result<()> {
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

/// Writes `home.json`, `home.md` and, for each set, the plan of its first home as PNG and SVG; with `--fit`, the model
/// of the objects' confidence.
pub fn simulated(arguments: &EvaluateArguments) -> Result<()> {
    let out = &arguments.out;
    fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let accuracy = arguments.picture_labels.unwrap_or(SampleParams::default().accuracy);
    let params = SampleParams { accuracy, ..SampleParams::default() };
    let mut sources = vec![(
        format!("{:.0} % of the patches called what they are", accuracy * 100.0),
        Source::Sampled(params.clone()),
    )];
    if let Some(clips) = arguments.clips {
        let frames = arguments.frames.first().copied().unwrap_or(60);
        let label = arguments.networks.surface_labels()?;
        let align = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
        let recording = RecordParams { clips: clips as u64, frames };
        sources.push((
            format!("{clips} recordings of {frames} frames each"),
            Source::Recorded(recording, Box::new(align)),
        ));
    }
    let (mut rows, mut text, mut judged) = (Vec::new(), String::new(), Vec::new());
    for set in &arguments.set {
        for (name, source) in &sources {
            let score = lab::simulated(*set, arguments.seeds.clone(), source, &Silent)?;
            text += &format!(
                "{}, seeds {:?}, {name}: {} of {} rooms with an IoU of at least 0.5; {} pairs of objects in each other's \
                 space; furniture:\n\n{}\n",
                set.name(),
                arguments.seeds,
                score.rooms_matched,
                score.rooms,
                score.conflicts,
                score.objects.markdown()
            );
            rows.push(serde_json::json!({
                "set": set.name(), "source": name, "objects": score.objects, "rooms": score.rooms,
                "matched": score.rooms_matched, "conflicts": score.conflicts,
            }));
            judged.extend(score.judged);
        }
        save_plan(out, *set, arguments.seeds.start, &params)?;
    }
    if let Some(file) = &arguments.fit {
        let made_by = [
            ("command", std::env::args().collect::<Vec<_>>().join(" ")),
            ("fitted_to", format!("{} candidates of seeds {:?}", judged.len(), arguments.seeds)),
        ];
        let made_by = made_by.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        let model = lab::fit_confidence(&judged, made_by)
            .context("cannot fit the confidence: all objects are right, or none is; add homes")?;
        fs::write(file, serde_json::to_string_pretty(&model)? + "\n")
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    save(out, "home.json", &serde_json::to_string_pretty(&rows)?)?;
    save(out, "home.md", &text)?;
    print!("{text}");
    Ok(())
}

/// Writes the plan of a sampled home as PNG and SVG.
fn save_plan(out: &Path, set: Set, seed: u64, params: &SampleParams) -> Result<()> {
    let map = lab::sample(&HomeParams::new(set, seed), params)?;
    let rooms = home::rooms(&map.lidar, &map.points);
    let sizes = home::ObjectsParams { voxel_m: params.voxel_m };
    let objects = home::objects(&map.points, &rooms, &sizes);
    let plan = home::plan(&map.lidar, &map.points, &rooms, &objects);
    let picture = out.join(format!("plan_{}.png", set.name()));
    fs::write(&picture, home::plan_png(&plan))
        .with_context(|| format!("cannot write {}", picture.display()))?;
    save(out, &format!("plan_{}.svg", set.name()), &home::plan_svg(&plan))
}
