//! `viola convert`: a map as a file that other tools read.

use crate::lidar::LidarMap;
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct ConvertArguments {
    /// The map, in any format that is read.
    file: PathBuf,
    /// What to write.
    #[arg(long, value_enum)]
    to: Target,
    /// The file to write; for ROS the yaml file, with its image beside it.
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Target {
    /// Valetudo's map JSON.
    Valetudo,
    /// A yaml file and a PGM for map_server.
    Ros,
    /// What the LiDAR hit, as points.
    Ply,
}

pub fn run(arguments: &ConvertArguments) -> Result<()> {
    let map = LidarMap::open(&arguments.file).with_context(|| format!("map {}", arguments.file.display()))?;
    let out = &arguments.out;
    let mut notes = map.info.notes.clone();
    match arguments.to {
        Target::Valetudo => {
            let written = map.to_valetudo()?;
            notes.extend(written.notes);
            write(out, &written.bytes)?;
        }
        Target::Ply => {
            let written = map.to_ply();
            notes.extend(written.notes);
            write(out, &written.bytes)?;
        }
        Target::Ros => {
            let image = out.with_extension("pgm");
            if image == *out {
                bail!("--out is the yaml file: its image is written to {}", image.display());
            }
            let name = image.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let files = map.to_ros(&name)?;
            notes.extend(files.notes);
            write(&image, &files.pgm)?;
            write(out, &files.yaml)?;
        }
    }
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
