//! From what a layout's reader found to a checked [`Clip`].

use super::text::Intrinsics;
use super::{
    Clip, ClipError, ClipInfo, Files, FrameHeader, Origin, Pictures, picture, scannet, seven_scenes, tum,
};
use crate::container::Container;
use crate::geometry::{Pinhole, Pose3, Vector3};

const MAX_FRAMES: usize = 100_000;
/// The principal point lies this close to the picture's middle, as a part of the picture's side. Cropped
/// pictures stay below a fifth; intrinsics of a picture of twice the size are at a half.
const MAX_OFF_CENTRE: f64 = 0.25;
/// Colour and depth cameras of one device look at the same thing: neither sees this many times more of it
/// along a side.
const MAX_VIEW_RATIO: f64 = 1.3;
/// By how much the shapes of the two views may differ.
const MAX_ASPECT_RATIO: f64 = 1.1;

/// What the reader of one layout found.
pub(super) struct Layout {
    pub name: &'static str,
    pub pose_convention: &'static str,
    /// Where poses were looked for, for messages.
    pub pose_files: &'static str,
    pub depth_unit: &'static str,
    pub depth_units_per_m: f32,
    pub gravity: &'static str,
    pub up_in_world: Option<Vector3>,
    pub color_pictures: usize,
    pub depth_pictures: usize,
    /// Frames with only one of the two pictures.
    pub incomplete: usize,
    pub cameras: Cameras,
    /// Where the intrinsics come from, in words.
    pub intrinsics: String,
    /// In the order in which they were recorded.
    pub sources: Vec<Source>,
    pub notes: Vec<String>,
}

/// What a layout says of its two cameras.
pub(super) enum Cameras {
    /// A file for each.
    Each { color: Intrinsics, depth: Intrinsics },
    /// One file for both: it is the depth camera's, and colour is registered to it.
    Shared(Intrinsics),
    /// No file: these numbers for both, and the size of picture that they are for.
    Assumed(Intrinsics, (u32, u32)),
}

/// One frame: where its pictures are and what is known of it.
pub(super) struct Source {
    pub number: u32,
    pub time_s: Option<f64>,
    pub world_from_camera: Option<Pose3>,
    pub color: String,
    pub depth: String,
}

/// Tries the layouts and checks what the first that fits has found.
pub(super) fn assemble(container: Box<dyn Container>) -> Result<Clip, ClipError> {
    let layout = find_layout(container.as_ref())?;
    let frames = layout.sources.len();
    if frames == 0 {
        let (color, depth) = (layout.color_pictures, layout.depth_pictures);
        if color > 0 && depth > 0 {
            let reason = format!("{color} colour and {depth} depth pictures, and no frame has one of each");
            return Err(ClipError::ColorDepthMismatch { reason });
        }
        return Err(ClipError::NoFrames { color, depth });
    }
    if frames > MAX_FRAMES {
        return Err(ClipError::TooManyFrames { frames, max: MAX_FRAMES });
    }
    let frames_with_pose = layout.sources.iter().filter(|s| s.world_from_camera.is_some()).count();
    if frames_with_pose == 0 {
        return Err(ClipError::NoFinitePose { frames, place: layout.pose_files });
    }

    let first = &layout.sources[0];
    let color_size = picture::size(container.as_ref(), &first.color)?;
    let depth_size = picture::size(container.as_ref(), &first.depth)?;
    let (color_camera, depth_camera) = cameras(&layout.cameras, color_size, depth_size)?;
    check_views(&color_camera, &depth_camera)?;

    let duration_s = match (first.time_s, layout.sources.last().and_then(|s| s.time_s)) {
        (Some(from), Some(to)) => Some(to - from),
        _ => None,
    };
    let info = ClipInfo {
        layout: layout.name.to_string(),
        pose_convention: layout.pose_convention.to_string(),
        depth_unit: layout.depth_unit.to_string(),
        gravity: layout.gravity.to_string(),
        intrinsics: layout.intrinsics,
        frames,
        frames_with_pose,
        skipped_without_pose: frames - frames_with_pose,
        skipped_incomplete: layout.incomplete,
        color_width: color_camera.width,
        color_height: color_camera.height,
        depth_width: depth_camera.width,
        depth_height: depth_camera.height,
        duration_s,
        recorded_at_ms: first.time_s.and_then(unix_ms),
        notes: layout.notes,
    };
    let (frames, pictures) = layout
        .sources
        .into_iter()
        .map(|Source { number, time_s, world_from_camera, color, depth }| {
            (FrameHeader { number, time_s, world_from_camera }, Pictures { color, depth })
        })
        .unzip();
    let files = Files {
        container,
        pictures,
        color_camera,
        depth_camera,
        depth_units_per_m: layout.depth_units_per_m,
    };
    Ok(Clip { info, frames, up_in_world: layout.up_in_world, origin: Origin::Files(files) })
}

/// Frames' times are seconds since 1970 in some layouts and since the device's start in others. Those between the
/// years 2000 and 2100 are taken for times of day: no device has been running for 30 years.
fn unix_ms(time_s: f64) -> Option<i64> {
    (946_684_800.0..4_102_444_800.0).contains(&time_s).then(|| (time_s * 1e3).round() as i64)
}

fn find_layout(container: &dyn Container) -> Result<Layout, ClipError> {
    for find in [scannet::find, seven_scenes::find, tum::find] {
        if let Some(layout) = find(container)? {
            return Ok(layout);
        }
    }
    Err(ClipError::UnknownLayout { files: container.names().len() })
}

/// The one root among those where a layout was found; none when there is none.
pub(super) fn only_root<'a>(mut roots: impl Iterator<Item = &'a str>) -> Result<Option<&'a str>, ClipError> {
    let Some(first) = roots.next() else { return Ok(None) };
    match roots.next() {
        None => Ok(Some(first)),
        Some(second) => {
            let shown = |root: &str| if root.is_empty() { "the top folder".into() } else { root.to_string() };
            Err(ClipError::SeveralClips { first: shown(first), second: shown(second) })
        }
    }
}

/// The colour and the depth camera.
fn cameras(
    cameras: &Cameras,
    color_size: (u32, u32),
    depth_size: (u32, u32),
) -> Result<(Pinhole, Pinhole), ClipError> {
    let (intrinsics, size) = match cameras {
        Cameras::Each { color, depth } => {
            return Ok((camera(color, color_size)?, camera(depth, depth_size)?));
        }
        Cameras::Shared(intrinsics) => (intrinsics, depth_size),
        Cameras::Assumed(intrinsics, size) => (intrinsics, *size),
    };
    let aspect = |(width, height): (u32, u32)| f64::from(width) / f64::from(height);
    for picture in [color_size, depth_size] {
        if differs(aspect(picture), aspect(size), MAX_ASPECT_RATIO) {
            let reason = format!(
                "colour is {}x{}, depth is {}x{}, and the one set of intrinsics is for {}x{}",
                color_size.0, color_size.1, depth_size.0, depth_size.1, size.0, size.1
            );
            return Err(ClipError::ColorDepthMismatch { reason });
        }
    }
    let known = camera(intrinsics, size)?;
    Ok((known.resized(color_size.0, color_size.1), known.resized(depth_size.0, depth_size.1)))
}

/// Whether one of two positive numbers is more than `ratio` times the other.
fn differs(a: f64, b: f64, ratio: f64) -> bool {
    a > b * ratio || b > a * ratio
}

/// The camera of a picture of this size, when the intrinsics can be those of such a picture.
fn camera(intrinsics: &Intrinsics, (width, height): (u32, u32)) -> Result<Pinhole, ClipError> {
    let &Intrinsics { fx, fy, cx, cy, .. } = intrinsics;
    let camera = Pinhole { width, height, fx, fy, cx, cy };
    let bad = |reason: String| ClipError::BadIntrinsics { name: intrinsics.name.clone(), reason };
    if !camera.is_plausible() {
        return Err(bad(format!("fx {fx}, fy {fy} are no focal lengths of a picture of {width}x{height}")));
    }
    let off_centre = |c: f64, side: u32| (c / f64::from(side) - 0.5).abs();
    if off_centre(cx, width) > MAX_OFF_CENTRE || off_centre(cy, height) > MAX_OFF_CENTRE {
        return Err(bad(format!(
            "the principal point ({cx}, {cy}) is far from the middle of the {width}x{height} picture; \
             the intrinsics belong to a picture of another size"
        )));
    }
    Ok(camera)
}

/// Refuses colour and depth cameras that cannot look at the same thing.
fn check_views(color: &Pinhole, depth: &Pinhole) -> Result<(), ClipError> {
    // The tangents of the angles of view: what the camera sees at a distance of one metre.
    let view_m = |c: &Pinhole| (f64::from(c.width) / c.fx, f64::from(c.height) / c.fy);
    let ((color_x, color_y), (depth_x, depth_y)) = (view_m(color), view_m(depth));
    let aspect_differs = differs(color_x / color_y, depth_x / depth_y, MAX_ASPECT_RATIO);
    if aspect_differs
        || differs(color_x, depth_x, MAX_VIEW_RATIO)
        || differs(color_y, depth_y, MAX_VIEW_RATIO)
    {
        let reason = format!(
            "at one metre, colour ({}x{}) sees {color_x:.2} x {color_y:.2} m and depth ({}x{}) {depth_x:.2} x {depth_y:.2} m",
            color.width, color.height, depth.width, depth.height
        );
        return Err(ClipError::ColorDepthMismatch { reason });
    }
    Ok(())
}
