//! Redwood and Open3D: numbered pictures in two folders, and a trajectory of five lines per pose
//! (redwood-data.org/indoor/fileformat.html; isl-org/Open3D, FileLOG.cpp).

use super::json::read_json;
use super::numbered::{number, numbered_under};
use super::text::{numbers, pose_from_rows, read_table};
use super::tum::KINECT;
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source, incomplete, only_root,
};
use crate::container::Container;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use viola_geometry::Pose3;

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
    let is_log = |name: &&String| name.ends_with(".log") || name.ends_with("-traj.txt");
    let logs: Vec<&String> = container.names().iter().filter(is_log).collect();
    // If the trajectory is missing or damaged, Open3D's camera file beside the pictures or the trajectory's
    // name identifies the layout, unless there are poses of another layout.
    let is_told = |root: &str| {
        let has = |file: &str| container.contains(&format!("{root}{file}"));
        let poses = format!("{root}pose/");
        let has_poses = has("rgb.txt") || container.names().iter().any(|name| name.starts_with(&poses));
        !has_poses && (INTRINSICS.into_iter().any(has) || logs.iter().any(|log| log.ends_with("-traj.txt")))
    };
    let roots_of = |kinds: &'static [&str]| {
        container.names().iter().filter_map(move |name| {
            let (folder, file) = name.rsplit_once('/')?;
            let root = kinds.iter().find_map(|kind| folder.strip_suffix(kind))?;
            (picture(file).is_some() && (root.is_empty() || root.ends_with('/'))).then_some(root)
        })
    };
    // Without any depth, the colour folders give the root, so that the recording gets an exact error.
    let roots: Vec<&str> = match roots_of(&["depth"]).collect::<Vec<_>>() {
        roots if roots.is_empty() => roots_of(&COLOR_FOLDERS).collect(),
        roots => roots,
    };
    let found = trajectories(container, &logs)?;
    let root = match only_root(roots.into_iter()) {
        Ok(Some(root)) if !found.is_empty() || is_told(root) => root,
        Err(error) if !found.is_empty() => return Err(error),
        _ => return Ok(None),
    };
    if let (true, Some(name)) = (found.is_empty(), logs.first()) {
        return Err(bad(name, 1, "expected 3 whole numbers, and four rows of a pose behind them"));
    }
    let (log, poses) = beside(root, found)?;

    let pictures = |folder: &str| numbered_under(container, &format!("{root}{folder}/"), picture);
    let depth = pictures("depth")?;
    let mut color = BTreeMap::new();
    for folder in COLOR_FOLDERS {
        color = pictures(folder)?;
        if !color.is_empty() {
            break;
        }
    }
    // The trajectory counts frames from 1; pictures are numbered from 0 or from 1.
    let first = depth.keys().next().copied().unwrap_or(0);
    let mut sources = Vec::new();
    for (&number, &depth) in &depth {
        let color = match color.get(&number) {
            Some(name) => ColorAt::File(name.to_string()),
            None if color.is_empty() => ColorAt::Absent,
            None => continue,
        };
        sources.push(Source {
            number,
            time_s: None,
            world_from_camera: (number - first).checked_add(1).and_then(|n| *poses.get(&n)?),
            color,
            depth: DepthAt::Png(depth.to_string()),
            confidence: None,
            numbers: None,
        });
    }
    let incomplete = incomplete(color.len(), depth.len(), sources.len());
    let mut notes = vec![format!(
        "poses are those of {log}, whose frame 1 was taken for the picture with the lowest number, {first}"
    )];
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

type Poses = BTreeMap<u32, Option<Pose3>>;

/// Returns the logs that are trajectories; logs of programs are skipped.
fn trajectories<'a>(
    container: &dyn Container,
    logs: &[&'a String],
) -> Result<Vec<(&'a str, Poses)>, ClipError> {
    let mut found = Vec::new();
    for name in logs {
        if let Some(poses) = read_log(container, name)? {
            found.push((name.as_str(), poses));
        }
    }
    Ok(found)
}

/// Returns the trajectory. One beside the pictures is preferred; several candidates are an error.
fn beside<'a>(root: &str, found: Vec<(&'a str, Poses)>) -> Result<(&'a str, Poses), ClipError> {
    let (beside, elsewhere): (Vec<_>, Vec<_>) =
        found.into_iter().partition(|(name, _)| name.starts_with(root));
    let mut candidates = if beside.is_empty() { elsewhere } else { beside };
    if let [(first, _), (second, _), ..] = candidates.as_slice() {
        return Err(ClipError::SeveralTrajectories { first: first.to_string(), second: second.to_string() });
    }
    Ok(candidates.pop().unwrap_or_default())
}

/// Returns the camera of Open3D's file, or Open3D's default, and its source in words.
fn camera(
    container: &dyn Container,
    root: &str,
    notes: &mut Vec<String>,
) -> Result<(Intrinsics, String, f32), ClipError> {
    let file = INTRINSICS.iter().map(|file| format!("{root}{file}")).find(|name| container.contains(name));
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

/// Returns the number of a picture: `000012.png`, or `0000012-000000400000.png` with microseconds.
fn picture(file: &str) -> Option<u32> {
    let (stem, "png" | "jpg" | "jpeg") = file.rsplit_once('.')? else { return None };
    number(stem.split_once('-').map_or(stem, |(number, _)| number))
}

/// Returns the poses by frame number, from 1, or `None` for another kind of file. Bad poses are `None`.
fn read_log(container: &dyn Container, name: &str) -> Result<Option<Poses>, ClipError> {
    let Ok(table) = read_table(container, name) else { return Ok(None) };
    let mut rows = table.rows();
    let mut poses = BTreeMap::new();
    while let Some((line, head)) = rows.next() {
        let Some(head) = numbers(head.as_bytes(), 3) else {
            // A bad first line means another kind of file; a bad later line means damage.
            return if poses.is_empty() {
                Ok(None)
            } else {
                Err(bad(name, line, "expected 3 whole numbers"))
            };
        };
        let mut matrix = Vec::with_capacity(16);
        for _ in 0..4 {
            let Some((line, row)) = rows.next() else {
                return Err(bad(name, line, "the pose ends before its four rows"));
            };
            let row = numbers(row.as_bytes(), 4).ok_or_else(|| bad(name, line, "expected 4 numbers"))?;
            matrix.extend(row);
        }
        let is_number = head[2].fract() == 0.0 && (1.0..=4e9).contains(&head[2]);
        if !is_number {
            return Err(bad(name, line, "the third number is the frame's, counted from 1"));
        }
        poses.insert(head[2] as u32, pose_from_rows(&matrix));
    }
    Ok((!poses.is_empty()).then_some(poses))
}

fn bad(name: &str, line: usize, reason: &str) -> ClipError {
    ClipError::BadIndex { name: name.to_string(), line, reason: reason.to_string() }
}
