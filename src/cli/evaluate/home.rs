//! `viola evaluate --home`: compares a home's map, rooms and objects with a mesh or a simulated truth.

use super::{EvaluateArguments, save, scene_of};
use crate::cli::output;
use crate::cli::progress::{Steps, TerminalProgress};
use anyhow::Result;
use std::path::Path;
use viola_align::AlignParams;
use viola_geometry::progress::Progress;
use viola_home as home;
use viola_lab::evaluate::home as lab;
use viola_lab::evaluate::home::{MIN_EXTENT_M, MIN_IOU, SampleParams, consecutive, evaluate};

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
    save(out, "home.json", &serde_json::to_string_pretty(&report)?)?;
    save(out, "home.md", &report.markdown())?;
    save(out, "plan.svg", &home::plan_svg(&plan))?;
    save(out, "plan.geojson", &home::plan_geojson(&plan).to_string())?;
    output::write_bytes(&out.join("plan.png"), home::plan_png(&plan))?;
    print!("{}", report.markdown());
    Ok(())
}

/// Writes `home.json`, `home.md` and, for each set, the plan of its first home as PNG and SVG.
pub fn simulated(arguments: &EvaluateArguments) -> Result<()> {
    let out = &arguments.out;
    output::folder(out)?;
    let accuracy = arguments.picture_labels.unwrap_or(SampleParams::default().accuracy);
    let params = SampleParams { accuracy, ..SampleParams::default() };
    let (mut rows, mut text) = (Vec::new(), SAMPLED.to_owned());
    let seeds = arguments.seeds.end.saturating_sub(arguments.seeds.start);
    let steps = Steps::new(seeds * arguments.set.len() as u64);
    for set in &arguments.set {
        let advance = |seed| steps.advance(&format!("{} {seed}", set.name()));
        let score = lab::simulated(*set, arguments.seeds.clone(), &params, &advance)?;
        let (matches, there, matched) = (&score.objects, score.rooms, score.matched_rooms);
        text += &format!(
            "{}, seeds {:?}, at least {:.0} % of the patches called what they are: {matched} of {there} rooms with an IoU of at \
             least 0.5; furniture over {MIN_EXTENT_M} m, same class, 3D IoU of at least {MIN_IOU} of turned boxes:\n\n{}\n\
             Floor plan (10 cm, 3 degrees; lengths are those of the nearest drawn sides):\n\n{}\n",
            set.name(),
            arguments.seeds,
            accuracy * 100.0,
            matches.markdown(),
            score.plan.markdown()
        );
        rows.push(
            serde_json::json!({ "set": set.name(), "objects": matches, "rooms": there, "matched": matched, "plan": score.plan }),
        );
        let home = viola_lab::simulate::HomeParams::new(*set, arguments.seeds.start);
        let map = lab::sample(&home, &params)?;
        let rooms = home::rooms(&map.lidar, &map.points);
        let sizes = home::ObjectsParams { voxel_m: params.voxel_m };
        let objects = home::objects(&map.points, &rooms, &sizes);
        let plan = home::plan(&map.lidar, &map.points, &rooms, &objects);
        output::write_bytes(&out.join(format!("plan_{}.png", set.name())), home::plan_png(&plan))?;
        save(out, &format!("plan_{}.svg", set.name()), &home::plan_svg(&plan))?;
    }
    drop(steps);
    save(out, "home.json", &serde_json::to_string_pretty(&rows)?)?;
    save(out, "home.md", &text)?;
    print!("{text}");
    Ok(())
}
