//! `transforms.json` of Nerfstudio and NeRFCapture (nerfstudio-project/nerfstudio,
//! docs/quickstart/data_conventions.md; jc211/NeRFCapture, Manifest.swift and DatasetWriter.swift).

use super::json::read_json;
use super::text::pose_from_rows;
use super::{
    ARKIT_UP, Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, MILLIMETRES, Numbers, OPENGL, Of,
    Source, only_root, roots_of, with_opencv_axes,
};
use crate::container::Container;
use serde::Deserialize;
use viola_geometry::{Pose3, Vector3};

const FILE: &str = "transforms.json";
/// 100 000 frames of some 400 bytes.
const MAX_FILE_BYTES: u64 = 48 << 20;
/// Coefficients up to this are ignored: they move a pixel at the edge by less than a depth pixel.
const MAX_DISTORTION: f64 = 0.02;

#[derive(Deserialize)]
struct Transforms {
    #[serde(flatten)]
    camera: Camera,
    frames: Vec<FrameEntry>,
    /// Factor that the positions were multiplied by, and the depth was not.
    applied_scale: Option<f64>,
    /// Metres (or the unit of the poses) per unit of the depth pictures.
    #[serde(alias = "depth_integer_scale")]
    integer_depth_scale: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// Intrinsics of all frames, or of one.
#[derive(Deserialize, Clone, Copy)]
struct Camera {
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
}

#[derive(Deserialize)]
struct FrameEntry {
    file_path: String,
    depth_file_path: Option<String>,
    /// NeRFCapture's name of `depth_file_path`.
    depth_path: Option<String>,
    transform_matrix: [[f64; 4]; 4],
    /// Mark of poses by COLMAP, whose world has any unit and orientation.
    colmap_im_id: Option<u64>,
    timestamp: Option<f64>,
    #[serde(flatten)]
    camera: Camera,
}

impl Camera {
    /// Returns the numbers, with missing ones from `or`; `None` if too few are given. `name` is the file's.
    fn numbers(&self, or: &Camera, name: &str) -> Result<Option<Numbers>, ClipError> {
        let of = match (self.w.or(or.w), self.h.or(or.h)) {
            (Some(width), Some(height)) => Of::Size(side(width, name)?, side(height, name)?),
            _ => Of::Color,
        };
        let (Some(fx), Some(cx), Some(cy)) = (self.fl_x.or(or.fl_x), self.cx.or(or.cx), self.cy.or(or.cy))
        else {
            return Ok(None);
        };
        Ok(Some(Numbers { fx, fy: self.fl_y.or(or.fl_y).unwrap_or(fx), cx, cy, of }))
    }

    fn is_given(&self) -> bool {
        self.fl_x.is_some() || self.cx.is_some()
    }
}

/// Checks and returns a picture's width or height.
fn side(side: f64, name: &str) -> Result<u32, ClipError> {
    if side.fract() == 0.0 && (1.0..=65_535.0).contains(&side) {
        return Ok(side as u32);
    }
    let reason = format!("w and h are not those of a picture: {side}");
    Err(ClipError::BadIntrinsics { name: name.to_string(), reason })
}

/// Units of the poses and of the depth.
struct Units {
    /// Factor of the positions.
    applied: f64,
    is_scaled: bool,
    /// Of the depth pictures.
    units_per_m: f64,
}

impl Transforms {
    fn units(&self, name: &str) -> Result<Units, ClipError> {
        let not_metric = |reason: String| ClipError::NotMetric { name: name.to_string(), reason };
        let applied = self.applied_scale.unwrap_or(1.0);
        if !(1e-6..=1e6).contains(&applied) {
            return Err(not_metric(format!("{applied} cannot be the scale of its poses (applied_scale)")));
        }
        let units_per_m = match self.integer_depth_scale {
            // NeRFCapture writes 1 for pictures that it has reduced to 8 bits.
            Some(scale) if !(1e-5..=0.1).contains(&scale) => {
                let reason = format!("{scale} m for a unit of depth (integer_depth_scale) cannot be");
                return Err(not_metric(reason));
            }
            Some(scale) => 1.0 / scale,
            None => 1000.0,
        };
        Ok(Units { applied, is_scaled: (applied - 1.0).abs() > 1e-6, units_per_m })
    }
}

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some(root) = only_root(roots_of(container, FILE))? else { return Ok(None) };
    let name = format!("{root}{FILE}");
    let mut file: Transforms = read_json(container, &name, MAX_FILE_BYTES)?;
    // Without times, frames are in the order of their names; COLMAP's models are not.
    if file.frames.iter().all(|frame| frame.timestamp.is_none()) {
        file.frames.sort_by(|a, b| a.file_path.cmp(&b.file_path));
    }
    let is_nerf_capture = file.frames.iter().any(|frame| frame.depth_path.is_some());
    let Units { applied, is_scaled, units_per_m } = file.units(&name)?;
    let by_colmap = file.frames.iter().any(|frame| frame.colmap_im_id.is_some());
    let mut notes = Vec::new();
    let bends = [file.k1, file.k2, file.p1, file.p2].into_iter().flatten().any(|k| k.abs() > MAX_DISTORTION);
    if bends {
        notes.push("the lens distortion (k1, k2, p1, p2) was not undone".to_string());
    }

    let (mut color_pictures, mut depth_pictures) = (0, 0);
    let mut sources = Vec::new();
    for (number, frame) in file.frames.iter().enumerate() {
        let color = picture(container, root, &frame.file_path);
        let depth = frame.depth_file_path.as_ref().or(frame.depth_path.as_ref());
        let depth = depth.and_then(|path| picture(container, root, path));
        color_pictures += usize::from(color.is_some());
        depth_pictures += usize::from(depth.is_some());
        let (Some(color), Some(depth)) = (color, depth) else { continue };
        let own = frame.camera.is_given();
        sources.push(Source {
            number: number as u32,
            time_s: frame.timestamp.filter(|time_s| time_s.is_finite()),
            world_from_camera: pose_from_rows(frame.transform_matrix.as_flattened())
                .map(|pose| in_unit_of_depth(with_opencv_axes(pose), is_scaled.then_some(applied))),
            color: ColorAt::File(color),
            depth: DepthAt::Png(depth),
            confidence: None,
            numbers: if own { frame.camera.numbers(&file.camera, &name)? } else { None },
        });
    }
    let numbers =
        file.camera.numbers(&file.camera, &name)?.or_else(|| sources.iter().find_map(|s| s.numbers));
    let numbers = numbers.ok_or_else(|| ClipError::MissingIntrinsics {
        name: format!("{name}: fl_x, fl_y, cx, cy, of the file or of each frame"),
    })?;
    let (layout, gravity, up) = match (is_nerf_capture, by_colmap) {
        (true, _) => ("nerf_capture", ARKIT_UP, Some(Vector3::y())),
        (false, true) => ("nerfstudio", "unknown (COLMAP)", None),
        (false, false) => ("nerfstudio", "world z is up (rule of the layout)", Some(Vector3::z())),
    };
    let metric = !is_scaled && !by_colmap;
    if !metric {
        notes.push(
            "the unit of the poses and the depth is unknown: the alignment finds the scale".to_string(),
        );
    }
    Ok(Some(Layout {
        pose_convention: OPENGL,
        pose_files: FILE,
        depth_unit: if file.integer_depth_scale.is_some() {
            "integer_depth_scale (16-bit PNG)"
        } else {
            MILLIMETRES
        },
        depth_units_per_m: units_per_m as f32,
        gravity: gravity.to_string(),
        up_in_world: up,
        metric,
        color_pictures,
        depth_pictures,
        incomplete: file.frames.len() - sources.len(),
        intrinsics: format!("{FILE}; depth is scaled to it"),
        notes,
        ..Layout::new(layout, Cameras::One(Intrinsics { name, numbers }), sources)
    }))
}

/// Returns a pose whose position was multiplied by `applied`, in the unit of the depth.
fn in_unit_of_depth(mut pose: Pose3, applied: Option<f64>) -> Pose3 {
    if let Some(applied) = applied {
        pose.translation.vector /= applied;
    }
    pose
}

/// Returns the file of a path of the JSON; NeRFCapture omits the extension.
fn picture(container: &dyn Container, root: &str, path: &str) -> Option<String> {
    let name = format!("{root}{}", path.trim_start_matches("./"));
    let endings = ["", ".png", ".jpg", ".jpeg"].into_iter().map(|ending| format!("{name}{ending}"));
    endings.into_iter().find(|name| container.contains(name))
}
