//! `viola convert`: writes a map or a clip in a format that other tools read.

mod clip;
mod map;

use super::output;
use super::progress::to_standard_error;
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct ConvertArguments {
    /// Map or clip, in any format that `viola align` reads.
    file: PathBuf,
    /// Output format.
    #[arg(long, value_enum)]
    to: Target,
    /// Output file. For ROS: a .yaml or .yml file, with its image beside it, or a zip archive of both if the name ends
    /// with .zip. For a clip: a folder, or a zip archive if the name ends with .zip.
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Target {
    /// Map: Valetudo JSON.
    Valetudo,
    /// Map: YAML and PGM files for ROS map_server.
    Ros,
    /// Map: occupied points as PLY.
    Ply,
    /// Clip: export of Stray Scanner.
    Stray,
    /// Clip: layout of the TUM RGB-D benchmark, with the frames without a pose, too.
    Tum,
    /// Clip: layout of ScanNet's exporter.
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
        tell(&arguments.out, &format!("note:   {note}"));
    }
    Ok(())
}

/// Returns whether the output is a zip archive by its name.
fn is_zip(out: &Path) -> bool {
    out.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("zip"))
}

/// Prints a line about the output: to standard error if the output is a pipe, which may be standard output.
fn tell(out: &Path, line: &str) {
    if out.is_file() || out.is_dir() { println!("{line}") } else { to_standard_error(line) }
}

/// Writes all files, and then prints their list, which may end the program.
fn write(files: &[(&Path, &[u8])]) -> Result<()> {
    for (path, bytes) in files {
        if let Some(folder) = path.parent() {
            output::folder(folder)?;
        }
        output::write_bytes(path, bytes)?;
    }
    for (path, bytes) in files {
        tell(path, &format!("wrote:  {}, {} bytes", path.display(), bytes.len()));
    }
    Ok(())
}
