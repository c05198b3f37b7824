//! `viola surfaces`: labelled surfaces of simulated clips, for training.

use super::args::numbers;
use super::output;
use super::progress::Steps;
use anyhow::Result;
use std::ops::Range;
use std::path::PathBuf;
use viola_align::AlignParams;
use viola_geometry::progress::Silent;
use viola_lab::simulate::{Catalogue, ClipParams, Home, HomeParams, Sensor, Set};
use viola_lab::surfaces::labelled_surface;

#[derive(clap::Args)]
pub struct SurfacesArguments {
    /// Kinds of homes, separated by commas: normal, upper, repeated, changed, storeys, drifted,
    /// glass, crowded.
    #[arg(long, value_delimiter = ',', default_value = "normal,changed")]
    set: Vec<Set>,
    /// Seeds of the homes; END is excluded.
    #[arg(long, value_name = "FIRST..END", default_value = "0..10", value_parser = super::align::range::<u64>)]
    seeds: Range<u64>,
    /// Lengths of the clips in frames, separated by commas; each home has one clip of each.
    #[arg(long, value_delimiter = ',', default_value = "6,15,30,60,120", value_parser = numbers::frames)]
    frames: Vec<usize>,
    /// Errors of the device's poses after one metre of path, in metres, taken in turn.
    #[arg(long, value_delimiter = ',', default_value = "0.002,0.005,0.01", value_parser = numbers::drift_m)]
    drift: Vec<f64>,
    /// Folder of furniture meshes, which replace pieces of the same class and a similar size: CLASS-NAME.ply in metres,
    /// the width along x, the back at +y, z up. models/train/furniture.py makes them.
    #[arg(long, value_name = "DIR")]
    furniture: Option<PathBuf>,
    /// Output folder, created if it is missing. Surfaces that it has already are kept.
    #[arg(long)]
    out: PathBuf,
}

pub fn run(arguments: &SurfacesArguments) -> Result<()> {
    let out = &arguments.out;
    output::folder(out)?;
    let catalogue = arguments.furniture.as_deref().map(Catalogue::open).transpose()?.unwrap_or_default();
    let seeds = arguments.seeds.end.saturating_sub(arguments.seeds.start);
    let steps = Steps::new(seeds * arguments.set.len() as u64);
    let mut turn = 0;
    for seed in arguments.seeds.clone() {
        for &set in &arguments.set {
            surfaces_of_home(arguments, &catalogue, set, seed, &mut turn)?;
            steps.advance(&format!("{} {seed}", set.name()));
        }
    }
    Ok(())
}

fn surfaces_of_home(
    arguments: &SurfacesArguments,
    catalogue: &Catalogue,
    set: Set,
    seed: u64,
    turn: &mut usize,
) -> Result<()> {
    let home = Home::furnished(&HomeParams::new(set, seed), catalogue);
    let (survey, objects) = (home.survey(), home.objects_alone());
    for (index, &frames) in (0..).zip(&arguments.frames) {
        *turn += 1;
        let path = arguments.out.join(format!("{}_{seed:06}_{frames:03}.surface", set.name()));
        if path.exists() {
            continue;
        }
        let sensor = if turn.is_multiple_of(2) { Sensor::PhoneLidar } else { Sensor::StructuredLight };
        let params = ClipParams {
            frames,
            sensor,
            color_width: Sensor::PhoneLidar.depth_camera().width,
            drift: arguments.drift[*turn % arguments.drift.len()],
            ..ClipParams::default()
        };
        let clip = home.clip(&survey, index, &params);
        let surface =
            labelled_surface(clip, &objects, &AlignParams { seed, ..AlignParams::default() }, &Silent)?;
        if let Some(surface) = surface {
            output::write_bytes(&path, surface)?;
        }
    }
    Ok(())
}
