//! Conversion of maps.

use super::{is_zip, write};
use crate::cli::args::levels;
use crate::cli::output;
use crate::cli::wrong_file::{self, Advice};
use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::io::Cursor;
use std::path::Path;
use viola_formats::clip::write::{Sink, ZipSink};
use viola_formats::lidar::LidarMap;

fn open(file: &Path) -> Result<LidarMap> {
    LidarMap::open(file).map_err(|error| wrong_file::of_map(file, error, Advice::Target))
}

/// Returns the notes of the reader, then those of the writer.
fn all_notes(map: &LidarMap, written: Vec<String>) -> Vec<String> {
    map.info.notes.iter().cloned().chain(written).collect()
}

/// Refuses to replace a file of another format, which may have more than the new one keeps.
fn keep_another_format(map: &LidarMap, format: &str, file: &Path, out: &Path) -> Result<()> {
    if map.info.format == format {
        return Ok(());
    }
    output::refuse_to_overwrite(&levels::files_of(file), &[out.to_owned()], "--out")
}

pub(super) fn valetudo(file: &Path, out: &Path) -> Result<Vec<String>> {
    let map = open(file)?;
    keep_another_format(&map, "valetudo", file, out)?;
    let written = map.to_valetudo()?;
    write(&[(out, written.bytes.as_slice())])?;
    Ok(all_notes(&map, written.notes))
}

pub(super) fn ply(file: &Path, out: &Path) -> Result<Vec<String>> {
    let map = open(file)?;
    // Points have no rooms and no free space.
    output::refuse_to_overwrite(&levels::files_of(file), &[out.to_owned()], "--out")?;
    let written = map.to_ply();
    write(&[(out, written.bytes.as_slice())])?;
    Ok(all_notes(&map, written.notes))
}

/// Writes the YAML file and its image beside it, or a zip archive of both if the name ends with .zip.
pub(super) fn ros(file: &Path, out: &Path) -> Result<Vec<String>> {
    let map = open(file)?;
    if is_zip(out) {
        keep_another_format(&map, "ros_map_server", file, out)?;
        let files = map.to_ros("map.pgm")?;
        let mut sink = ZipSink::new(Cursor::new(Vec::new()));
        sink.put("map.yaml", &files.yaml)?;
        sink.put("map.pgm", &files.pgm)?;
        let bytes = sink.finish().context("cannot make the archive")?.into_inner();
        write(&[(out, bytes.as_slice())])?;
        return Ok(all_notes(&map, files.notes));
    }
    let image = out.with_extension("pgm");
    let has_ending = |ending: &str| out.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    if !has_ending("yaml") && !has_ending("yml") {
        bail!(
            "--out {} is not the name of a ROS map; name its yaml file, whose image is written to {}, or a .zip file",
            out.display(),
            image.display()
        );
    }
    // With --out as the input, the map is replaced as asked for, with its image.
    let is_in_place = out.exists() && out.canonicalize()? == file.canonicalize()?;
    if !is_in_place {
        output::refuse_to_overwrite(&levels::files_of(file), std::slice::from_ref(&image), "--out")?;
    }
    let name = image.file_name().and_then(OsStr::to_str).with_context(|| {
        format!(
            "--out {} is not UTF-8, so that its yaml file cannot name the image; choose another name",
            out.display()
        )
    })?;
    let files = map.to_ros(name)?;
    write(&[(image.as_path(), files.pgm.as_slice()), (out, files.yaml.as_slice())])?;
    Ok(all_notes(&map, files.notes))
}
