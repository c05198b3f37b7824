//! ScanNet's export: `color/N.jpg`, `depth/N.png`, `pose/N.txt`, `intrinsic/intrinsic_{color,depth}.txt`.
//! Conventions as in the ScanNet repository's SensReader.

use super::assemble::{Layout, Source, only_root};
use super::text::{read_intrinsics, read_pose};
use super::{ClipError, DepthScale};
use crate::container::Container;
use crate::geometry::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// The files of one export by kind and frame number.
#[derive(Default)]
struct Files<'a> {
    color: BTreeMap<u32, &'a str>,
    depth: BTreeMap<u32, &'a str>,
    pose: BTreeMap<u32, &'a str>,
}

/// Finds the export in a container; none when there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let mut roots: BTreeMap<&str, Files> = BTreeMap::new();
    for name in container.names() {
        let Some((root, kind, number)) = split(name) else { continue };
        let files = roots.entry(root).or_default();
        match kind {
            Kind::Color => files.color.insert(number, name),
            Kind::Depth => files.depth.insert(number, name),
            Kind::Pose => files.pose.insert(number, name),
        };
    }
    roots.retain(|_, files| !files.depth.is_empty() && (!files.color.is_empty() || !files.pose.is_empty()));
    let Some(root) = only_root(roots.keys().copied())? else { return Ok(None) };
    let files = &roots[root];

    let numbers: BTreeSet<u32> = files.color.keys().chain(files.depth.keys()).copied().collect();
    let mut sources = Vec::new();
    for &number in &numbers {
        let (Some(color), Some(depth)) = (files.color.get(&number), files.depth.get(&number)) else {
            continue;
        };
        let world_from_camera = match files.pose.get(&number) {
            Some(name) => read_pose(container, name)?,
            None => None,
        };
        sources.push(Source {
            number,
            time_s: None,
            world_from_camera,
            color: color.to_string(),
            depth: depth.to_string(),
        });
    }
    let file = |name: &str| format!("{root}intrinsic/{name}");
    Ok(Some(Layout {
        name: "scannet",
        pose_convention: "camera-to-world, OpenCV (x right, y down, z forward)",
        depth_unit: "millimetres (16-bit PNG)",
        depth_scale: DepthScale { units_per_m: 1000.0, no_reading: None },
        gravity: "world z is up (layout)",
        up_in_world: Some(Vector3::z()),
        color_pictures: files.color.len(),
        depth_pictures: files.depth.len(),
        incomplete: numbers.len() - sources.len(),
        color_intrinsics: read_intrinsics(container, &file("intrinsic_color.txt"))?,
        depth_intrinsics: Some(read_intrinsics(container, &file("intrinsic_depth.txt"))?),
        intrinsics: "one matrix for colour and one for depth (intrinsic/)".to_string(),
        sources,
        notes: Vec::new(),
    }))
}

enum Kind {
    Color,
    Depth,
    Pose,
}

/// Splits `scene/color/12.jpg` into `scene/`, the kind and 12.
fn split(name: &str) -> Option<(&str, Kind, u32)> {
    let (folder, file) = name.rsplit_once('/')?;
    let (stem, extension) = file.rsplit_once('.')?;
    let kind_name = folder.rsplit('/').next()?;
    let kind = match (kind_name, extension) {
        ("color", "jpg" | "jpeg" | "png") => Kind::Color,
        ("depth", "png") => Kind::Depth,
        ("pose", "txt") => Kind::Pose,
        _ => return None,
    };
    if !stem.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    Some((&folder[..folder.len() - kind_name.len()], kind, stem.parse().ok()?))
}
