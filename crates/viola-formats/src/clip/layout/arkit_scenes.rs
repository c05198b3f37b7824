//! ARKitScenes: `lowres_wide/`, `lowres_depth/`, `confidence/` (`<video>_<seconds>.png`),
//! `lowres_wide_intrinsics/` (`.pincam`), `lowres_wide.traj` (apple/ARKitScenes, DATA.md, raw/README.md,
//! threedod/benchmark_scripts).
//!
//! The trajectory holds world-to-camera poses, about ten a second; pictures come up to sixty times a second.

use super::associate::associate;
use super::text::{numbers, parse_row, read_table, rigid};
use super::trajectory::{Timed, nearest, no_pose_near, pose_at, times};
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, Of, Source, only_root, roots_of,
};
use crate::clip::files::names_from;
use crate::container::Container;
use nalgebra::UnitQuaternion;
use viola_geometry::{Pose3, Vector3};

const TRAJECTORY: &str = "lowres_wide.traj";
const MAX_PINCAM_BYTES: u64 = 4 << 10;
/// Colour and depth of one frame have the same time, printed to a millisecond.
const MAX_PAIR_GAP_S: f64 = 0.006;
/// Poses come ten times a second; a frame between two of them is at most this far from either.
const MAX_POSE_GAP_S: f64 = 0.11;
/// Folders of colour: the depth's own size is enough, larger sizes are a fallback.
const COLOR_FOLDERS: [&str; 3] = ["lowres_wide", "vga_wide", "wide"];

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some(root) = only_root(roots_of(container, TRAJECTORY))? else { return Ok(None) };
    let depth = timed_files(container, &format!("{root}lowres_depth/"), "png");
    let confidence = timed_files(container, &format!("{root}confidence/"), "png");
    let color_of = |folder: &&str| timed_files(container, &format!("{root}{folder}/"), "png");
    let (folder, color) = COLOR_FOLDERS
        .iter()
        .map(|folder| (*folder, color_of(folder)))
        .find(|(_, files)| !files.is_empty())
        .unwrap_or((COLOR_FOLDERS[0], Vec::new()));
    let cameras = timed_files(container, &format!("{root}{folder}_intrinsics/"), "pincam");
    if cameras.is_empty() {
        return Err(ClipError::MissingIntrinsics { name: format!("{root}{folder}_intrinsics/*.pincam") });
    }
    let mut notes = vec![format!(
        "{folder} and lowres_depth were paired by time; poses were interpolated between those of {TRAJECTORY}"
    )];
    let poses = read_trajectory(container, &format!("{root}{TRAJECTORY}"), &mut notes)?;

    let (color_s, depth_s) = (times(&color), times(&depth));
    let mut sources = Vec::new();
    for (number, (color_index, depth_index)) in
        associate(&color_s, &depth_s, MAX_PAIR_GAP_S).into_iter().enumerate()
    {
        let time_s = depth_s[depth_index];
        // A frame without its own file takes the one nearest in time: the lens moves little.
        let camera = nearest(&cameras, time_s).map(|camera| camera.value);
        let trust = nearest(&confidence, time_s).filter(|trust| trust.gap_s(time_s) <= MAX_PAIR_GAP_S);
        sources.push(Source {
            number: number as u32,
            time_s: Some(time_s),
            world_from_camera: pose_at(&poses, time_s, MAX_POSE_GAP_S),
            color: ColorAt::File(color[color_index].value.to_string()),
            depth: DepthAt::Png(depth[depth_index].value.to_string()),
            confidence: trust.map(|trust| trust.value.to_string()),
            numbers: camera.map(|name| read_pincam(container, name)).transpose()?,
        });
    }
    let name = cameras[0].value.to_string();
    let numbers = read_pincam(container, &name)?;
    let incomplete = color.len() + depth.len() - 2 * sources.len();
    let no_pose = no_pose_near(TRAJECTORY, &poses, &depth_s, MAX_POSE_GAP_S);
    Ok(Some(Layout {
        no_pose,
        pose_convention: "world-to-camera (axis and angle), OpenCV (x right, y down, z forward)",
        pose_files: TRAJECTORY,
        gravity: "world z is up (rule of the layout)".to_string(),
        up_in_world: Some(Vector3::z()),
        color_pictures: color.len(),
        depth_pictures: depth.len(),
        incomplete,
        intrinsics: format!("{folder}_intrinsics/*.pincam, for each frame; depth is scaled to it"),
        notes,
        ..Layout::new("arkit_scenes", Cameras::One(Intrinsics { name, numbers }), sources)
    }))
}

/// Returns the files `<anything>_<seconds>.<ending>` right under a folder, in the order of their times.
fn timed_files<'a>(container: &'a dyn Container, folder: &str, ending: &str) -> Vec<Timed<&'a str>> {
    let mut files: Vec<Timed<&str>> = names_from(container, folder)
        .filter_map(|name| {
            let (stem, _) = name.rsplit_once('.').filter(|(_, own)| own.eq_ignore_ascii_case(ending))?;
            let time_s: f64 = stem.rsplit(['_', '/']).next()?.parse().ok()?;
            time_s.is_finite().then_some(Timed { time_s, value: name.as_str() })
        })
        .collect();
    files.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    files
}

/// Reads one line: width, height, fx, fy, cx, cy.
fn read_pincam(container: &dyn Container, name: &str) -> Result<Numbers, ClipError> {
    let bytes = container.read(name, MAX_PINCAM_BYTES)?;
    let bad = |reason: &str| ClipError::BadIntrinsics { name: name.to_string(), reason: reason.to_string() };
    let row = numbers(&bytes, 6).ok_or_else(|| bad("expected 6 numbers: width height fx fy cx cy"))?;
    let is_side = |side: f64| side.fract() == 0.0 && (1.0..=65_535.0).contains(&side);
    if !is_side(row[0]) || !is_side(row[1]) {
        return Err(bad("width and height are not those of a picture"));
    }
    let of = Of::Size(row[0] as u32, row[1] as u32);
    Ok(Numbers { fx: row[2], fy: row[3], cx: row[4], cy: row[5], of })
}

/// Reads the poses, inverted to camera-to-world; rows without a finite pose are skipped.
fn read_trajectory(
    container: &dyn Container,
    name: &str,
    notes: &mut Vec<String>,
) -> Result<Vec<Timed<Pose3>>, ClipError> {
    let mut poses = Vec::new();
    read_table(container, name)?.read_rows(notes, |text| {
        let [time_s, rx, ry, rz, tx, ty, tz] =
            parse_row(text).ok_or("expected 7 numbers: time, rotation (axis times angle), translation")?;
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz));
        if let (true, Some(pose)) = (time_s.is_finite(), rigid(rotation, Vector3::new(tx, ty, tz))) {
            poses.push(Timed { time_s, value: pose.inverse() });
        }
        Ok(())
    })?;
    poses.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(poses)
}
