//! The layout of 7-Scenes and 3DMatch: `frame-000000.{color.png,depth.png,pose.txt}` in one folder, and
//! `camera-intrinsics.txt` there, or one folder up for several sequences (andyzeng/tsdf-fusion-python,
//! README). The archives of 7-Scenes have no intrinsics.

use super::numbered::{self, Kind, Part};
use super::text::read_intrinsics;
use super::tum::is_not_of_kinect;
use super::{Cameras, ClipError, DepthAt, Intrinsics, Layout, Numbers, Of, Source, no_pose_without};
use crate::clip::files::find_file;
use crate::container::Container;

const INTRINSICS: &str = "camera-intrinsics.txt";
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
    let (camera, intrinsics) = camera(container, [root, &parent], sources.first(), &mut notes)?;
    Ok(Some(Layout {
        pose_files: POSES,
        no_pose: (files.count(Kind::Pose) == 0).then(|| no_pose_without(POSES)),
        depth_unit: "millimetres (16-bit PNG, 65535 is no reading)",
        color_pictures: files.count(Kind::Color),
        depth_pictures: files.count(Kind::Depth),
        incomplete,
        intrinsics,
        notes,
        ..Layout::new("seven_scenes", Cameras::One(camera), sources)
    }))
}

/// Returns the camera of the first of the folders that has its file, or the one of 7-Scenes, and its source in words.
fn camera(
    container: &dyn Container,
    folders: [&str; 2],
    first: Option<&Source>,
    notes: &mut Vec<String>,
) -> Result<(Intrinsics, String), ClipError> {
    let names = folders.map(|folder| format!("{folder}{INTRINSICS}"));
    if let Some(name) = names.iter().find_map(|name| find_file(container, name)) {
        let words = format!("{INTRINSICS}, for colour and depth");
        return Ok((read_intrinsics(container, &name, Of::Depth)?, words));
    }
    let depth = first.map(|source| &source.depth);
    if matches!(depth, Some(DepthAt::Png(name)) if is_not_of_kinect(container, name)) {
        let [name, _] = names;
        return Err(ClipError::MissingIntrinsics { name });
    }
    notes.push(format!("there is no {INTRINSICS}; the depth camera of 7-Scenes was assumed"));
    let words = "assumed: fx = fy = 585, cx = 320, cy = 240 for 640x480, scaled to the pictures".to_string();
    Ok((Intrinsics { name: format!("{INTRINSICS} (assumed)"), numbers: DEPTH_CAMERA }, words))
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
