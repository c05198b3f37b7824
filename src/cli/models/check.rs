//! `viola models check`: what a network says of a picture, to be looked at.

mod depth;
mod inpainting;
mod segmentation;
mod times;

use super::{Folder, find};
use crate::cli::runtime::RuntimeArguments;
use anyhow::{Context, Result, bail};
use clap::Args;
use image::DynamicImage;
use std::path::{Path, PathBuf};
use viola_network::manifest::{Manifest, ModelEntry, Task};

#[derive(Args)]
pub struct CheckArguments {
    /// A network's name in the list, or its file.
    network: String,
    #[command(flatten)]
    folder: Folder,
    /// The picture (JPEG or PNG).
    #[arg(long)]
    picture: PathBuf,
    /// Where the drawing goes: the classes' colours over the picture and a legend, the filled picture, or the
    /// depth in colours.
    #[arg(long)]
    out: PathBuf,
    /// For inpainting: the holes, a picture of the same size that is white in them and black elsewhere. Without
    /// it, a hole in the middle.
    #[arg(long, value_name = "PNG")]
    mask: Option<PathBuf>,
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
    if arguments.mask.is_some() && entry.task != Task::Inpainting {
        bail!("{} fills no holes: --mask is not for it", entry.name);
    }
    let picture = read(&arguments.picture)?.into_rgb8();
    let params = arguments.runtime.params(Some(models));
    match entry.task {
        Task::Segmentation => segmentation::run(entry, arguments, &params, &picture)?,
        Task::Depth => depth::run(entry, arguments, &params, &picture)?,
        Task::Inpainting => inpainting::run(entry, arguments, &params, &picture)?,
        Task::Runtime => bail!("{} is no network", entry.name),
    }
    println!("wrote:   {}", arguments.out.display());
    Ok(())
}

fn read(path: &Path) -> Result<DynamicImage> {
    image::ImageReader::open(path)
        .and_then(image::ImageReader::with_guessed_format)
        .with_context(|| format!("cannot read {}", path.display()))?
        .decode()
        .with_context(|| format!("{} is no picture that can be read", path.display()))
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
            models.join(viola_network::manifest::FILE).display()
        )
    })
}
