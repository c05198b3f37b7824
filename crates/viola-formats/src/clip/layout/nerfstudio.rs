//! `transforms.json` of Nerfstudio and NeRFCapture (nerfstudio-project/nerfstudio,
//! docs/quickstart/data_conventions.md; jc211/NeRFCapture, Manifest.swift and DatasetWriter.swift).

mod arrays;

use super::json::{first_frames, parse_json};
use super::natural::natural_order;
use super::text::{listed_path, pose_from_rows};
use super::{
    ARKIT_UP, Cameras, ClipError, ColorAt, Intrinsics, Layout, Numbers, OPENGL, Of, Source, only_root,
    roots_of, with_opencv_axes,
};
use crate::clip::files::find_file;
use crate::container::Container;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer};
use std::fmt;
use viola_geometry::{Pose3, Vector3};

const FILE: &str = "transforms.json";
/// 100 000 frames of some 400 bytes.
const MAX_FILE_BYTES: u64 = 48 << 20;
/// The folders of colour and depth and the ending of depth, as NeRFCapture and the scripts that store its stream name them
/// around the number of the frame.
const NERF_CAPTURE_NAMES: [(&str, &str, &str); 2] =
    [("images/", "images/", ".depth.png"), ("rgb/", "depth/", ".png")];
/// Coefficients up to this are ignored: they move a pixel at the edge by less than a depth pixel.
const MAX_DISTORTION: f64 = 0.02;
/// The models of perspective cameras (nerfstudio, cameras.py, `CAMERA_MODEL_TO_TYPE`); their lenses have coefficients.
const PERSPECTIVE_MODELS: [&str; 5] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"];

/// The file. Its cameras are parsed by themselves: `flatten` would keep every member that nobody reads, at sixteen times its
/// size.
#[derive(Deserialize)]
struct Transforms {
    #[serde(skip)]
    camera: Camera,
    #[serde(deserialize_with = "first_frames")]
    frames: Vec<FrameEntry>,
    /// Factor that the positions were multiplied by, and the depth was not.
    applied_scale: Option<f64>,
    /// Metres (or the unit of the poses) per unit of the depth pictures.
    integer_depth_scale: Option<f64>,
    /// NeRFCapture's name of `integer_depth_scale`.
    depth_integer_scale: Option<f64>,
}

/// The cameras of the file's frames, in their order.
#[derive(Deserialize)]
struct FrameCameras {
    #[serde(deserialize_with = "first_frames")]
    frames: Vec<Camera>,
}

/// Intrinsics of all frames, or of one.
#[derive(Deserialize, Default)]
struct Camera {
    camera_model: Option<String>,
    /// The mark of a fisheye in files of instant-ngp, which have no `camera_model`.
    #[serde(default, deserialize_with = "switch")]
    is_fisheye: bool,
    k1: Option<f64>,
    k2: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
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
    /// The name of `depth_file_path` in files of NeRFCapture and instant-ngp.
    depth_path: Option<String>,
    transform_matrix: [[f64; 4]; 4],
    /// Mark of poses by COLMAP, whose world has any unit and orientation.
    colmap_im_id: Option<u64>,
    timestamp: Option<f64>,
    #[serde(skip)]
    camera: Camera,
}

/// Deserializes true or false, which instant-ngp also takes as 1 or 0; `null` is false.
fn switch<'de, D: Deserializer<'de>>(deserializer: D) -> Result<bool, D::Error> {
    struct Switch;
    impl Visitor<'_> for Switch {
        type Value = bool;
        fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
            formatter.write_str("is_fisheye, which must be true, false, 0 or 1")
        }
        fn visit_unit<E>(self) -> Result<bool, E> {
            Ok(false)
        }
        fn visit_bool<E>(self, is_on: bool) -> Result<bool, E> {
            Ok(is_on)
        }
        fn visit_u64<E>(self, number: u64) -> Result<bool, E> {
            Ok(number != 0)
        }
        fn visit_i64<E>(self, number: i64) -> Result<bool, E> {
            Ok(number != 0)
        }
        fn visit_f64<E>(self, number: f64) -> Result<bool, E> {
            Ok(number != 0.0)
        }
    }
    deserializer.deserialize_any(Switch)
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

    /// Refuses a camera whose pictures are not those of a pinhole. `name` is the file's, `of` says whose camera it is.
    fn check_model(&self, name: &str, of: &str) -> Result<(), ClipError> {
        let field = match &self.camera_model {
            Some(model) if !PERSPECTIVE_MODELS.iter().any(|known| known.eq_ignore_ascii_case(model)) => {
                format!("camera_model {model:.40}")
            }
            _ if self.is_fisheye => "is_fisheye".to_string(),
            _ => return Ok(()),
        };
        let reason = format!(
            "the {field} of {of} is not that of a pinhole camera (OPENCV, PINHOLE, SIMPLE_PINHOLE); undistort colour and \
             depth first, for example with ns-process-data or COLMAP's image_undistorter"
        );
        Err(ClipError::BadIntrinsics { name: name.to_string(), reason })
    }

    fn is_distorted(&self) -> bool {
        [self.k1, self.k2, self.p1, self.p2].into_iter().flatten().any(|k| k.abs() > MAX_DISTORTION)
    }
}

impl FrameEntry {
    /// Returns whether the pictures have the names of NeRFCapture.
    fn has_names_of_nerf_capture(&self) -> bool {
        let Some(depth) = self.depth_path.as_deref().map(listed_path) else { return false };
        let color = listed_path(&self.file_path);
        NERF_CAPTURE_NAMES.into_iter().any(|(colors, depths, ending)| {
            let name = color.strip_prefix(colors).unwrap_or_default();
            let number = name.split('.').next().unwrap_or_default();
            let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
            is_number && depth == format!("{depths}{number}{ending}")
        })
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
    fn read(container: &dyn Container, name: &str) -> Result<Transforms, ClipError> {
        let bytes = container.read(name, MAX_FILE_BYTES)?;
        let mut file: Transforms = parse_json(&bytes, name)?;
        file.camera = parse_json(&bytes, name)?;
        let cameras: FrameCameras = parse_json(&bytes, name)?;
        for (frame, camera) in file.frames.iter_mut().zip(cameras.frames) {
            frame.camera = camera;
        }
        Ok(file)
    }

    fn units(&self, name: &str) -> Result<Units, ClipError> {
        let not_metric = |reason: String| ClipError::NotMetric { name: name.to_string(), reason };
        let applied = self.applied_scale.unwrap_or(1.0);
        if !(1e-6..=1e6).contains(&applied) {
            return Err(not_metric(format!("{applied} cannot be the scale of its poses (applied_scale)")));
        }
        let units_per_m = match self.depth_scale() {
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

    fn depth_scale(&self) -> Option<f64> {
        self.integer_depth_scale.or(self.depth_integer_scale)
    }

    /// Sorts the frames by their times, or by their names if none has a time: COLMAP's models are in another order.
    fn sort_frames(&mut self) {
        let time_s = |frame: &FrameEntry| frame.timestamp.unwrap_or(f64::NAN);
        if self.frames.iter().all(|frame| frame.timestamp.is_none()) {
            self.frames.sort_by(|a, b| natural_order(&a.file_path, &b.file_path));
        } else if self.frames.iter().all(|frame| time_s(frame).is_finite()) {
            self.frames.sort_by(|a, b| time_s(a).total_cmp(&time_s(b)));
        }
    }

    /// Refuses cameras that are no pinholes; returns whether a lens distorts the pictures.
    fn check_lenses(&self, name: &str) -> Result<bool, ClipError> {
        self.camera.check_model(name, "all frames")?;
        for frame in &self.frames {
            frame.camera.check_model(name, &frame.file_path)?;
        }
        let cameras = self.frames.iter().map(|frame| &frame.camera);
        Ok(cameras.chain([&self.camera]).any(Camera::is_distorted))
    }

    fn is_by_colmap(&self) -> bool {
        self.frames.iter().any(|frame| frame.colmap_im_id.is_some())
    }

    /// Returns the name of the layout, the source of the upward axis, and this axis. `depth_path` alone does not tell
    /// NeRFCapture from instant-ngp, whose worlds have any upward axis.
    fn world(&self) -> (&'static str, &'static str, Option<Vector3>) {
        let has_depth_path = self.frames.iter().any(|frame| frame.depth_path.is_some());
        let is_marked = |frame: &FrameEntry| frame.timestamp.is_some() || frame.has_names_of_nerf_capture();
        let is_nerf_capture =
            has_depth_path && (self.depth_integer_scale.is_some() || self.frames.iter().any(is_marked));
        if is_nerf_capture {
            ("nerf_capture", ARKIT_UP, Some(Vector3::y()))
        } else if self.is_by_colmap() {
            ("nerfstudio", "unknown (COLMAP)", None)
        } else if has_depth_path {
            ("nerfstudio", "unknown (depth_path)", None)
        } else {
            ("nerfstudio", "world z is up (rule of the layout)", Some(Vector3::z()))
        }
    }
}

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let Some(root) = only_root(roots_of(container, FILE))? else { return Ok(None) };
    let name = format!("{root}{FILE}");
    let mut file = Transforms::read(container, &name)?;
    file.sort_frames();
    let Units { applied, is_scaled, units_per_m } = file.units(&name)?;
    let mut notes = Vec::new();
    if file.check_lenses(&name)? {
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
            time_s: frame.timestamp.filter(|time_s| time_s.is_finite()),
            world_from_camera: pose_from_rows(frame.transform_matrix.as_flattened())
                .map(|pose| in_unit_of_depth(with_opencv_axes(pose), is_scaled.then_some(applied))),
            numbers: if own { frame.camera.numbers(&file.camera, &name)? } else { None },
            ..Source::new(number as u32, ColorAt::File(color), arrays::depth_at(depth))
        });
    }
    let numbers =
        file.camera.numbers(&file.camera, &name)?.or_else(|| sources.iter().find_map(|s| s.numbers));
    let numbers = numbers.ok_or_else(|| ClipError::MissingIntrinsics {
        name: format!("{name}: fl_x, fl_y, cx, cy, of the file or of each frame"),
    })?;
    let is_told = file.depth_scale().is_some();
    let largest_m = if is_told { None } else { arrays::largest_m(container, &sources)? };
    notes.extend(largest_m.map(|largest| {
        format!("the largest number of depth as floats (.npy) is {largest}: depth was read as metres, not as millimetres")
    }));
    let (layout, gravity, up) = file.world();
    let metric = !is_scaled && !file.is_by_colmap();
    if is_scaled {
        notes.push(format!(
            "the positions were divided by applied_scale ({applied}), into the unit of the depth; this unit is unknown: \
             the alignment finds its scale"
        ));
    } else if !metric {
        notes.push(
            "the unit of the poses and the depth is unknown: the alignment finds the scale".to_string(),
        );
    }
    Ok(Some(Layout {
        pose_convention: OPENGL,
        pose_files: FILE,
        depth_unit: arrays::unit(&sources, is_told, largest_m.is_some()),
        depth_units_per_m: largest_m.map_or(units_per_m as f32, |_| 1.0),
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
    let name = format!("{root}{}", listed_path(path));
    let mut names = ["", ".png", ".jpg", ".jpeg"].into_iter().map(|ending| format!("{name}{ending}"));
    names.find_map(|name| find_file(container, &name))
}

#[cfg(test)]
mod tests {
    use super::FrameEntry;
    use serde_json::json;

    #[test]
    fn names_of_nerf_capture_are_told_from_others() {
        for (color, depth, is_told) in [
            ("images/0", "images/0.depth.png", true),
            ("./images/12.png", "./images/12.depth.png", true),
            ("rgb/7.png", "depth/7.png", true),
            ("rgb\\7.png", ".\\depth\\7.png", true),
            ("rgb/7.png", "depth/8.png", false),
            ("color/7.png", "depth/7.png", false),
            ("images/a", "images/a.depth.png", false),
            ("images/", "images/.depth.png", false),
        ] {
            let matrix = [[0.0; 4]; 4];
            let entry = json!({ "file_path": color, "depth_path": depth, "transform_matrix": matrix });
            let entry: FrameEntry = serde_json::from_value(entry).unwrap();
            assert_eq!(entry.has_names_of_nerf_capture(), is_told, "{color}, {depth}");
        }
    }
}
