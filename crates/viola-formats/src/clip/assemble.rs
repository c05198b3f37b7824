//! Builds a checked [`Clip`] from the result of a layout's reader.

use super::files::{Cameras as FrameCameras, Files, Pictures, Video};
use super::layout::{self, Cameras, Intrinsics, Numbers, Source};
use super::{Clip, ClipError, ClipInfo, FrameHeader, MAX_FRAMES, Origin, depth};
use crate::container::Container;
use crate::video::Tools;
use viola_geometry::Pinhole;

/// Maximum distance of the principal point from the picture's middle, as a fraction of the picture's side.
/// Cropped pictures stay below 0.2; intrinsics of a picture of twice the size are at 0.5.
const MAX_OFF_CENTRE: f64 = 0.25;
/// Maximum ratio of the views of colour and depth along a side: the cameras of one device see the same scene.
const MAX_VIEW_RATIO: f64 = 1.3;
/// Maximum ratio of two aspect ratios.
const MAX_ASPECT_RATIO: f64 = 1.1;

/// Detects the layout and checks the contents.
pub(super) fn assemble(container: Box<dyn Container>, tools: &Tools) -> Result<Clip, ClipError> {
    let layout = layout::find(container.as_ref())?;
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

    let first = &layout.sources[0];
    let lying = |(width, height)| if layout.color_is_turned { (height, width) } else { (width, height) };
    let color_size = first.color.size(container.as_ref())?.map(lying);
    let depth_size = first.depth.size(container.as_ref())?;
    check_depth_size(first.number, depth_size)?;
    let sizes = Sizes { color: color_size, depth: depth_size };
    // The sizes are the first frame's, which may have intrinsics of its own.
    let cameras = sizes.cameras(&layout.cameras, first.numbers)?;
    check_views(&cameras.color, &cameras.depth)?;

    let duration_s = match (first.time_s, layout.sources.last().and_then(|s| s.time_s)) {
        // Times that run backwards are invalid.
        (Some(from), Some(to)) if to >= from => Some(to - from),
        _ => None,
    };
    let missing = missing(frames_with_pose > 0, color_size.is_some(), layout.pose_files);
    let (color_width, color_height) = color_size.unwrap_or_default();
    let info = ClipInfo {
        layout: layout.name.to_string(),
        pose_convention: layout.pose_convention.to_string(),
        depth_unit: layout.depth_unit.to_string(),
        gravity: layout.gravity,
        intrinsics: layout.intrinsics,
        frames,
        frames_with_pose,
        skipped_without_pose: frames - frames_with_pose,
        skipped_incomplete: layout.incomplete,
        color_width,
        color_height,
        depth_width: depth_size.0,
        depth_height: depth_size.1,
        duration_s,
        metric: layout.metric,
        recorded_at_ms: first.time_s.and_then(unix_ms),
        notes: layout.notes.into_iter().chain(missing).collect(),
    };
    let tools = tools.clone();
    let video = layout.video.map(|(name, region)| Video { name, region, tools });
    let mut headers = Vec::with_capacity(frames);
    let mut pictures = Vec::with_capacity(frames);
    for Source { number, time_s, world_from_camera, color, depth, confidence, numbers } in layout.sources {
        let own = numbers.map(|own| sizes.cameras(&layout.cameras, Some(own))).transpose()?;
        let force_in_camera = time_s.and_then(|time_s| layout.forces.around(time_s));
        headers.push(FrameHeader { number, time_s, world_from_camera, force_in_camera });
        pictures.push(Pictures::new(container.as_ref(), color, depth, confidence, own)?);
    }
    let files = Files {
        container,
        region: layout.region,
        video,
        color_is_turned: layout.color_is_turned,
        pictures,
        cameras,
        depth_units_per_m: layout.depth_units_per_m,
    };
    Ok(Clip::new(info, headers, layout.up_in_world, layout.shutter, Origin::Files(Box::new(files))))
}

/// Refuses depth pictures that are too large; all have the size of the first one.
fn check_depth_size(frame: u32, (width, height): (u32, u32)) -> Result<(), ClipError> {
    if u64::from(width) * u64::from(height) <= depth::MAX_PIXELS {
        return Ok(());
    }
    let name = format!("the depth picture of frame {frame}");
    Err(ClipError::PictureTooLarge { name, width, height, max_pixels: depth::MAX_PIXELS })
}

/// Returns notes about missing colour and poses.
fn missing(has_poses: bool, has_color: bool, pose_files: &str) -> impl Iterator<Item = String> {
    let color =
        (!has_color).then(|| "there are no colour pictures: the clip is aligned by depth alone".to_string());
    let next = if has_color {
        "the camera will be tracked by its pictures"
    } else {
        "the clip has no colour to track the camera by"
    };
    let poses = (!has_poses)
        .then(|| format!("no frame has a pose in {pose_files} that is a finite rigid motion: {next}"));
    color.into_iter().chain(poses)
}

/// Returns a time of day in milliseconds. Layouts count seconds since 1970 or since the device's start; times
/// in the years 2000 to 2100 count from 1970, as no device runs for 30 years.
fn unix_ms(time_s: f64) -> Option<i64> {
    (946_684_800.0..4_102_444_800.0).contains(&time_s).then(|| (time_s * 1e3).round() as i64)
}

/// Widths and heights of the clip's pictures.
#[derive(Clone, Copy)]
struct Sizes {
    /// `None` without colour.
    color: Option<(u32, u32)>,
    depth: (u32, u32),
}

impl Sizes {
    /// Returns the colour and depth cameras of a frame, with its own intrinsics if it has any. Without colour,
    /// both are the depth camera.
    fn cameras(&self, cameras: &Cameras, own: Option<Numbers>) -> Result<FrameCameras, ClipError> {
        match cameras {
            Cameras::Each { color, depth } => {
                let depth = self.camera(&depth.name, &depth.numbers, self.depth)?;
                let color = self.color.map(|size| self.camera(&color.name, &color.numbers, size));
                Ok(FrameCameras { color: color.transpose()?.unwrap_or(depth), depth })
            }
            Cameras::One(Intrinsics { name, numbers }) => {
                let numbers = own.as_ref().unwrap_or(numbers);
                self.check_aspect(numbers)?;
                let depth = self.camera(name, numbers, self.depth)?;
                let color = self.color.map(|size| self.camera(name, numbers, size));
                Ok(FrameCameras { color: color.transpose()?.unwrap_or(depth), depth })
            }
        }
    }

    /// Checks that the pictures of one camera have its aspect ratio.
    fn check_aspect(&self, numbers: &Numbers) -> Result<(), ClipError> {
        let aspect = |(width, height): (u32, u32)| f64::from(width) / f64::from(height);
        let of = numbers.size(self.color, self.depth);
        for picture in self.color.into_iter().chain([self.depth]) {
            if differs(aspect(picture), aspect(of), MAX_ASPECT_RATIO) {
                let color = self.color.map_or(String::new(), |(w, h)| format!("colour is {w}x{h}, "));
                let reason = format!(
                    "{color}depth is {}x{}, and the one set of intrinsics is for {}x{}",
                    self.depth.0, self.depth.1, of.0, of.1
                );
                return Err(ClipError::ColorDepthMismatch { reason });
            }
        }
        Ok(())
    }

    /// Returns the camera of a picture of this size, or an error if the intrinsics are implausible.
    fn camera(&self, name: &str, numbers: &Numbers, wanted: (u32, u32)) -> Result<Pinhole, ClipError> {
        let Numbers { fx, fy, cx, cy, .. } = *numbers;
        let (width, height) = numbers.size(self.color, self.depth);
        let camera = Pinhole { width, height, fx, fy, cx, cy };
        let bad = |reason: String| ClipError::BadIntrinsics { name: name.to_string(), reason };
        // The principal point is checked separately, so that the message names the wrong value.
        let centred = Pinhole { cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0, ..camera };
        if !centred.is_plausible() {
            return Err(bad(format!(
                "fx {fx}, fy {fy} are no focal lengths of a picture of {width}x{height}"
            )));
        }
        let is_central = |c: f64, side: u32| (c / f64::from(side) - 0.5).abs() <= MAX_OFF_CENTRE;
        if !is_central(cx, width) || !is_central(cy, height) || !camera.is_plausible() {
            return Err(bad(format!(
                "the principal point ({cx}, {cy}) is far from the middle of the {width}x{height} picture; \
                 the intrinsics belong to a picture of another size"
            )));
        }
        let is_same = (width, height) == wanted;
        Ok(if is_same { camera } else { camera.resized(wanted.0, wanted.1) })
    }
}

/// Returns whether one of two positive numbers is more than `ratio` times the other.
fn differs(a: f64, b: f64, ratio: f64) -> bool {
    a > b * ratio || b > a * ratio
}

/// Refuses colour and depth cameras with different views.
fn check_views(color: &Pinhole, depth: &Pinhole) -> Result<(), ClipError> {
    // Width and height of the view at a distance of one metre.
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
