//! The result of a layout's reader, and the list of the readers.

mod arkit_scenes;
mod associate;
mod colmap;
mod inertial;
mod json;
mod natural;
mod nerfstudio;
mod numbered;
mod points;
mod polycam;
mod record3d;
mod redwood;
mod ros;
mod rtabmap;
mod scanner_3d;
mod scannet;
mod sens;
mod seven_scenes;
mod spectacular;
mod stray;
mod text;
mod trajectory;
mod tum;
mod video;

use super::files::{ColorAt, DepthAt};
use super::{ClipError, Shutter};
use crate::container::{Container, ContainerError, Region};
use inertial::Forces;
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};
use viola_geometry::{Pose3, Vector3};

pub(super) const OPENCV: &str = "camera-to-world, OpenCV (x right, y down, z forward)";
pub(super) const OPENGL: &str = "camera-to-world, OpenGL (x right, y up, z backward)";
pub(super) const MILLIMETRES: &str = "millimetres (16-bit PNG)";
/// Maximum ratio of the views of colour and depth along a side: the cameras of one device see the same scene.
const MAX_VIEW_RATIO: f64 = 1.3;
/// Maximum ratio of two aspect ratios.
pub(super) const MAX_ASPECT_RATIO: f64 = 1.1;
/// Usual sizes of colour pictures beside depth.
const USUAL_SIZES: [(u32, u32); 5] = [(1920, 1440), (1280, 960), (1440, 1920), (960, 1280), (640, 480)];
/// Maximum ratios of the size by the principal point to a usual one, and to that of the depth.
const MAX_USUAL_RATIO: f64 = 1.03;
const MAX_DEPTH_WIDTH_RATIO: f64 = 1.05;
/// Maximum size of the only file of a container.
const MAX_NESTED_BYTES: u64 = 64 << 30;
/// ARKit's worlds are aligned to gravity, y up.
pub(super) const ARKIT_UP: &str = "world y is up (layout, ARKit)";

/// The result of one layout's reader.
pub(super) struct Layout {
    pub name: &'static str,
    pub pose_convention: &'static str,
    /// Source of the poses, for messages.
    pub pose_files: &'static str,
    /// The reason if no frame has a pose, if the reader can tell it.
    pub no_pose: Option<String>,
    pub depth_unit: &'static str,
    pub depth_units_per_m: f32,
    /// False if the unit of poses and depth is unknown. Depth is then in the unit of the poses.
    pub metric: bool,
    pub gravity: String,
    pub up_in_world: Option<Vector3>,
    pub forces: Forces,
    pub color_pictures: usize,
    pub depth_pictures: usize,
    /// Frames with only one of the two pictures.
    pub incomplete: usize,
    pub cameras: Cameras,
    /// `None` if the readout times of the cameras are unknown.
    pub shutter: Option<Shutter>,
    /// Source of the intrinsics, in words.
    pub intrinsics: String,
    /// In recording order.
    pub sources: Vec<Source>,
    /// The one large file that contains the pictures.
    pub region: Option<Region>,
    /// The video with the colour, and its name in the container.
    pub video: Option<(String, Region)>,
    /// True if colour is turned clockwise by a quarter beside depth and intrinsics. It is turned back.
    pub color_is_turned: bool,
    pub notes: Vec<String>,
}

impl Layout {
    /// Returns a layout with one camera-to-world pose per frame, OpenCV's axes, and depth in millimetres.
    fn new(name: &'static str, cameras: Cameras, sources: Vec<Source>) -> Layout {
        Layout {
            name,
            pose_convention: OPENCV,
            pose_files: "",
            no_pose: None,
            depth_unit: MILLIMETRES,
            depth_units_per_m: 1000.0,
            metric: true,
            gravity: "unknown".to_string(),
            up_in_world: None,
            forces: Forces::default(),
            color_pictures: 0,
            depth_pictures: 0,
            incomplete: 0,
            cameras,
            shutter: None,
            intrinsics: String::new(),
            sources,
            region: None,
            video: None,
            color_is_turned: false,
            notes: Vec::new(),
        }
    }
}

/// Intrinsics of a layout's two cameras.
pub(super) enum Cameras {
    /// One set of numbers for each camera.
    Each { color: Intrinsics, depth: Intrinsics },
    /// One set for both: colour and depth have the same view, in pictures of their own sizes.
    One(Intrinsics),
}

impl Cameras {
    /// Returns the numbers of both cameras, if they have one set.
    pub fn shared(&self) -> Option<Numbers> {
        match self {
            Cameras::Each { .. } => None,
            Cameras::One(intrinsics) => Some(intrinsics.numbers),
        }
    }
}

/// Focal lengths and principal point, in pixels of a picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Intrinsics {
    /// Their file, for messages.
    pub name: String,
    pub numbers: Numbers,
}

/// Intrinsics without the name of their file; a frame may have its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Numbers {
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub of: Of,
}

/// The picture whose pixels are the unit of the intrinsics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Of {
    Color,
    Depth,
    /// A picture of this width and height.
    Size(u32, u32),
}

/// One frame: its data, and the places of its pictures.
pub(super) struct Source {
    pub number: u32,
    pub time_s: Option<f64>,
    pub world_from_camera: Option<Pose3>,
    pub color: ColorAt,
    pub depth: DepthAt,
    /// A picture of the depth's confidence: readings with the lowest value are dropped.
    pub confidence: Option<String>,
    /// The frame's own intrinsics, if any; they replace those of [`Cameras::One`].
    pub numbers: Option<Numbers>,
}

impl Source {
    /// Returns a frame with only a number and pictures.
    fn new(number: u32, color: ColorAt, depth: DepthAt) -> Source {
        let (time_s, world_from_camera, confidence, numbers) = (None, None, None, None);
        Source { number, time_s, world_from_camera, color, depth, confidence, numbers }
    }
}

/// A reader: returns its result, or `None` if the container holds another layout.
type Find = fn(&dyn Container) -> Result<Option<Layout>, ClipError>;

/// Readers of layouts with a unique file come first, readers of any numbered pictures last.
const READERS: [Find; 16] = [
    record3d::find,
    stray::find,
    spectacular::find,
    polycam::find,
    arkit_scenes::find,
    scanner_3d::find,
    nerfstudio::find,
    colmap::find,
    redwood::find,
    scannet::find,
    seven_scenes::find,
    tum::find,
    rtabmap::find,
    ros::find,
    sens::find,
    points::find,
];

/// Tries the readers in turn.
pub(super) fn find(container: &dyn Container) -> Result<Layout, ClipError> {
    for find in READERS {
        if let Some(layout) = find(container)? {
            return Ok(layout);
        }
    }
    check_nested(container)?;
    Err(ClipError::UnknownLayout { files: container.names().len() })
}

/// Refuses a container without a clip, of whose files half or more are zip archives: each may be a clip.
fn check_nested(container: &dyn Container) -> Result<(), ClipError> {
    // Only likely names: a compressed file is unpacked for its first bytes.
    let is_zip = |name: &String| [".zip", ".r3d"].iter().any(|ending| name.to_lowercase().ends_with(ending));
    let zips: Vec<&String> = container.names().iter().filter(|name| is_zip(name)).collect();
    if let Some(name) = zips.first()
        && 2 * zips.len() >= container.names().len()
        && let Ok(region) = container.region(name, MAX_NESTED_BYTES)
        && region.head().is_ok_and(|head| head == Some(*b"PK\x03\x04"))
    {
        return Err(ContainerError::ArchiveInside { name: name.to_string() }.into());
    }
    Ok(())
}

/// Returns the only root of a layout, `None` without any, and an error for several.
fn only_root<'a>(mut roots: impl Iterator<Item = &'a str>) -> Result<Option<&'a str>, ClipError> {
    let Some(first) = roots.next() else { return Ok(None) };
    match roots.find(|root| *root != first) {
        None => Ok(Some(first)),
        Some(second) => {
            let shown = |root: &str| if root.is_empty() { "the top folder".into() } else { root.to_string() };
            Err(ClipError::SeveralClips { first: shown(first), second: shown(second) })
        }
    }
}

/// Returns the roots of the folders that hold a file of this name.
fn roots_of<'a>(container: &'a dyn Container, file: &'a str) -> impl Iterator<Item = &'a str> {
    let roots = container.names().iter().filter_map(move |name| name.strip_suffix(file));
    roots.filter(|root| root.is_empty() || root.ends_with('/'))
}

/// Returns the number of pictures that are in no frame. Without colour, depth is enough for a frame.
fn incomplete(color: usize, depth: usize, frames: usize) -> usize {
    // Frames of depth alone beside others with colour have one picture.
    (color + depth).saturating_sub(if color == 0 { frames } else { 2 * frames })
}

/// Returns the reason of clips without the file or folder of the poses.
fn no_pose_without(name: &str) -> String {
    format!("no frame has a pose, because there is no {name}")
}

/// Returns whether one of two positive numbers is more than `ratio` times the other.
pub(super) fn differs(a: f64, b: f64, ratio: f64) -> bool {
    a > b * ratio || b > a * ratio
}

/// Returns whether the views of two cameras differ by more than those of one device: the width and the height of what a
/// camera sees at a distance of one metre.
pub(super) fn views_differ((a_x, a_y): (f64, f64), (b_x, b_y): (f64, f64)) -> bool {
    differs(a_x / a_y, b_x / b_y, MAX_ASPECT_RATIO)
        || differs(a_x, b_x, MAX_VIEW_RATIO)
        || differs(a_y, b_y, MAX_VIEW_RATIO)
}

/// Converts a camera pose from OpenGL's to OpenCV's axes: half a turn about x.
fn with_opencv_axes(world_from_camera: Pose3) -> Pose3 {
    let half_turn = UnitQuaternion::from_quaternion(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    world_from_camera * Pose3::from_parts(Translation3::identity(), half_turn)
}

/// Returns the pose of a camera that looks along the x axis of a body with z up (REP 103).
fn body_from_optical() -> Pose3 {
    let rotation = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Pose3::from_parts(Translation3::identity(), rotation)
}

impl Numbers {
    /// Returns whether every number is within the fraction `max_drift` of the other's.
    pub fn is_near(&self, other: &Numbers, max_drift: f64) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= max_drift * b.abs();
        near(self.fx, other.fx)
            && near(self.fy, other.fy)
            && near(self.cx, other.cx)
            && near(self.cy, other.cy)
    }

    /// Returns the size of the numbers' picture, given the sizes of the clip's pictures.
    pub fn size(&self, color: Option<(u32, u32)>, depth: (u32, u32)) -> (u32, u32) {
        match self.of {
            Of::Color => color.unwrap_or_else(|| self.size_beside(depth)),
            Of::Depth => depth,
            Of::Size(width, height) => (width, height),
        }
    }

    /// Returns the size of an absent colour picture: the principal point is near its middle, and it has the
    /// aspect ratio of the depth picture. It is the depth's size or a usual one, if one of them is near.
    fn size_beside(&self, depth: (u32, u32)) -> (u32, u32) {
        let side = |length: f64| length.round().clamp(1.0, f64::from(u16::MAX)) as u32;
        let aspect = |(width, height): (u32, u32)| f64::from(width) / f64::from(height);
        let width = 2.0 * self.cx;
        // Clips that were converted without colour have the intrinsics of the depth.
        if !differs(width, f64::from(depth.0), MAX_DEPTH_WIDTH_RATIO) {
            return depth;
        }
        let is_near = |usual: &(u32, u32)| {
            !differs(width, f64::from(usual.0), MAX_USUAL_RATIO)
                && !differs(aspect(*usual), aspect(depth), MAX_USUAL_RATIO)
        };
        let computed = (side(width), side(width / aspect(depth)));
        USUAL_SIZES.into_iter().find(is_near).unwrap_or(computed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_an_absent_picture_is_near_twice_its_middle() {
        for (cx, depth, expected) in [
            (127.5, (256, 192), (256, 192)),
            (124.3, (256, 192), (256, 192)),
            (955.0, (256, 192), (1920, 1440)),
            (962.1, (256, 192), (1920, 1440)),
            (716.0, (192, 256), (1440, 1920)),
            (321.0, (256, 192), (640, 480)),
            (500.0, (256, 192), (1000, 750)),
            // No usual size has this aspect ratio.
            (960.0, (256, 144), (1920, 1080)),
        ] {
            let numbers = Numbers { fx: 1.0, fy: 1.0, cx, cy: 1.0, of: Of::Color };
            assert_eq!(numbers.size(None, depth), expected, "{cx} {depth:?}");
        }
    }
}
