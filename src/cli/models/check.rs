//! `viola models check`: what a network says of a picture, to be looked at.

use super::drawing::Drawing;
use super::timed::Timed;
use super::{Folder, find};
use crate::align::label::{ClassMap, open_segmenter};
use crate::cli::runtime::RuntimeArguments;
use crate::network;
use crate::network::manifest::{Manifest, ModelEntry, Task};
use crate::taxonomy::{CLASSES, Class};
use anyhow::{Context, Result, bail};
use clap::Args;
use image::RgbImage;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
pub struct CheckArguments {
    /// A network's name in the list, or its file.
    network: String,
    #[command(flatten)]
    folder: Folder,
    /// The picture (JPEG or PNG).
    #[arg(long)]
    picture: PathBuf,
    /// Where the drawing goes: the classes' colours over the picture, and a legend.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    runtime: RuntimeArguments,
    /// How often it runs; the median time is told.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
}

pub(super) fn run(arguments: &CheckArguments) -> Result<()> {
    let models = &arguments.folder.models;
    let manifest = arguments.folder.manifest()?;
    let entry = entry(&manifest, models, &arguments.network)?;
    if entry.task != Task::Segmentation {
        bail!("{} is no segmentation network; only those are drawn", entry.name);
    }
    let path = entry.path(models);
    let picture = image::ImageReader::open(&arguments.picture)
        .and_then(image::ImageReader::with_guessed_format)
        .with_context(|| format!("cannot read {}", arguments.picture.display()))?
        .decode()
        .with_context(|| format!("{} is no picture that can be read", arguments.picture.display()))?
        .into_rgb8();
    let start = Instant::now();
    let network = network::open(&path, &arguments.runtime.params(Some(models)))?;
    println!("runtime: {}, because {}", network.runtime(), network.reason());
    let network = Timed::new(network);
    let segmenter = open_segmenter(entry, network.clone())?;
    println!("loaded:  {} in {} ms", entry.name, start.elapsed().as_millis());

    let (mut whole_ms, mut rest_ms) = (Vec::new(), Vec::new());
    let mut map = None;
    for _ in 0..arguments.runs {
        let start = Instant::now();
        map = Some(segmenter.segment(&picture)?);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        whole_ms.push(ms);
        rest_ms.push(ms - network.last_ms());
    }
    let Some(map) = map else { bail!("it was not run") };
    let median = |times_ms: &[f64]| {
        let mut sorted = times_ms.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    println!(
        "time:    first run {:.1} ms; median of {} runs {:.1} ms, {:.1} ms of it before and after the network",
        whole_ms[0],
        whole_ms.len(),
        median(&whole_ms),
        median(&rest_ms)
    );

    let classes = classes(&map, &picture);
    let shares = shares(&classes);
    for (class, share) in &shares {
        println!("{:16} {:5.1} %", class.name(), share * 100.0);
    }
    let drawing = Drawing::new(&picture, &classes, &shares);
    drawing.save(&arguments.out).with_context(|| format!("cannot write {}", arguments.out.display()))?;
    println!("wrote:   {}", arguments.out.display());
    Ok(())
}

/// The entry of a name, or the one whose file this is.
fn entry<'m>(manifest: &'m Manifest, models: &Path, network: &str) -> Result<&'m ModelEntry> {
    let Ok(file) = std::fs::canonicalize(network) else { return find(manifest, network) };
    if manifest.find(network).is_some() {
        return find(manifest, network);
    }
    let is_it =
        |entry: &&ModelEntry| std::fs::canonicalize(entry.path(models)).is_ok_and(|path| path == file);
    manifest.networks.iter().find(is_it).with_context(|| {
        format!(
            "{network} is in no entry of a models.toml, so it is unknown how pictures go in; \
             write an entry for it into {}",
            models.join(crate::network::manifest::FILE).display()
        )
    })
}

/// The likeliest class of each of the picture's pixels.
fn classes(map: &ClassMap, picture: &RgbImage) -> Vec<Class> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let mut p = [0.0; CLASSES];
    let mut classes = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            map.sample(x as f32, y as f32, width, height, &mut p);
            let best = Class::ALL.iter().max_by(|a, b| p[a.id() as usize].total_cmp(&p[b.id() as usize]));
            classes.push(best.copied().unwrap_or(Class::Other));
        }
    }
    classes
}

/// The classes that are there, with their shares of the picture, the largest first.
fn shares(classes: &[Class]) -> Vec<(Class, f64)> {
    let mut shares: Vec<(Class, f64)> = Class::ALL
        .iter()
        .map(|class| (*class, classes.iter().filter(|c| *c == class).count() as f64 / classes.len() as f64))
        .filter(|(_, share)| *share > 0.0)
        .collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}
