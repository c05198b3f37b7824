//! `viola evaluate --home`: compares a home's map, rooms and objects with a mesh or a simulated truth.

use super::each_home::each_home;
use super::{EvaluateArguments, save, save_json, save_table, scene_of};
use crate::cli::output;
use crate::cli::progress::{Steps, TerminalProgress};
use anyhow::Result;
use std::path::Path;
use viola_align::AlignParams;
use viola_geometry::progress::{Progress, Silent};
use viola_home as home;
use viola_lab::evaluate::home as lab;
use viola_lab::evaluate::home::{
    ComputedHome, MIN_EXTENT_M, MIN_IOU, SampleParams, SimulatedMap, SimulatedScore, consecutive, evaluate,
};
use viola_lab::simulate::{HomeParams, Set};

/// First lines of the tables of simulated homes.
const SAMPLED: &str =
    "Points are sampled from the true surface of all rooms: no clips, no fusion, no errors of poses.\n\n";

/// Writes `home.json`, `home.md` and the plan as PNG, SVG and GeoJSON.
pub fn scene(arguments: &EvaluateArguments, path: &Path) -> Result<()> {
    let out = &arguments.out;
    output::folder(out)?;
    let scene = scene_of(arguments, path)?;
    let label = arguments.networks.labels()?;
    let params = AlignParams { seed: arguments.seed, label, ..AlignParams::default() };
    let ranges = consecutive(scene.clip.frames().len(), arguments.first_length());
    let progress = |part: String| -> Box<dyn Progress> { Box::new(TerminalProgress::of_step(part)) };
    let (report, plan) = evaluate(&scene, path, &ranges, &params, &progress)?;
    save_json(out, "home.json", &report)?;
    save(out, "plan.svg", &home::plan_svg(&plan))?;
    save(out, "plan.geojson", &home::plan_geojson(&plan).to_string())?;
    output::write_bytes(&out.join("plan.png"), home::plan_png(&plan))?;
    save_table(out, "home.md", &report.markdown())
}

/// Writes `home.json`, `home.md` and, for each set, the plan of its first home as PNG and SVG. With a number of clips the homes
/// are filmed, the aligned clips are in `clips`, and each home's plan is written.
pub fn simulated(arguments: &EvaluateArguments) -> Result<()> {
    output::folder(&arguments.out)?;
    let is_filmed = arguments.clips.is_some();
    let scores = if is_filmed { filmed(arguments)? } else { sampled(arguments)? };
    let (mut rows, mut text) = (Vec::new(), if is_filmed { String::new() } else { SAMPLED.to_owned() });
    for (set, score) in arguments.set.iter().zip(&scores) {
        let (matches, there, matched) = (&score.objects, score.rooms, score.matched_rooms);
        text += &format!(
            "{}, seeds {:?}, {}: {matched} of {there} rooms with an IoU of at least 0.5; furniture over {MIN_EXTENT_M} m, same \
             class, 3D IoU of at least {MIN_IOU} of turned boxes:\n\n{}\n\
             Floor plan (10 cm, 3 degrees; lengths are those of the nearest drawn sides):\n\n{}\n",
            set.name(),
            arguments.seeds,
            source(arguments),
            matches.markdown(),
            score.plan.markdown()
        );
        rows.push(
            serde_json::json!({ "set": set.name(), "objects": matches, "rooms": there, "matched": matched, "plan": score.plan }),
        );
    }
    save_json(&arguments.out, "home.json", &rows)?;
    save_table(&arguments.out, "home.md", &text)
}

/// Returns how the points of simulated homes were made, in words.
fn source(arguments: &EvaluateArguments) -> String {
    let labels =
        |accuracy: f64| format!("at least {:.0} % of the patches called what they are", accuracy * 100.0);
    match arguments.clips {
        Some(clips) => {
            let labels = arguments
                .picture_labels
                .map_or(String::new(), |accuracy| ", ".to_owned() + &labels(accuracy));
            format!("{clips} clips of {} frames{labels}", arguments.first_length())
        }
        None => labels(accuracy(arguments)),
    }
}

/// Returns the minimum accuracy of the labels of sampled points.
fn accuracy(arguments: &EvaluateArguments) -> f64 {
    arguments.picture_labels.unwrap_or(SampleParams::default().accuracy)
}

/// Returns the scores of homes whose points are sampled, by set.
fn sampled(arguments: &EvaluateArguments) -> Result<Vec<SimulatedScore>> {
    let params = SampleParams { accuracy: accuracy(arguments), ..SampleParams::default() };
    let seeds = arguments.seeds.end.saturating_sub(arguments.seeds.start);
    let steps = Steps::new(seeds * arguments.set.len() as u64);
    let score = |set: &Set| {
        let advance = |seed| steps.advance(&format!("{} {seed}", set.name()));
        let score = lab::simulated(*set, arguments.seeds.clone(), &params, &advance)?;
        let first = lab::sample(&HomeParams::new(*set, arguments.seeds.start), &params)?;
        save_plan(arguments, set.name(), &first.compute(params.voxel_m))?;
        Ok(score)
    };
    arguments.set.iter().map(score).collect()
}

/// Returns the scores of filmed homes, by set.
fn filmed(arguments: &EvaluateArguments) -> Result<Vec<SimulatedScore>> {
    let homes = each_home(arguments, |set, seed, homes, params, folder| {
        let map = lab::film(set, seed, homes, params, folder, &Silent)?;
        let computed = map.compute(home::MAP_VOXEL_M);
        save_plan(arguments, &format!("{}_{seed}", set.name()), &computed)?;
        // The points take most of the memory.
        Ok((set, SimulatedMap { points: Vec::new(), ..map }, computed))
    })?;
    let of_set = |set: &Set| {
        let mut score = SimulatedScore::default();
        homes.iter().filter(|(of, ..)| of == set).for_each(|(_, map, computed)| score.add(map, computed));
        score
    };
    Ok(arguments.set.iter().map(of_set).collect())
}

/// Writes a plan as PNG and SVG.
fn save_plan(arguments: &EvaluateArguments, name: &str, computed: &ComputedHome) -> Result<()> {
    let path = arguments.out.join(format!("plan_{name}.png"));
    output::write_bytes(&path, home::plan_png(&computed.plan))?;
    save(&arguments.out, &format!("plan_{name}.svg"), &home::plan_svg(&computed.plan))
}
