//! The layout of 7-Scenes and 3DMatch: `frame-000000.{color.png,depth.png,pose.txt}` in one folder, and
//! `camera-intrinsics.txt` there, or one folder up for several sequences (andyzeng/tsdf-fusion-python,
//! README).

use super::numbered::{self, Kind, Part};
use super::text::read_intrinsics;
use super::{Cameras, ClipError, Layout, Of};
use crate::container::Container;

const INTRINSICS: &str = "camera-intrinsics.txt";

/// Finds the sequence in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some((root, files)) = numbered::find(container, split)? else { return Ok(None) };
    let (sources, incomplete) = files.sources(container)?;
    let parent =
        root.trim_end_matches('/').rsplit_once('/').map_or(String::new(), |(up, _)| format!("{up}/"));
    let beside = format!("{root}{INTRINSICS}");
    let above = format!("{parent}{INTRINSICS}");
    let intrinsics = if !container.contains(&beside) && container.contains(&above) { above } else { beside };
    Ok(Some(Layout {
        pose_files: "frame-*.pose.txt",
        depth_unit: "millimetres (16-bit PNG, 65535 is no reading)",
        color_pictures: files.count(Kind::Color),
        depth_pictures: files.count(Kind::Depth),
        incomplete,
        intrinsics: format!("{INTRINSICS}, for colour and depth"),
        ..Layout::new(
            "seven_scenes",
            Cameras::One(read_intrinsics(container, &intrinsics, Of::Depth)?),
            sources,
        )
    }))
}

/// Splits `seq-01/frame-000012.depth.png` into `seq-01/`, depth and 12.
fn split(name: &str) -> Option<Part<'_>> {
    let (root, file) = name.split_at(name.rfind('/').map_or(0, |slash| slash + 1));
    let (digits, suffix) = file.strip_prefix("frame-")?.split_once('.')?;
    let kind = match suffix {
        "color.png" | "color.jpg" | "color.jpeg" => Kind::Color,
        "depth.png" => Kind::Depth,
        "pose.txt" => Kind::Pose,
        _ => return None,
    };
    Some(Part { root, kind, number: numbered::number(digits)? })
}
