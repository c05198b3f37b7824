//! `viola align`: aligns one clip to one map, without a server.

use super::args::levels::{self, LevelArgument};
use super::args::{MethodArguments, numbers};
use super::output;
use super::progress::TerminalProgress;
use super::video_tools::video_tools;
use super::wrong_file::{self, Advice};
use crate::jobs::level_maps;
use anyhow::{Context, Result, bail};
use clap::Args;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viola_align as align;
use viola_align::Alignment;
use viola_formats::clip::{Clip, ClipInfo};
use viola_formats::lidar::LidarInfo;
use viola_geometry::LevelName;
use viola_geometry::progress::{Progress, Stage};
use viola_geometry::stopwatch::Stopwatch;
use viola_home as home;
use viola_storage::ClipState;

#[derive(Args)]
pub struct AlignArguments {
    /// Clip: a folder, an archive (zip, tar, tar.gz, tar.zst) or a single file (.r3d, .sens, .db, .mcap, .db3),
    /// exported by Stray Scanner, Record3D, Polycam, 3D Scanner App, Spectacular AI, NeRFCapture or RTAB-Map,
    /// a ROS 2 bag, points (PLY) with a path, or in the layout of ScanNet, ARKitScenes, 7-Scenes, TUM RGB-D, Redwood,
    /// Nerfstudio or COLMAP.
    #[arg(long)]
    clip: PathBuf,
    /// Numbers of the frames to use, for example 120..180; END is excluded. Default: all frames.
    #[arg(long, value_name = "FIRST..END", value_parser = range::<u32>)]
    frames: Option<Range<u32>>,
    /// Pass `unknown` if poses and depth of the clip are not in metres: the scale is found with the pose.
    #[arg(long, value_name = "unknown", value_parser = ["unknown"])]
    scale: Option<String>,
    /// LiDAR map: Valetudo (JSON or PNG), the file of a Roborock, Dreame or Viomi robot, a ROS map_server
    /// YAML or a zip of it and its image, a CARMEN log, or points as CSV, PLY or PCD. For a home of several
    /// storeys: several times, as LEVEL=FILE.
    #[arg(long, required = true, value_name = "[LEVEL=]FILE", value_parser = levels::parser())]
    lidar: Vec<LevelArgument>,
    /// Output folder: result.json, inputs.json, overlay.png, cloud.ply and, after a completion, completion/.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    method: MethodArguments,
    /// Seed of the floor's RANSAC and of the inpainting.
    #[arg(long, default_value_t = 0, value_parser = numbers::seed, allow_negative_numbers = true)]
    seed: u64,
    /// Print result.json instead of the summary.
    #[arg(long)]
    json: bool,
}

/// Exit code if no pose can be given. clap uses 2 for wrong arguments.
const NO_POSE: u8 = 3;

/// The exit codes, for the help.
pub const EXIT_CODES: &str = "Exit codes:
  0  the answer has a pose: `aligned`, or `ambiguous` with alternatives
  1  there is no answer: for example, the clip or the LiDAR map cannot be read
  2  wrong arguments
  3  the answer is `failed`: no pose can be given; result.json says why";

/// The files of the answer, apart from the pictures of the completion.
const FILES: [&str; 4] = ["result.json", "inputs.json", "overlay.png", "cloud.ply"];
/// Folder of the completion's pictures.
const COMPLETION: &str = "completion";

/// Contents of `inputs.json`: the summaries of the input files.
#[derive(Serialize)]
struct Inputs<'a> {
    clip: &'a ClipInfo,
    /// The map of the answer's level.
    lidar: &'a LidarInfo,
    levels: BTreeMap<LevelName, &'a LidarInfo>,
}

pub fn run(arguments: &AlignArguments) -> Result<ExitCode> {
    refuse_to_overwrite(arguments)?;
    // Before the clip, because a missing network is found immediately.
    let params = arguments.method.own_params(arguments.seed)?;
    // A folder that has `result.json` is whole, and has the answer of the last run.
    output::remove(&arguments.out.join("result.json"))?;
    let progress = TerminalProgress::new();
    let watch = Stopwatch::around(&progress, std::time::Instant::now)
        .with_budget(Stage::Complete, params.complete.time);
    watch.enter(Stage::Decode);
    // Before the clip, which may have to be unpacked.
    let maps = levels::open(&arguments.lidar, Advice::Flags)?;
    let clip = Clip::open_with(&arguments.clip, &video_tools())
        .map_err(|error| wrong_file::of_clip(&arguments.clip, error, Advice::Flags))?;
    let clip = if arguments.scale.is_some() { clip.with_unknown_scale() } else { clip };
    let frames = arguments.frames.as_ref().map(|range| used_frames(&clip, range)).transpose();
    let frames = frames.with_context(|| format!("clip {}", arguments.clip.display()))?;
    let _own = output::own_folder(&arguments.out)?;
    let mut aligned =
        align::align_levels(&clip, arguments.frames.clone(), &level_maps(&maps), &params, &watch)
            .with_context(|| format!("clip {}", arguments.clip.display()))?;

    watch.enter(Stage::Report);
    let lidar = levels::of_level(&maps, aligned.alignment.level)?;
    let write = |name: &str, bytes: &[u8]| output::write_bytes(&arguments.out.join(name), bytes);
    write("overlay.png", &home::overlay_png(lidar, &aligned))?;
    write("cloud.ply", &home::cloud_ply(&aligned.cloud_in_clip, aligned.alignment.map_from_clip.as_ref()))?;
    let pictures = home::completion_pngs(&aligned);
    let folder = arguments.out.join(COMPLETION);
    remove_pictures(&folder).with_context(|| format!("cannot remove pictures of {}", folder.display()))?;
    if !pictures.is_empty() {
        output::folder(&folder)?;
        for (name, bytes) in &pictures {
            write(&format!("{COMPLETION}/{name}"), bytes)?;
        }
    }
    let of_levels = maps.iter().map(|(level, lidar)| (*level, &lidar.info)).collect();
    let inputs = Inputs { clip: clip.info(), lidar: &lidar.info, levels: of_levels };
    write("inputs.json", &serde_json::to_vec_pretty(&inputs)?)?;
    aligned.alignment.seconds = watch.stop();
    write("result.json", &serde_json::to_vec_pretty(&aligned.alignment)?)?;
    progress.finish();
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&aligned.alignment)?);
    } else {
        print_answer((clip.info(), frames), &lidar.info, &aligned.alignment, &arguments.out);
    }
    let has_pose = aligned.alignment.map_from_clip.is_some();
    Ok(if has_pose { ExitCode::SUCCESS } else { ExitCode::from(NO_POSE) })
}

/// Refuses an output folder in which the answer would replace or remove the clip or a LiDAR map, or lie in the clip.
fn refuse_to_overwrite(arguments: &AlignArguments) -> Result<()> {
    let out = &arguments.out;
    let completion = out.join(COMPLETION);
    let pictures = earlier_pictures(&completion)
        .with_context(|| format!("cannot read the folder {}", completion.display()))?;
    let mut outputs = vec![out.clone(), completion.clone()];
    outputs.extend(FILES.map(|name| out.join(name)));
    outputs.extend(pictures.iter().map(|name| completion.join(name)));
    let mut inputs = levels::files(&arguments.lidar);
    inputs.push(arguments.clip.clone());
    output::refuse_to_overwrite(&inputs, &outputs, "--out")
}

/// Returns the number of the clip's frames in a range; fails if there is none.
fn used_frames(clip: &Clip, range: &Range<u32>) -> Result<usize> {
    let numbers = || clip.frames().iter().map(|frame| frame.number);
    let used = numbers().filter(|number| range.contains(number)).count();
    if used == 0 {
        let (first, last) = (numbers().min().unwrap_or_default(), numbers().max().unwrap_or_default());
        bail!(
            "no frame has a number in --frames {}..{}; its frames have the numbers {first} to {last}",
            range.start,
            range.end
        );
    }
    Ok(used)
}

/// Prints the answer. `frames` is the number of frames that `--frames` chose.
fn print_answer(
    (clip, frames): (&ClipInfo, Option<usize>),
    lidar: &LidarInfo,
    alignment: &Alignment,
    out: &Path,
) {
    let up = if clip.gravity == "unknown" { "up unknown" } else { &clip.gravity };
    println!("clip:   {}, {} frames, {up}", clip.layout, clip.frames);
    if let Some(used) = frames {
        println!("frames: {used} of {} used", clip.frames);
    }
    if !alignment.level.is_main() {
        println!("level:  {}", alignment.level);
    }
    println!(
        "map:    {}, {} occupied points, {} rooms",
        lidar.format,
        lidar.occupied_points,
        lidar.rooms.len()
    );
    let state = ClipState::from(alignment.state).name();
    match &alignment.map_from_clip {
        Some(pose) => println!(
            "pose:   {state}, x {:.3} m, y {:.3} m, yaw {:.2} deg",
            pose.x_m,
            pose.y_m,
            pose.yaw_rad.to_degrees()
        ),
        None => println!("pose:   {state}"),
    }
    if let Some(probability) = alignment.probability {
        println!("sure:   probability {probability:.3}{}", rivals(alignment));
    }
    if let (Some(scale), Some(std)) = (alignment.scale, alignment.scale_std) {
        println!("scale:  {scale:.4} m per unit of depth, standard deviation {std:.4}");
    }
    if let Some(labels) = &alignment.labels {
        match labels.key_frames {
            0 => println!("labels: by {}", labels.by),
            pictures => println!("labels: by {}; {pictures} pictures", labels.by),
        }
    }
    for reason in &alignment.reasons {
        println!("reason: {} ({})", reason.detail, reason.code);
    }
    let total: f64 = alignment.seconds.values().sum();
    println!("time:   {total:.2} s");
    println!("wrote:  {}", out.display());
}

/// Returns the number of the other explanations, and the probability of the likeliest.
fn rivals(alignment: &Alignment) -> String {
    let others: Vec<f64> = alignment.alternatives.iter().skip(1).filter_map(|one| one.probability).collect();
    let Some(likeliest) = others.iter().copied().reduce(f64::max) else { return String::new() };
    let poses = if others.len() == 1 { "pose" } else { "poses" };
    format!("; {} other {poses} in result.json, the likeliest with {likeliest:.3}", others.len())
}

/// Parses a range such as `120..180`, whose end is excluded.
pub(super) fn range<T: std::str::FromStr + PartialOrd>(text: &str) -> Result<Range<T>, String> {
    let form = || format!("'{text}' is not of the form FIRST..END, for example 120..180");
    let (first, end) = text.split_once("..").ok_or_else(form)?;
    let (first, end): (T, T) = (first.parse().map_err(|_| form())?, end.parse().map_err(|_| form())?);
    if first < end { Ok(first..end) } else { Err(format!("'{text}' is empty: END must be above FIRST")) }
}

/// Returns the names of the completion's pictures of an earlier answer.
fn earlier_pictures(folder: &Path) -> std::io::Result<Vec<OsString>> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(Vec::new()) };
    let mut pictures = Vec::new();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name == "sheet.png"
            || (["plan_", "view_"].iter().any(|kind| name.starts_with(kind)) && name.ends_with(".png"))
        {
            pictures.push(entry.file_name());
        }
    }
    Ok(pictures)
}

/// Removes the completion's pictures of an earlier answer.
fn remove_pictures(folder: &Path) -> std::io::Result<()> {
    for name in earlier_pictures(folder)? {
        std::fs::remove_file(folder.join(name))?;
    }
    // A folder with other files stays.
    let _ = std::fs::remove_dir(folder);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::range;

    #[test]
    fn ranges() {
        assert_eq!(range::<u32>("120..180"), Ok(120..180));
        for bad in ["", "120", "5..5", "9..3", "a..b", "1..2..3", "-1..4", "1..99999999999"] {
            assert!(range::<u32>(bad).is_err(), "{bad}");
        }
    }
}
