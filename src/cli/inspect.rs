//! `viola inspect`: prints the format and contents of a map or a clip.

mod sketch;

use super::args::levels;
use super::output;
use super::video_tools::video_tools;
use super::wrong_file::{self, Advice};
use anyhow::{Result, bail};
use clap::Args;
use std::path::PathBuf;
use viola_formats::clip::{Clip, ClipError, ClipInfo};
use viola_formats::container::ContainerError;
use viola_formats::lidar::{LidarError, LidarMap};
use viola_home as home;

#[derive(Args)]
pub struct InspectArguments {
    /// Map as a file, or clip as a file or a folder, in any format that `viola align` reads.
    file: PathBuf,
    /// Print the summary that the service returns, as JSON.
    #[arg(long)]
    json: bool,
    /// PNG file to write: a picture of the map, or a contact sheet of the clip with up to a dozen frames,
    /// colour above depth. Without it, a map is sketched in characters.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

pub fn run(arguments: &InspectArguments) -> Result<()> {
    let path = &arguments.file;
    if !path.exists() {
        bail!("there is no {}", path.display());
    }
    if let Some(picture) = &arguments.picture {
        output::refuse_to_overwrite(&levels::files_of(path), std::slice::from_ref(picture), "--picture")?;
    }
    if path.is_dir() {
        let found = Clip::open_with(path, &video_tools());
        return clip(arguments, &found.map_err(|error| wrong_file::of_clip(path, error, Advice::Flags))?);
    }
    let refused = match LidarMap::open(path) {
        Ok(found) => return map(arguments, &found),
        Err(refused) => refused,
    };
    if matches!(refused, LidarError::ImageWithoutYaml) {
        return Err(wrong_file::of_map(path, refused, Advice::Flags));
    }
    // A zip can be either; so can a file too large for a map, and a gzip file that was cut off.
    let may_be_clip = matches!(
        refused,
        LidarError::UnknownFormat
            | LidarError::FileTooLarge { .. }
            | LidarError::BadCompression { .. }
            | LidarError::Container(_)
    );
    let name = path.display();
    if !may_be_clip {
        bail!("{name} cannot be used as a map ({}): {refused}", refused.code());
    }
    match Clip::open_with(path, &video_tools()) {
        Ok(found) => clip(arguments, &found),
        Err(ClipError::UnknownLayout { .. }) if matches!(refused, LidarError::UnknownFormat) => bail!(
            "{name} is {}, neither a clip nor a LiDAR map (unknown_format)\n\
             `viola align --help` lists the clips and the maps that are read.\n\
             docs/formats.md has the details.",
            wrong_file::kind(path, Advice::Flags).unwrap_or("an archive of other files")
        ),
        Err(error @ ClipError::Container(ContainerError::CannotUnpack { .. })) => {
            Err(wrong_file::of_clip(path, error, Advice::Flags))
        }
        // Its layout was found.
        Err(error) if !matches!(error, ClipError::UnknownLayout { .. } | ClipError::Container(_)) => {
            bail!("{name} cannot be used as a clip ({}): {error}", error.code())
        }
        Err(error) => bail!(
            "{name} can be used neither as a map ({}): {refused}, nor as a clip ({}): {error}",
            refused.code(),
            error.code()
        ),
    }
}

fn map(arguments: &InspectArguments, map: &LidarMap) -> Result<()> {
    if let Some(picture) = &arguments.picture {
        output::write_bytes(picture, home::lidar_png(map))?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&map.info)?);
        return Ok(());
    }
    print_map(map);
    match &arguments.picture {
        Some(picture) => println!("wrote:  {}", picture.display()),
        None => print!("\n{}", sketch::sketch(map)),
    }
    Ok(())
}

fn print_map(map: &LidarMap) {
    let info = &map.info;
    let [width_m, height_m] = [0, 1].map(|axis| info.max_m[axis] - info.min_m[axis]);
    println!("map:    {}", info.format);
    println!("frame:  {}", info.frame);
    println!("size:   {width_m:.2} x {height_m:.2} m, from {:.2}, {:.2} on", info.min_m[0], info.min_m[1]);
    match info.cell_m {
        Some(cell_m) => println!(
            "cells:  {cell_m} m; {} of walls, {} free, {:.1} m2",
            info.occupied_points, info.free_cells, info.free_area_m2
        ),
        None => println!("points: {}", info.occupied_points),
    }
    for room in &info.rooms {
        let name = room.name.as_deref().unwrap_or("without a name");
        let material = room.material.as_deref().map_or(String::new(), |material| format!(", {material}"));
        println!("room:   {} {name}, {:.1} m2{material}", room.id, room.area_m2);
    }
    if let Some(dock) = &info.charger {
        let facing = if map.unknown_yaw.charger {
            "direction unknown".to_owned()
        } else {
            format!("facing {:.0} deg", dock.yaw_rad.to_degrees())
        };
        println!("dock:   {:.2}, {:.2} m, {facing}", dock.x_m, dock.y_m);
    }
    let marks = info.marks_in_words();
    if !marks.is_empty() {
        println!("marks:  {marks}");
    }
    for note in &info.notes {
        println!("note:   {note}");
    }
    println!("usable: yes, nothing in it was refused");
}

fn clip(arguments: &InspectArguments, clip: &Clip) -> Result<()> {
    if let Some(picture) = &arguments.picture {
        output::write_bytes(picture, home::contact_sheet_png(clip)?)?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(clip.info())?);
        return Ok(());
    }
    print_clip(clip.info());
    if let Some(picture) = &arguments.picture {
        println!("wrote:  {}", picture.display());
    }
    Ok(())
}

fn print_clip(info: &ClipInfo) {
    println!("clip:   {}", info.layout);
    println!("poses:  {}", info.pose_convention);
    println!("up:     {}", info.gravity);
    println!("depth:  {}x{}, {}", info.depth_width, info.depth_height, info.depth_unit);
    println!("colour: {}x{}", info.color_width, info.color_height);
    println!("camera: {}", info.intrinsics);
    println!("frames: {}, {} with a pose", info.frames, info.frames_with_pose);
    if let Some(duration_s) = info.duration_s {
        println!("time:   {duration_s:.1} s");
    }
    for note in &info.notes {
        println!("note:   {note}");
    }
    println!("left out: {}", left_out(info));
}

/// Returns the numbers of the frames that are not used, in words. The frames of a clip without any pose are tracked.
fn left_out(info: &ClipInfo) -> String {
    let without_pose = if info.frames_with_pose > 0 { info.skipped_without_pose } else { 0 };
    let parts =
        [(without_pose, "without a pose"), (info.skipped_incomplete, "without one of their pictures")];
    let parts = parts.iter().filter(|(count, _)| *count > 0);
    let parts: Vec<String> = parts.map(|(count, words)| format!("{count} frames {words}")).collect();
    if parts.is_empty() { "no frame".to_owned() } else { parts.join(", ") }
}
