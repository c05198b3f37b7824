//! `viola evaluate`: the paper's protocol on a scene with known poses.

use crate::align::AlignParams;
use crate::evaluate::{self, Method, Scene};
use crate::progress::Silent;
use anyhow::{Context, Result, bail};
use clap::Args;
use indicatif::ProgressBar;
use std::io::IsTerminal;
use std::path::PathBuf;

#[derive(Args)]
pub struct EvaluateArguments {
    /// A recording with true poses, in a layout that the clip readers know.
    #[arg(long)]
    scene: PathBuf,
    /// Lengths of the clips in frames; each cuts the scene into half-overlapping excerpts.
    #[arg(long, default_value = "60", value_delimiter = ',')]
    frames: Vec<usize>,
    /// The scene's LiDAR map.
    #[arg(long)]
    lidar: PathBuf,
    /// JSON with map_from_world {x_m, y_m, yaw_rad}.
    #[arg(long)]
    truth: PathBuf,
    /// Methods to compare, by name.
    #[arg(long, default_value = "viola", value_delimiter = ',')]
    methods: Vec<String>,
    /// Where table.json, table.md and clips.csv go.
    #[arg(long)]
    out: PathBuf,
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

pub fn run(arguments: &EvaluateArguments) -> Result<()> {
    let methods =
        arguments.methods.iter().map(|name| method(name, arguments.seed)).collect::<Result<Vec<_>>>()?;
    let scene = Scene::open(&arguments.scene, &arguments.lidar, &arguments.truth)?;
    let mut results = Vec::new();
    for &length in &arguments.frames {
        let bar = std::io::stderr().is_terminal().then(|| ProgressBar::new(0));
        let report = |result: &evaluate::ClipResult, done: usize, total: usize| match &bar {
            Some(bar) => {
                bar.set_length(total as u64);
                bar.set_position(done as u64);
            }
            None => eprintln!(
                "{done}/{total} {} frames {}..={}: {:.2} deg, {:.3} m",
                result.method,
                result.first_frame,
                result.last_frame,
                result.rotation_error_deg,
                result.translation_error_m
            ),
        };
        let clips = evaluate::excerpts(scene.clip.frames().len(), length);
        results.extend(evaluate::evaluate_clips(&scene, &clips, &methods, &Silent, report)?);
    }
    let rows = evaluate::tabulate(&results);
    let table = evaluate::markdown(&rows);
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make the folder {}", arguments.out.display()))?;
    for (name, text) in [
        ("table.json", serde_json::to_string_pretty(&rows)?),
        ("table.md", table.clone()),
        ("clips.csv", evaluate::clips_csv(&results)),
    ] {
        let path = arguments.out.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    print!("{table}");
    Ok(())
}

fn method(name: &str, seed: u64) -> Result<Method> {
    let params = AlignParams { seed, ..AlignParams::default() };
    match name {
        "viola" => Ok(Method { name: name.to_owned(), params }),
        _ => bail!("there is no method '{name}'; known: viola"),
    }
}
