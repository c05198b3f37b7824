//! Redwood and Open3D: numbered pictures in two folders, and a trajectory of five lines per pose
//! (redwood-data.org/indoor/fileformat.html; isl-org/Open3D, FileLOG.cpp).

mod log;

use super::json::read_json;
use super::numbered::{PICTURES, color_at, number, numbered_under};
use super::tum::KINECT;
use super::{Cameras, ClipError, DepthAt, Intrinsics, Layout, Numbers, Of, Source, incomplete, only_root};
use crate::clip::files::{find_file, has_ending};
use crate::container::Container;
use log::{Log, Poses};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

const COLOR_FOLDERS: [&str; 4] = ["color", "image", "rgb", "images"];
const INTRINSICS: [&str; 3] = ["camera_intrinsic.json", "intrinsic.json", "camera_primesense.json"];
/// Millimetres, if the file of the camera does not say otherwise.
const UNITS_PER_M: f64 = 1000.0;
const POSSIBLE_UNITS_PER_M: RangeInclusive<f64> = 100.0..=100_000.0;
const MAX_INTRINSICS_BYTES: u64 = 4 << 10;

/// Open3D's camera in its JSON form.
#[derive(Deserialize)]
struct CameraFile {
    width: u32,
    height: u32,
    /// 3x3, column-major.
    intrinsic_matrix: [f64; 9],
    /// Depth units per metre, in files of Open3D's recordings.
    depth_scale: Option<f64>,
}

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let is_log = |name: &&String| has_ending(name, ".log") || has_ending(name, "-traj.txt");
    let logs: Vec<&String> = container.names().iter().filter(is_log).collect();
    // If the trajectory is missing or damaged, Open3D's camera file beside the pictures or the trajectory's
    // name identifies the layout, unless there are poses of another layout.
    let is_told = |root: &str| {
        let has = |file: &str| find_file(container, &format!("{root}{file}")).is_some();
        let poses = format!("{root}pose/");
        let has_poses = has("rgb.txt") || container.names().iter().any(|name| name.starts_with(&poses));
        !has_poses && (INTRINSICS.into_iter().any(has) || logs.iter().any(|log| has_ending(log, "-traj.txt")))
    };
    let roots_of = |kinds: &'static [&str]| {
        container.names().iter().filter_map(move |name| {
            let (folder, file) = name.rsplit_once('/')?;
            let root = kinds.iter().find_map(|kind| folder.strip_suffix(kind))?;
            (picture(&file.to_ascii_lowercase()).is_some() && (root.is_empty() || root.ends_with('/')))
                .then_some(root)
        })
    };
    // Without any depth, the colour folders give the root, so that the recording gets an exact error.
    let roots: Vec<&str> = match roots_of(&["depth"]).collect::<Vec<_>>() {
        roots if roots.is_empty() => roots_of(&COLOR_FOLDERS).collect(),
        roots => roots,
    };
    let (root, log) = match only_root(roots.into_iter()) {
        Ok(Some(root)) => (root, Log::of(container, root, &logs)?),
        Err(error) if Log::is_any(container, &logs)? => return Err(error),
        _ => return Ok(None),
    };
    if log.is_none() && !is_told(root) {
        return Ok(None);
    }
    if let (None, Some(name)) = (&log, logs.first()) {
        let reason = "expected 3 whole numbers, and four rows of a pose behind them".to_string();
        return Err(ClipError::BadIndex { name: name.to_string(), line: 1, reason });
    }

    let pictures = |folder: &str| numbered_under(container, &format!("{root}{folder}/"), picture);
    let depth = pictures("depth")?;
    let mut color = BTreeMap::new();
    for folder in COLOR_FOLDERS {
        color = if color.is_empty() { pictures(folder)? } else { color };
    }
    let numbers: BTreeSet<u32> = depth.keys().chain(color.keys()).copied().collect();
    let (poses, mut notes) = match log {
        Some(log) => log.by_picture(&numbers)?,
        None => (Poses::new(), Vec::new()),
    };
    let mut sources = Vec::new();
    for (&number, &depth) in &depth {
        let Some(color) = color_at(&color, number) else { continue };
        sources.push(Source {
            world_from_camera: poses.get(&number).copied().flatten(),
            ..Source::new(number, color, DepthAt::Png(depth.to_string()))
        });
    }
    let incomplete = incomplete(color.len(), depth.len(), sources.len());
    let (camera, words, depth_units_per_m) = camera(container, root, &mut notes)?;
    Ok(Some(Layout {
        pose_files: "the trajectory (.log)",
        color_pictures: color.len(),
        depth_pictures: depth.len(),
        incomplete,
        intrinsics: words,
        depth_units_per_m,
        notes,
        ..Layout::new("redwood", Cameras::One(camera), sources)
    }))
}

/// Returns the camera of Open3D's file, or Open3D's default, and its source in words.
fn camera(
    container: &dyn Container,
    root: &str,
    notes: &mut Vec<String>,
) -> Result<(Intrinsics, String, f32), ClipError> {
    let file = INTRINSICS.iter().find_map(|file| find_file(container, &format!("{root}{file}")));
    Ok(match file {
        Some(name) => {
            let file: CameraFile = read_json(container, &name, MAX_INTRINSICS_BYTES)?;
            let [fx, _, _, _, fy, _, cx, cy, _] = file.intrinsic_matrix;
            let numbers = Numbers { fx, fy, cx, cy, of: Of::Size(file.width, file.height) };
            let words = format!("{}, for colour and depth", name.rsplit('/').next().unwrap_or_default());
            let units_per_m = file.depth_scale.unwrap_or(UNITS_PER_M);
            if !POSSIBLE_UNITS_PER_M.contains(&units_per_m) {
                let reason =
                    format!("depth_scale {units_per_m} cannot be the number of depth units per metre");
                return Err(ClipError::NotMetric { name, reason });
            }
            (Intrinsics { name, numbers }, words, units_per_m as f32)
        }
        None => {
            notes.push(format!(
                "there is no {}; the calibration that Open3D assumes for a PrimeSense camera was assumed",
                INTRINSICS[0]
            ));
            let words = "assumed: fx = fy = 525, cx = 319.5, cy = 239.5 for 640x480, scaled to the pictures";
            (
                Intrinsics { name: format!("{} (assumed)", INTRINSICS[0]), numbers: KINECT },
                words.to_string(),
                UNITS_PER_M as f32,
            )
        }
    })
}

/// Returns the number of a picture by its name in lower case: `000012.png`, or `0000012-000000400000.png` with microseconds.
fn picture(file: &str) -> Option<u32> {
    let (stem, _) = file.rsplit_once('.').filter(|(_, ending)| PICTURES.contains(ending))?;
    number(stem.split_once('-').map_or(stem, |(number, _)| number))
}
