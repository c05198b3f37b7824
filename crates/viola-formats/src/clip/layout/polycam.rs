//! Polycam's raw data: `keyframes/{images,cameras,depth,confidence}/<microseconds>.{jpg,json,png}`, and
//! `corrected_images`, `corrected_cameras` if the app has optimised the poses (PolyCam/polyform, README and
//! core/capture_folder.py).

use super::json::read_json;
use super::numbered::PICTURES;
use super::text::pose_from_rows;
use super::{
    ARKIT_UP, Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, OPENGL, Of, Source,
    only_root, with_opencv_axes,
};
use crate::clip::files::{find_file, has_ending, names_from};
use crate::container::Container;
use serde::Deserialize;
use viola_geometry::Vector3;

const MAX_CAMERA_BYTES: u64 = 64 << 10;
const CAMERAS: &str = "keyframes/cameras/";
const CORRECTED_CAMERAS: &str = "keyframes/corrected_cameras/";

/// A camera's file: intrinsics in the picture's pixels, and a 3x4 camera-to-world matrix, row-major. Since the end of 2025
/// the app leaves the size out of corrected cameras (nerfstudio-project/nerfstudio, pull request 3725).
#[derive(Deserialize)]
struct Camera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: Option<u32>,
    height: Option<u32>,
    t_00: f64,
    t_01: f64,
    t_02: f64,
    t_03: f64,
    t_10: f64,
    t_11: f64,
    t_12: f64,
    t_13: f64,
    t_20: f64,
    t_21: f64,
    t_22: f64,
    t_23: f64,
}

impl Camera {
    fn numbers(&self) -> Numbers {
        let Camera { fx, fy, cx, cy, width, height, .. } = *self;
        let of = width.zip(height).map_or(Of::Color, |(width, height)| Of::Size(width, height));
        Numbers { fx, fy, cx, cy, of }
    }

    fn rows(&self) -> [f64; 12] {
        [
            self.t_00, self.t_01, self.t_02, self.t_03, self.t_10, self.t_11, self.t_12, self.t_13,
            self.t_20, self.t_21, self.t_22, self.t_23,
        ]
    }
}

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let names = container.names();
    let root_of = |name: &'_ String| {
        let at = name.find(CAMERAS).or_else(|| name.find(CORRECTED_CAMERAS))?;
        let is_root = at == 0 || name.as_bytes()[at - 1] == b'/';
        (is_root && has_ending(name, ".json")).then_some(at)
    };
    let roots = names.iter().filter_map(|name| root_of(name).map(|at| &name[..at]));
    let Some(root) = only_root(roots)? else { return Ok(None) };

    let under = |folder: &str| -> Vec<&str> {
        let prefix = format!("{root}keyframes/{folder}/");
        names_from(container, &prefix).map(|name| &name[prefix.len()..]).collect()
    };
    let corrected = !under("corrected_cameras").is_empty() && !under("corrected_images").is_empty();
    let kind = if corrected { "corrected_" } else { "" };
    let depth_pictures = under("depth").len();
    let pictures = under(&format!("{kind}images"));

    // The stems are microseconds of one clock, sorted as numbers.
    let mut stems: Vec<(u64, &str, &str)> = Vec::new();
    for file in &pictures {
        let Some((stem, ending)) = file.rsplit_once('.') else { continue };
        let is_picture = PICTURES.iter().any(|picture| ending.eq_ignore_ascii_case(picture));
        let (true, Ok(time_us)) = (is_picture, stem.parse()) else { continue };
        stems.push((time_us, stem, file));
    }
    stems.sort_unstable();
    let mut sources = Vec::new();
    let mut first_camera = None;
    for (time_us, stem, file) in &stems {
        let beside = |file: String| find_file(container, &format!("{root}keyframes/{file}"));
        let camera = beside(format!("{kind}cameras/{stem}.json"));
        let depth = beside(format!("depth/{stem}.png"));
        let (Some(camera_name), Some(depth)) = (camera, depth) else { continue };
        let camera: Camera = read_json(container, &camera_name, MAX_CAMERA_BYTES)?;
        first_camera.get_or_insert_with(|| Intrinsics { name: camera_name, numbers: camera.numbers() });
        sources.push(Source {
            number: sources.len() as u32,
            time_s: Some(*time_us as f64 * 1e-6),
            world_from_camera: pose_from_rows(&camera.rows()).map(with_opencv_axes),
            color: ColorAt::File(format!("{root}keyframes/{kind}images/{file}")),
            depth: DepthAt::Png(depth),
            confidence: beside(format!("confidence/{stem}.png")),
            numbers: Some(camera.numbers()),
        });
    }
    let incomplete = stems.len().max(depth_pictures) - sources.len();
    let Some(intrinsics) = first_camera else {
        return Err(ClipError::NoFrames { color: stems.len(), depth: depth_pictures });
    };
    let notes = if corrected {
        vec![
            "the app's corrected cameras and pictures were used; the pictures have a black border"
                .to_string(),
        ]
    } else {
        vec![
            "there are no corrected cameras: the poses are those of the recording, and the pictures are \
             distorted by the lens"
                .to_string(),
        ]
    };
    Ok(Some(Layout {
        pose_convention: OPENGL,
        pose_files: "keyframes/cameras/",
        gravity: ARKIT_UP.to_string(),
        up_in_world: Some(Vector3::y()),
        color_pictures: stems.len(),
        depth_pictures,
        incomplete,
        intrinsics: format!("keyframes/{kind}cameras/, for each frame; depth is scaled to it"),
        notes,
        ..Layout::new("polycam", Cameras::One(intrinsics), sources)
    }))
}
