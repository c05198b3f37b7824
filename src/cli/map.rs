//! `viola map`: makes the map of a home out of its clips, without a server.
//!
//! It runs the functions of the service, so that both make the same map: [`align_opened`](crate::jobs::align_opened)
//! for each clip, [`assemble`](viola_home::assemble) for all of them, [`describe`](crate::jobs::describe) for the
//! result. Clips are aligned one after the other and their contributions are kept on the disk, so that the memory
//! of the alignment does not grow with their number.

mod clip;
mod content;
mod contributions;
mod document;
mod earlier;
mod exports;
mod files;
mod robot;
mod table;

use super::args::levels::{self, LevelArgument};
use super::args::{MethodArguments, numbers};
use super::output;
use super::progress::{TerminalProgress, print_line, to_standard_error};
use super::video_tools::video_tools;
use super::wrong_file::Advice;
use crate::api::pretty_json;
use crate::jobs::{JobParams, level_maps};
use anyhow::Result;
use clap::Args;
use clip::{Aligner, HomeClip};
use content::Content;
use contributions::Contributions;
use files::HomeFiles;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viola_geometry::LevelName;
use viola_geometry::progress::Silent;
use viola_home as home;
use viola_home::{Manifest, Member};

/// Exit code if the map was written and a clip has no pose. clap uses 2 for wrong arguments.
const CLIP_WITHOUT_POSE: u8 = 3;

/// The exit codes, for the help.
pub const EXIT_CODES: &str = "Exit codes:
  0  every clip has a pose
  1  there is no map: for example, the LiDAR map cannot be read
  2  wrong arguments
  3  the map was written, and at least one clip could not be read or has no pose; map.json says why";

/// The files of the home.
const HOME_FILES: [&str; 4] = ["map.json", "objects.json", "rooms.json", "matter.json"];
/// The files of each level.
const LEVEL_FILES: [&str; 16] = [
    "points.ply",
    "points.e57",
    "points.laz",
    "plan.svg",
    "plan.png",
    "plan.pdf",
    "plan.dxf",
    "plan.geojson",
    "plan.json",
    "mesh.glb",
    "mesh.usdz",
    "mesh.obj",
    "home.mcap",
    "nav2.zip",
    "valetudo.json",
    "calibration.json",
];

#[derive(Args)]
pub struct MapArguments {
    /// Clips, each as `viola align --clip` takes it: folders, archives or single files, in any order. A clip
    /// that is given twice counts once, even as another archive of the same files.
    #[arg(required = true, value_name = "CLIP")]
    clips: Vec<PathBuf>,
    /// Pass `unknown` if poses and depth of the clips are not in metres: the scale of each clip is found with its pose.
    /// Formats without metres need no flag.
    #[arg(long, value_name = "unknown", value_parser = ["unknown"])]
    scale: Option<String>,
    /// LiDAR map of the home, in any format that `viola align` reads. For a home of several storeys: several
    /// times, as LEVEL=FILE.
    #[arg(long, required = true, value_name = "[LEVEL=]FILE", value_parser = levels::parser())]
    lidar: Vec<LevelArgument>,
    /// Output folder: map.json, objects.json, rooms.json; points.ply, .e57 and .laz; the plan as plan.svg, .png, .pdf,
    /// .dxf, .geojson and .json; the surface as mesh.glb, .usdz and .obj; the recording home.mcap; for robots nav2.zip,
    /// valetudo.json, calibration.json and matter.json. The files of another level than `main` are in a folder of its
    /// name; matter.json has all levels.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    method: MethodArguments,
    /// Seed of the floor's RANSAC and of the inpainting.
    #[arg(long, default_value_t = 0, value_parser = numbers::seed, allow_negative_numbers = true)]
    seed: u64,
    /// Print map.json instead of the table.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &MapArguments) -> Result<ExitCode> {
    let old_levels = earlier::levels_in(&arguments.out);
    refuse_to_overwrite(arguments, &old_levels)?;
    // Before the clips, because a missing network is found immediately.
    let align = arguments.method.own_params(arguments.seed)?;
    let unknown_scale = arguments.scale.is_some();
    let params = JobParams { align, video: video_tools(), unknown_scale, ..JobParams::default() };
    let out = &arguments.out;
    // A folder that has `map.json` is whole, and has the map of the last run.
    output::remove(&out.join("map.json"))?;
    let maps = levels::open(&arguments.lidar, Advice::Arguments)?;
    let valetudo = levels::valetudo_files(&arguments.lidar, &maps)?;
    let levels = level_maps(&maps);
    let _own = output::own_folder(out)?;

    let mut aligner =
        Aligner { levels: &levels, params: &params, contributions: Contributions::new_in(out)? };
    let clips = align_all(&arguments.clips, &mut aligner)?;
    let members: Vec<Member> = clips.iter().filter_map(HomeClip::member).collect();
    print_line(&format!("map: place and fuse the clips; {} of {} have a floor", members.len(), clips.len()));
    let map = home::assemble(&Manifest::default(), members, &mut aligner.contributions, &Silent)?;
    let map = map.label(BTreeMap::new(), params.align.label.surface.as_deref(), &Silent)?;
    print_line(&format!("map: {} of {} clips are in the map", map.manifest.clips.len(), clips.len()));
    print_line("map: describe");
    let paths = aligner.contributions.paths(&map.manifest.clips)?;
    let files = HomeFiles::new(&levels, &valetudo, map, &clips, paths)?;
    for old in old_levels.iter().filter(|old| levels.iter().all(|map| map.level != **old)) {
        earlier::remove_level(out, *old, &LEVEL_FILES)?;
    }
    files.write(out)?;
    if arguments.json {
        println!("{}", String::from_utf8_lossy(&pretty_json(&files.document)));
    } else {
        table::print(&files.document, files.objects.len(), files.rooms.len(), out);
    }
    let all_have_poses = document::all_have_poses(&files.document.clips);
    Ok(if all_have_poses { ExitCode::SUCCESS } else { ExitCode::from(CLIP_WITHOUT_POSE) })
}

/// Refuses an output folder in which the map's files would replace a clip or a LiDAR map, or lie in a clip. The files of
/// earlier levels are removed, so that none of them may be an input, either.
fn refuse_to_overwrite(arguments: &MapArguments, old_levels: &[LevelName]) -> Result<()> {
    let out = &arguments.out;
    let mut outputs = vec![out.clone()];
    outputs.extend(HOME_FILES.map(|name| out.join(name)));
    let levels = arguments.lidar.iter().map(|LevelArgument { level, .. }| *level);
    for level in levels.chain(old_levels.iter().copied()) {
        let folder = earlier::folder_of(out, level);
        outputs.extend(LEVEL_FILES.map(|name| folder.join(name)));
    }
    let mut inputs = levels::files(&arguments.lidar);
    inputs.extend_from_slice(&arguments.clips);
    output::refuse_to_overwrite(&inputs, &outputs, "--out")
}

/// Aligns the clips one by one. Returns them in an order that does not depend on that of the arguments.
fn align_all(paths: &[PathBuf], aligner: &mut Aligner) -> Result<Vec<HomeClip>> {
    let mut clips: Vec<HomeClip> = Vec::new();
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    for (number, path) in (1..).zip(paths) {
        let part = format!("clip {number} of {}", paths.len());
        let file = path.display().to_string();
        print_line(&format!("{part}: {file}"));
        let clip = match aligner.content(path) {
            Ok(content) => {
                let recording = content.recording();
                if let Some(first) = known.get(&recording) {
                    let first = &mut clips[*first];
                    print_line(&format!("{part}: the same recording as {}, used once", first.file));
                    // A damaged archive lists the same files as a whole one.
                    if first.answer.is_err() && first.content.as_ref() != Some(&content) {
                        first.take_answer(align_one(path, content.clone(), part, aligner)?);
                    }
                    first.add_copy(content, file);
                    continue;
                }
                known.insert(recording, clips.len());
                align_one(path, content, part.clone(), aligner)?
            }
            Err(reason) => HomeClip::refused(path, reason),
        };
        if let Err(reason) = &clip.answer {
            to_standard_error(&format!("{part}: failed: {} ({})", reason.detail, reason.code));
        }
        clips.push(clip);
    }
    clips.sort_by(|a, b| (&a.content, &a.file).cmp(&(&b.content, &b.file)));
    Ok(clips)
}

/// Aligns a clip; `part` names it in the progress.
fn align_one(path: &Path, content: Content, part: String, aligner: &mut Aligner) -> Result<HomeClip> {
    let progress = TerminalProgress::of_part(part);
    let clip = aligner.align(path, content, &progress)?;
    progress.finish();
    Ok(clip)
}
