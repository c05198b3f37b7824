//! `viola convert`: a map or a clip as a file that other tools read.

mod clip;
mod map;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct ConvertArguments {
    /// The map or the clip, in any format that is read.
    file: PathBuf,
    /// What to write.
    #[arg(long, value_enum)]
    to: Target,
    /// The file to write. For ROS the yaml file, with its image beside it; for a clip a folder, or a zip archive when
    /// the name ends with .zip.
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Target {
    /// A map as Valetudo's JSON.
    Valetudo,
    /// A map as a yaml file and a PGM for map_server.
    Ros,
    /// A map's hits as points.
    Ply,
    /// A clip as Stray Scanner exports it.
    Stray,
    /// A clip as the TUM RGB-D benchmark has it.
    Tum,
    /// A clip as ScanNet's exporter writes it.
    Scannet,
}

pub fn run(arguments: &ConvertArguments) -> Result<()> {
    use viola_formats::clip::write::WrittenLayout;
    if !arguments.file.exists() {
        bail!("there is no {}", arguments.file.display());
    }
    let notes = match arguments.to {
        Target::Valetudo => map::valetudo(&arguments.file, &arguments.out),
        Target::Ply => map::ply(&arguments.file, &arguments.out),
        Target::Ros => map::ros(&arguments.file, &arguments.out),
        Target::Stray => clip::convert(&arguments.file, &arguments.out, WrittenLayout::StrayScanner),
        Target::Tum => clip::convert(&arguments.file, &arguments.out, WrittenLayout::TumRgbd),
        Target::Scannet => clip::convert(&arguments.file, &arguments.out, WrittenLayout::Scannet),
    }?;
    for note in notes {
        println!("note:   {note}");
    }
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    println!("wrote:  {}, {} bytes", path.display(), bytes.len());
    Ok(())
}
