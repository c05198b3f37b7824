//! ScanNet's export: `color/N.jpg`, `depth/N.png`, `pose/N.txt`, `intrinsic/intrinsic_{color,depth}.txt`, or
//! `intrinsics_{color,depth}.txt` in the data set's subset of frames (`scannet_frames_25k`). Conventions as in the ScanNet
//! repository's SensReader.

use super::numbered::{self, Kind, Part};
use super::text::read_intrinsics;
use super::{Cameras, ClipError, Layout, Of, no_pose_without};
use crate::clip::files::find_file;
use crate::container::Container;
use viola_geometry::Vector3;

const POSES: &str = "pose/";
/// The beginnings of the names of both cameras' files; `_color.txt` and `_depth.txt` follow.
const INTRINSICS: [&str; 2] = ["intrinsic/intrinsic", "intrinsics"];

/// Finds the export in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some((root, files)) = numbered::find(container, split)? else { return Ok(None) };
    let (sources, incomplete) = files.sources(container)?;
    let (color_pictures, depth_pictures) = (files.count(Kind::Color), files.count(Kind::Depth));
    let file = |place: &str, camera: &str| {
        let name = format!("{root}{place}_{camera}.txt");
        find_file(container, &name).ok_or(name)
    };
    let place = INTRINSICS.into_iter().find(|place| file(place, "depth").is_ok()).unwrap_or(INTRINSICS[0]);
    let intrinsics_of = |camera: &str, of: Of| {
        let (Ok(name) | Err(name)) = file(place, camera);
        read_intrinsics(container, &name, of)
    };
    let of_depth = || intrinsics_of("depth", Of::Depth);
    let (cameras, intrinsics) = if color_pictures > 0 {
        let words = format!("{place}_color.txt and {place}_depth.txt");
        (Cameras::Each { color: intrinsics_of("color", Of::Color)?, depth: of_depth()? }, words)
    } else {
        (Cameras::One(of_depth()?), format!("{place}_depth.txt"))
    };
    Ok(Some(Layout {
        pose_files: POSES,
        no_pose: (files.count(Kind::Pose) == 0).then(|| no_pose_without(POSES)),
        gravity: "world z is up (rule of the layout)".to_string(),
        up_in_world: Some(Vector3::z()),
        color_pictures,
        depth_pictures,
        incomplete,
        intrinsics,
        ..Layout::new("scannet", cameras, sources)
    }))
}

/// Splits `scene/color/12.jpg` into `scene/`, colour and 12.
fn split(name: &str) -> Option<Part<'_>> {
    let (folder, file) = name.rsplit_once('/')?;
    let (stem, extension) = file.rsplit_once('.')?;
    let kind_name = folder.rsplit('/').next()?;
    let kind = match (kind_name, extension.to_ascii_lowercase().as_str()) {
        ("color", "jpg" | "jpeg" | "png") => Kind::Color,
        ("depth", "png") => Kind::Depth,
        ("pose", "txt") => Kind::Pose,
        _ => return None,
    };
    let root = &folder[..folder.len() - kind_name.len()];
    Some(Part { root, kind, number: numbered::number(stem)? })
}
