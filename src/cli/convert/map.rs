//! Conversion of maps.

use super::write;
use anyhow::{Context, Result, bail};
use std::path::Path;
use viola_formats::lidar::LidarMap;

fn open(file: &Path) -> Result<LidarMap> {
    LidarMap::open(file).with_context(|| format!("map {}", file.display()))
}

/// Returns the notes of the reader, then those of the writer.
fn all_notes(map: &LidarMap, written: Vec<String>) -> Vec<String> {
    map.info.notes.iter().cloned().chain(written).collect()
}

pub(super) fn valetudo(file: &Path, out: &Path) -> Result<Vec<String>> {
    let map = open(file)?;
    let written = map.to_valetudo()?;
    write(out, &written.bytes)?;
    Ok(all_notes(&map, written.notes))
}

pub(super) fn ply(file: &Path, out: &Path) -> Result<Vec<String>> {
    let map = open(file)?;
    let written = map.to_ply();
    write(out, &written.bytes)?;
    Ok(all_notes(&map, written.notes))
}

pub(super) fn ros(file: &Path, out: &Path) -> Result<Vec<String>> {
    let map = open(file)?;
    let image = out.with_extension("pgm");
    if image == *out {
        bail!("--out is the yaml file: its image is written to {}", image.display());
    }
    let name = image.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let files = map.to_ros(&name)?;
    write(&image, &files.pgm)?;
    write(out, &files.yaml)?;
    Ok(all_notes(&map, files.notes))
}
