//! COLMAP's dense workspace: `images/`, `sparse/` with cameras and poses as text or binary, and
//! `stereo/depth_maps/` (colmap.github.io/format.html; colmap/colmap, scripts/python/read_write_model.py and
//! read_write_dense.py). Its world has any unit and any orientation.

mod model;

use super::natural::natural_order;
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Source, incomplete, only_root, roots_of,
};
use crate::clip::files::find_file;
use crate::container::Container;
use model::{Image, Model};

/// Folders of a model, and whether its files are binary.
const MODELS: [(&str, bool); 4] =
    [("sparse/", true), ("sparse/0/", true), ("sparse/", false), ("sparse/0/", false)];
/// Depth that agrees between pictures is preferred.
const DEPTHS: [&str; 2] = [".geometric.bin", ".photometric.bin"];

/// Finds the reconstruction in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    for (folder, is_binary) in MODELS {
        let file = format!("{folder}images.{}", if is_binary { "bin" } else { "txt" });
        if let Some(root) = only_root(roots_of(container, &file))? {
            let model = Model::read(container, &format!("{root}{folder}"), is_binary)?;
            return layout(container, root, model).map(Some);
        }
    }
    Ok(None)
}

fn layout(container: &dyn Container, root: &str, model: Model) -> Result<Layout, ClipError> {
    let Model { cameras, mut images } = model;
    let (mut color_pictures, mut depth_pictures) = (0, 0);
    // By name: the numbers of images are in the order of the matching, and not of the recording.
    images.sort_by(|a, b| natural_order(&a.name, &b.name));
    images.dedup_by(|a, b| a.name == b.name);
    let mut sources = Vec::new();
    for (number, Image { name, camera, world_from_camera }) in images.into_iter().enumerate() {
        let color = find_file(container, &format!("{root}images/{name}"));
        let mut depth = DEPTHS.iter().map(|end| format!("{root}stereo/depth_maps/{name}{end}"));
        let depth = depth.find_map(|name| find_file(container, &name));
        color_pictures += usize::from(color.is_some());
        depth_pictures += usize::from(depth.is_some());
        let (Some(color), Some(depth)) = (color, depth) else { continue };
        let numbers = cameras
            .get(&camera)
            .ok_or_else(|| ClipError::MissingIntrinsics { name: format!("camera {camera} of {name}") })?;
        sources.push(Source {
            world_from_camera,
            numbers: Some(*numbers),
            ..Source::new(number as u32, ColorAt::File(color), DepthAt::Colmap(depth))
        });
    }
    let numbers =
        sources.iter().find_map(|source| source.numbers).or_else(|| cameras.values().next().copied());
    let name = format!("{root}sparse/cameras");
    let numbers = numbers.ok_or_else(|| ClipError::MissingIntrinsics { name: name.clone() })?;
    Ok(Layout {
        pose_files: "images of the sparse model",
        depth_unit: "unit of the reconstruction (32-bit floats)",
        metric: false,
        gravity: "unknown (COLMAP)".to_string(),
        color_pictures,
        depth_pictures,
        incomplete: incomplete(color_pictures, depth_pictures, sources.len()),
        intrinsics: "cameras of the sparse model; depth is scaled to them".to_string(),
        notes: vec![
            "the unit of the reconstruction is unknown: the alignment finds the scale".to_string(),
            "frames are in the order of the numbers in their names".to_string(),
        ],
        ..Layout::new("colmap", Cameras::One(Intrinsics { name, numbers }), sources)
    })
}
