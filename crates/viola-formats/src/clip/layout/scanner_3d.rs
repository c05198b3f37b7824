//! 3D Scanner App, "All data": `frame_00000.{jpg,json}`, `depth_00000.png`, `conf_00000.png`
//! (introlab/rtabmap, corelib/src/camera/CameraImages.cpp). Only some frames have a colour picture.

use super::json::read_json;
use super::numbered::number;
use super::text::pose_from_rows;
use super::{
    ARKIT_UP, Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, OPENGL, Of, Source,
    only_root, with_opencv_axes,
};
use crate::clip::files::find_file;
use crate::container::Container;
use serde::Deserialize;
use viola_geometry::Vector3;

const MAX_FRAME_BYTES: u64 = 64 << 10;

/// A frame's file. Both matrices are row-major.
#[derive(Deserialize)]
struct FrameFile {
    #[serde(rename = "cameraPoseARFrame")]
    world_from_camera: [f64; 16],
    intrinsics: [f64; 9],
    time: Option<f64>,
}

/// Splits `scan/frame_00012.json` into `scan/` and `00012`.
fn split(name: &str) -> Option<(&str, &str)> {
    let (root, file) = name.split_at(name.rfind('/').map_or(0, |slash| slash + 1));
    let (digits, ending) = file.strip_prefix("frame_")?.rsplit_once('.')?;
    let is_frame = number(digits).is_some() && ending.eq_ignore_ascii_case("json");
    is_frame.then_some((root, digits))
}

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let frames = || container.names().iter().filter_map(|name| split(name));
    let Some(root) = only_root(frames().map(|(root, _)| root))? else { return Ok(None) };
    let mut sources = Vec::new();
    let (mut color_pictures, mut depth_pictures, mut all) = (0, 0, 0);
    let mut first = None;
    for (_, digits) in frames() {
        let of_frame =
            |kind: &str, ending: &str| find_file(container, &format!("{root}{kind}_{digits}.{ending}"));
        let (color, depth) = (of_frame("frame", "jpg"), of_frame("depth", "png"));
        all += 1;
        color_pictures += usize::from(color.is_some());
        depth_pictures += usize::from(depth.is_some());
        let (Some(color), Some(depth), Some(number)) = (color, depth, number(digits)) else { continue };
        let Some(name) = of_frame("frame", "json") else { continue };
        let file: FrameFile = read_json(container, &name, MAX_FRAME_BYTES)?;
        let [fx, _, cx, _, fy, cy, ..] = file.intrinsics;
        let numbers = Numbers { fx, fy, cx, cy, of: Of::Color };
        first.get_or_insert(Intrinsics { name, numbers });
        sources.push(Source {
            number,
            time_s: file.time.filter(|time_s| time_s.is_finite()),
            world_from_camera: pose_from_rows(&file.world_from_camera).map(with_opencv_axes),
            color: ColorAt::File(color),
            depth: DepthAt::Png(depth),
            confidence: of_frame("conf", "png"),
            numbers: Some(numbers),
        });
    }
    let Some(intrinsics) = first else {
        // The numbered JSON files are of another program.
        if color_pictures + depth_pictures == 0 {
            return Ok(None);
        }
        return Err(ClipError::NoFrames { color: color_pictures, depth: depth_pictures });
    };
    sources.sort_by_key(|source| source.number);
    Ok(Some(Layout {
        pose_convention: OPENGL,
        pose_files: "frame_*.json",
        depth_unit: "millimetres (16-bit PNG; the app's makers have not said so)",
        gravity: ARKIT_UP.to_string(),
        up_in_world: Some(Vector3::y()),
        color_pictures,
        depth_pictures,
        incomplete: all - sources.len(),
        intrinsics: "frame_*.json, for each frame; depth is scaled to it".to_string(),
        notes: vec![
            "the app writes a colour picture for some frames only; the others were left out".to_string(),
        ],
        ..Layout::new("scanner_3d_app", Cameras::One(intrinsics), sources)
    }))
}
