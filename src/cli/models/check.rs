//! `viola models check`: runs a network on a picture and draws its output.

mod depth;
mod inpainting;
mod segmentation;

use super::{Folder, find};
use crate::cli::args::RuntimeArguments;
use crate::cli::output;
use anyhow::{Context, Result, bail};
use clap::Args;
use image::{DynamicImage, ImageFormat};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use viola_network::manifest::{Manifest, ModelEntry, Task};
use viola_network::{self as network, Network, RuntimeParams};

#[derive(Args)]
pub struct CheckArguments {
    /// Network: a name from `viola models list`, or a file.
    network: String,
    #[command(flatten)]
    folder: Folder,
    /// Picture (JPEG or PNG).
    #[arg(long)]
    picture: PathBuf,
    /// PNG file to write: the picture with class colours and a legend, the filled picture, or the depth.
    #[arg(long)]
    out: PathBuf,
    /// For inpainting: mask of the same size as the picture, white in the holes and black elsewhere. Default:
    /// one hole in the middle.
    #[arg(long, value_name = "PNG")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    runtime: RuntimeArguments,
    /// Number of runs; the median time is printed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
}

pub(super) fn run(arguments: &CheckArguments) -> Result<()> {
    let inputs: Vec<PathBuf> = [&arguments.picture].into_iter().chain(&arguments.mask).cloned().collect();
    output::refuse_to_overwrite(&inputs, std::slice::from_ref(&arguments.out), "--out")?;
    let models = &arguments.folder.models;
    let manifest = arguments.folder.manifest()?;
    let entry = entry(&manifest, models, &arguments.network)?;
    if arguments.mask.is_some() && entry.task != Task::Inpainting {
        bail!("{} fills no holes: --mask is not for it", entry.name);
    }
    let takes_pictures = matches!(entry.task, Task::Segmentation | Task::Depth | Task::Inpainting);
    if takes_pictures && !entry.path(models).is_file() {
        let (name, folder) = (&entry.name, models.display());
        bail!("{name} is not installed in {folder}; run `viola models fetch {name} --models {folder}`");
    }
    let picture = read(&arguments.picture)?.into_rgb8();
    let params = arguments.runtime.params(Some(models));
    let drawn = match entry.task {
        Task::Segmentation => segmentation::run(entry, arguments, &params, &picture)?,
        Task::Depth => depth::run(entry, arguments, &params, &picture)?,
        Task::Inpainting => inpainting::run(entry, arguments, &params, &picture)?,
        Task::Surface => bail!("{} classifies surfaces, not pictures: try viola align", entry.name),
        Task::Runtime => bail!("{} is no network", entry.name),
    };
    let out = arguments.out.display();
    drawn
        .save_with_format(&arguments.out, ImageFormat::Png)
        .with_context(|| format!("cannot write {out}"))?;
    println!("wrote:   {out}");
    Ok(())
}

/// Opens the network of an entry and makes it usable by `make`; prints its runtime and the time that this took.
fn opened<T, E>(
    entry: &ModelEntry,
    arguments: &CheckArguments,
    params: &RuntimeParams,
    make: impl FnOnce(&ModelEntry, Arc<Network>) -> Result<T, E>,
) -> Result<T>
where
    anyhow::Error: From<E>,
{
    let start = Instant::now();
    let network = network::open(&entry.path(&arguments.folder.models), params)?;
    println!("runtime: {}, because {}", network.runtime(), network.reason());
    let made = make(entry, network)?;
    print_loaded(&entry.name, start);
    Ok(made)
}

fn print_loaded(name: &str, start: Instant) {
    println!("loaded:  {name} in {} ms", start.elapsed().as_millis());
}

/// Runs `work` several times, prints its times and returns its last result.
fn timed<T, E>(runs: u32, work: impl Fn() -> Result<T, E>) -> Result<T, E> {
    let mut times_ms = Vec::new();
    let mut run = || {
        let start = Instant::now();
        let done = work();
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        done
    };
    let mut last = run()?;
    for _ in 1..runs {
        last = run()?;
    }
    let first = times_ms[0];
    times_ms.sort_by(f64::total_cmp);
    let median = times_ms[times_ms.len() / 2];
    println!("time:    first run {first:.1} ms; median of {} runs {median:.1} ms", times_ms.len());
    Ok(last)
}

fn read(path: &Path) -> Result<DynamicImage> {
    image::ImageReader::open(path)
        .and_then(image::ImageReader::with_guessed_format)
        .with_context(|| format!("cannot read {}", path.display()))?
        .decode()
        .with_context(|| format!("{} is no picture that can be read", path.display()))
}

/// Returns the manifest's entry with this name or this file.
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
            models.join(viola_network::manifest::FILE).display()
        )
    })
}
