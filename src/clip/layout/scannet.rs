//! ScanNet's export: `color/N.jpg`, `depth/N.png`, `pose/N.txt`, `intrinsic/intrinsic_{color,depth}.txt`.
//! Conventions as in the ScanNet repository's SensReader.

use super::inertial::Forces;
use super::numbered::{self, Kind, Part};
use super::text::read_intrinsics;
use super::{Cameras, ClipError, Layout, MILLIMETRES, OPENCV, Of};
use crate::container::Container;
use crate::geometry::Vector3;

/// Finds the export in a container; none when there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some((root, files)) = numbered::find(container, split)? else { return Ok(None) };
    let (sources, incomplete) = files.sources(container)?;
    let cameras = Cameras::Each {
        color: read_intrinsics(container, &format!("{root}intrinsic/intrinsic_color.txt"), Of::Color)?,
        depth: read_intrinsics(container, &format!("{root}intrinsic/intrinsic_depth.txt"), Of::Depth)?,
    };
    Ok(Some(Layout {
        name: "scannet",
        pose_convention: OPENCV,
        pose_files: "pose/",
        depth_unit: MILLIMETRES,
        depth_units_per_m: 1000.0,
        gravity: "world z is up (layout)".to_string(),
        up_in_world: Some(Vector3::z()),
        forces: Forces::default(),
        color_pictures: files.count(Kind::Color),
        depth_pictures: files.count(Kind::Depth),
        shutter: None,
        incomplete,
        cameras,
        intrinsics: "intrinsic/intrinsic_color.txt and intrinsic/intrinsic_depth.txt".to_string(),
        sources,
        region: None,
        video: None,
        notes: Vec::new(),
    }))
}

/// Splits `scene/color/12.jpg` into `scene/`, colour and 12.
fn split(name: &str) -> Option<Part<'_>> {
    let (folder, file) = name.rsplit_once('/')?;
    let (stem, extension) = file.rsplit_once('.')?;
    let kind_name = folder.rsplit('/').next()?;
    let kind = match (kind_name, extension) {
        ("color", "jpg" | "jpeg" | "png") => Kind::Color,
        ("depth", "png") => Kind::Depth,
        ("pose", "txt") => Kind::Pose,
        _ => return None,
    };
    let root = &folder[..folder.len() - kind_name.len()];
    Some(Part { root, kind, number: numbered::number(stem)? })
}
