//! The layout of 7-Scenes and 3DMatch: `frame-000000.{color.png,depth.png,pose.txt}` in one folder, and
//! `camera-intrinsics.txt` there, or one folder up for several sequences (andyzeng/tsdf-fusion-python,
//! README). BundleFusion's recordings and 12-Scenes have `info.txt` instead, with the header of a `.sens` file as text. The
//! archives of 7-Scenes have no intrinsics.

use super::numbered::{self, Kind, Part};
use super::text::{all_numbers, read_intrinsics, read_possible_table};
use super::tum::is_not_of_kinect;
use super::{Cameras, ClipError, DepthAt, Intrinsics, Layout, Numbers, Of, Source, no_pose_without};
use crate::clip::files::find_file;
use crate::container::Container;

const INTRINSICS: &str = "camera-intrinsics.txt";
const INFOS: [&str; 2] = ["info.txt", "_info.txt"];
const POSES: &str = "frame-*.pose.txt";
/// The depth camera on the page of 7-Scenes.
const DEPTH_CAMERA: Numbers = Numbers { fx: 585.0, fy: 585.0, cx: 320.0, cy: 240.0, of: Of::Size(640, 480) };

/// Finds the sequence in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some((root, files)) = numbered::find(container, split)? else { return Ok(None) };
    let (sources, incomplete) = files.sources(container)?;
    let parent =
        root.trim_end_matches('/').rsplit_once('/').map_or(String::new(), |(up, _)| format!("{up}/"));
    let mut notes = Vec::new();
    let (cameras, intrinsics) = cameras(container, [root, &parent], sources.first(), &mut notes)?;
    Ok(Some(Layout {
        pose_files: POSES,
        no_pose: (files.count(Kind::Pose) == 0).then(|| no_pose_without(POSES)),
        depth_unit: "millimetres (16-bit PNG, 65535 is no reading)",
        color_pictures: files.count(Kind::Color),
        depth_pictures: files.count(Kind::Depth),
        incomplete,
        intrinsics,
        notes,
        ..Layout::new("seven_scenes", cameras, sources)
    }))
}

/// Returns the cameras of the first of the folders that has their file, or the one of 7-Scenes, and their source in words.
fn cameras(
    container: &dyn Container,
    folders: [&str; 2],
    first: Option<&Source>,
    notes: &mut Vec<String>,
) -> Result<(Cameras, String), ClipError> {
    let names = folders.map(|folder| format!("{folder}{INTRINSICS}"));
    if let Some(name) = names.iter().find_map(|name| find_file(container, name)) {
        let words = format!("{INTRINSICS}, for colour and depth");
        return Ok((Cameras::One(read_intrinsics(container, &name, Of::Depth)?), words));
    }
    let infos = folders.iter().flat_map(|folder| INFOS.map(|file| format!("{folder}{file}")));
    for name in infos.filter(|name| container.contains(name)) {
        if let Some(cameras) = cameras_of_info(container, &name)? {
            return Ok((cameras, format!("{name}, for colour and for depth")));
        }
    }
    let depth = first.map(|source| &source.depth);
    if matches!(depth, Some(DepthAt::Png(name)) if is_not_of_kinect(container, name)) {
        let [name, _] = names;
        return Err(ClipError::MissingIntrinsics { name });
    }
    notes.push(format!("there is no {INTRINSICS}; the depth camera of 7-Scenes was assumed"));
    let words = "assumed: fx = fy = 585, cx = 320, cy = 240 for 640x480, scaled to the pictures".to_string();
    let assumed = Intrinsics { name: format!("{INTRINSICS} (assumed)"), numbers: DEPTH_CAMERA };
    Ok((Cameras::One(assumed), words))
}

/// Returns the cameras of a file with the rows `m_depthWidth = 640`, `m_calibrationDepthIntrinsic = 572 0 320 0 0 572 240 ...` and
/// others; `None` if it is another program's.
fn cameras_of_info(container: &dyn Container, name: &str) -> Result<Option<Cameras>, ClipError> {
    let Some(table) = read_possible_table(container, name)? else { return Ok(None) };
    let numbers_of = |key: &str| {
        let mut members = table.rows().filter_map(|(_, row)| row.split_once('='));
        let (_, numbers) = members.find(|(own, _)| own.trim() == key)?;
        all_numbers(numbers)
    };
    let camera = |kind: &str| {
        let matrix = numbers_of(&format!("m_calibration{kind}Intrinsic"))?;
        let &[fx, _, cx, _, _, fy, cy, ..] = matrix.as_slice() else { return None };
        let side = |side: &str| {
            let sides = numbers_of(&format!("m_{}{side}", kind.to_lowercase()))?;
            sides.first().filter(|side| (1.0..=65_535.0).contains(*side)).map(|side| *side as u32)
        };
        let of = Of::Size(side("Width")?, side("Height")?);
        Some(Intrinsics { name: name.to_string(), numbers: Numbers { fx, fy, cx, cy, of } })
    };
    Ok(camera("Color").zip(camera("Depth")).map(|(color, depth)| Cameras::Each { color, depth }))
}

/// Splits `seq-01/frame-000012.depth.png` into `seq-01/`, depth and 12.
fn split(name: &str) -> Option<Part<'_>> {
    let (root, file) = name.split_at(name.rfind('/').map_or(0, |slash| slash + 1));
    let (digits, suffix) = file.strip_prefix("frame-")?.split_once('.')?;
    let kind = match suffix.to_ascii_lowercase().as_str() {
        "color.png" | "color.jpg" | "color.jpeg" => Kind::Color,
        "depth.png" => Kind::Depth,
        "pose.txt" => Kind::Pose,
        _ => return None,
    };
    Some(Part { root, kind, number: numbered::number(digits)? })
}
