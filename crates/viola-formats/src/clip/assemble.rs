//! Builds a checked [`Clip`] from the result of a layout's reader.

use super::files::{Cameras as FrameCameras, Files, Pictures, Video};
use super::layout::{self, Cameras, Intrinsics, Layout, Numbers, Of, Source};
use super::{Clip, ClipError, ClipInfo, FrameHeader, MAX_FRAMES, Origin, depth};
use crate::container::Container;
use crate::video::Tools;
use viola_geometry::{Pinhole, Pose3};

/// Maximum distance of the principal point from the picture's middle, as a fraction of the picture's side.
/// Cropped pictures stay below 0.2; intrinsics of a picture of twice the size are at 0.5.
const MAX_OFF_CENTRE: f64 = 0.25;
/// Minimum number of poses that are judged as placeholders.
const MIN_PLACEHOLDERS: usize = 3;
/// Maximum difference of a placeholder's numbers from the identity's: rounding. A device at rest moves more.
const PLACEHOLDER_TOLERANCE: f64 = 1e-9;
/// Minimum number of equal poses, and of seconds from the first to the last one, that no device held in hand can have.
const MIN_EQUAL: usize = 11;
const MIN_EQUAL_S: f64 = 2.0;
/// Minimum number of equal poses without times: two seconds of a video.
const MIN_EQUAL_WITHOUT_TIMES: usize = 60;
/// Layouts of robots, whose wheels tell exactly that they stand still.
const OF_ROBOTS: [&str; 2] = ["ros2_bag", "rtabmap"];

/// Detects the layout and checks the contents.
pub(super) fn assemble(container: Box<dyn Container>, tools: &Tools) -> Result<Clip, ClipError> {
    let mut layout = layout::find(container.as_ref())?;
    check_count(&layout)?;
    let source = &layout.sources[0];
    let sizes = Sizes::of(source, container.as_ref(), layout.color_is_turned)?;
    // The sizes are the first frame's, which may have intrinsics of its own.
    let cameras = sizes.cameras(&layout.cameras, source.numbers)?;
    check_views(&cameras.color, &cameras.depth)?;
    let numbers = source.numbers.or(layout.cameras.shared());
    layout.notes.extend(numbers.and_then(|numbers| assumed_size(&numbers, &sizes)));
    let first = First {
        sizes,
        of: numbers.map(|numbers| numbers.of),
        cameras: &layout.cameras,
        color_is_turned: layout.color_is_turned,
    };

    let frames = layout.sources.len();
    let mut headers = Vec::with_capacity(frames);
    let mut pictures = Vec::with_capacity(frames);
    let mut pixels_a_frame = sizes.pixels(&cameras);
    for source in std::mem::take(&mut layout.sources) {
        let own = match first.cameras_of(&source, container.as_ref()) {
            Err(error) if first.has_size_of(&source) || error.is_service_fault() => return Err(error),
            // A frame of another size than the first one's.
            Err(_) => continue,
            Ok(own) => own,
        };
        let Source { number, time_s, world_from_camera, color, depth, confidence, .. } = source;
        pixels_a_frame = pixels_a_frame.max(own.map_or(0, |own| sizes.pixels(&own)));
        let force_in_camera = time_s.and_then(|time_s| layout.forces.around(time_s));
        headers.push(FrameHeader { number, time_s, world_from_camera, force_in_camera });
        pictures.push(Pictures::new(container.as_ref(), color, depth, confidence, own)?);
    }
    if headers.len() < frames {
        let dropped = frames - headers.len();
        layout.notes.push(format!(
            "{dropped} frames of another size than the first one could not be used, and were left out"
        ));
    }
    // Without colour nothing could be tracked.
    if sizes.color.is_some()
        && let Some(reason) = drop_placeholders(&mut headers, layout.name)
    {
        layout.no_pose = Some(reason);
    }
    let info = info(&layout, &headers, &sizes);
    let tools = tools.clone();
    let files = Files {
        container,
        region: layout.region,
        video: layout.video.map(|(name, region)| Video { name, region, tools }),
        color_is_turned: layout.color_is_turned,
        pictures,
        pixels_a_frame,
        cameras,
        depth_units_per_m: layout.depth_units_per_m,
    };
    Ok(Clip::new(info, headers, layout.up_in_world, layout.shutter, Origin::Files(Box::new(files))))
}

/// Returns a note if the intrinsics count the pixels of a picture that is absent.
fn assumed_size(numbers: &Numbers, sizes: &Sizes) -> Option<String> {
    (numbers.of == Of::Color && sizes.color.is_none()).then(|| {
        let (width, height) = numbers.size(None, sizes.depth);
        format!("the intrinsics are those of a colour picture that is absent; its size was assumed as {width}x{height}")
    })
}

/// Refuses a layout without frames, or with too many.
fn check_count(layout: &Layout) -> Result<(), ClipError> {
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
    Ok(())
}

/// Drops poses that are all the identity, or all equal for long, and returns the reason: programs that do not track the
/// camera write one pose in the place of all. A camera that stood still is tracked as well.
fn drop_placeholders(headers: &mut [FrameHeader], layout: &str) -> Option<String> {
    let poses = || headers.iter().filter_map(|header| header.world_from_camera.as_ref());
    let count = poses().count();
    let reason = if count >= MIN_PLACEHOLDERS && poses().all(is_identity) {
        "all poses are the identity, and were not used".to_string()
    } else if !OF_ROBOTS.contains(&layout) && are_equal_for_long(headers) {
        format!(
            "all {count} poses are equal, as without tracking or of a camera that stood still, and were not used"
        )
    } else {
        return None;
    };
    headers.iter_mut().for_each(|header| header.world_from_camera = None);
    Some(reason)
}

/// Returns whether all poses are equal for so long that a device held in hand would have moved.
fn are_equal_for_long(headers: &[FrameHeader]) -> bool {
    let mut posed = headers.iter().filter_map(|header| Some((header.time_s, header.world_from_camera?)));
    let Some((first_s, first)) = posed.next() else { return false };
    let (mut count, mut last_s) = (1, first_s);
    for (time_s, pose) in posed {
        if !is_equal(&pose, &first) {
            return false;
        }
        (count, last_s) = (count + 1, time_s);
    }
    match first_s.zip(last_s) {
        Some((first_s, last_s)) => count >= MIN_EQUAL && last_s - first_s >= MIN_EQUAL_S,
        None => count >= MIN_EQUAL_WITHOUT_TIMES,
    }
}

/// Returns whether two poses differ by rounding only.
fn is_equal(pose: &Pose3, other: &Pose3) -> bool {
    let way = (pose.translation.vector - other.translation.vector).norm();
    let (a, b) = (pose.rotation.coords, other.rotation.coords);
    // Both signs of a quaternion are one rotation.
    way.max((a - b).norm().min((a + b).norm())) < PLACEHOLDER_TOLERANCE
}

/// Returns whether a pose is the identity, also one that was converted from OpenGL's axes.
fn is_identity(pose: &Pose3) -> bool {
    let [x, y, z, w]: [f64; 4] = pose.rotation.coords.map(f64::abs).into();
    // The conversion is half a turn about x.
    let rotation = y.max(z).max(w.min(x));
    rotation.max(pose.translation.vector.norm()) < PLACEHOLDER_TOLERANCE
}

/// Returns the summary of a clip; the sizes are the first frame's.
fn info(layout: &Layout, headers: &[FrameHeader], sizes: &Sizes) -> ClipInfo {
    let time_s = |header: Option<&FrameHeader>| header.and_then(|header| header.time_s);
    let (first_s, last_s) = (time_s(headers.first()), time_s(headers.last()));
    let duration_s = match (first_s, last_s) {
        // Times that run backwards are invalid.
        (Some(from), Some(to)) if to >= from => Some(to - from),
        _ => None,
    };
    let frames = headers.len();
    let frames_with_pose = headers.iter().filter(|header| header.world_from_camera.is_some()).count();
    let missing = missing(frames_with_pose > 0, sizes.color.is_some(), layout);
    let (color_width, color_height) = sizes.color.unwrap_or_default();
    ClipInfo {
        layout: layout.name.to_string(),
        pose_convention: layout.pose_convention.to_string(),
        depth_unit: layout.depth_unit.to_string(),
        gravity: layout.gravity.clone(),
        intrinsics: layout.intrinsics.clone(),
        frames,
        frames_with_pose,
        skipped_without_pose: frames - frames_with_pose,
        skipped_incomplete: layout.incomplete,
        color_width,
        color_height,
        depth_width: sizes.depth.0,
        depth_height: sizes.depth.1,
        duration_s,
        metric: layout.metric,
        recorded_at_ms: first_s.and_then(unix_ms),
        notes: layout.notes.iter().cloned().chain(missing).collect(),
    }
}

/// Refuses depth pictures that are too large.
fn check_depth_size(frame: u32, (width, height): (u32, u32)) -> Result<(), ClipError> {
    if u64::from(width) * u64::from(height) <= depth::MAX_PIXELS {
        return Ok(());
    }
    let name = format!("the depth picture of frame {frame}");
    Err(ClipError::PictureTooLarge { name, width, height, max_pixels: depth::MAX_PIXELS })
}

/// Returns notes about missing colour and poses.
fn missing(has_poses: bool, has_color: bool, layout: &Layout) -> impl Iterator<Item = String> {
    let color =
        (!has_color).then(|| "there are no colour pictures: the clip is aligned by depth alone".to_string());
    let next = if has_color {
        "the camera will be tracked by its pictures"
    } else {
        "the clip has no colour to track the camera by"
    };
    let usual = || {
        format!(
            "no frame has a pose in {} that is a finite rigid motion within 100 km of the origin",
            layout.pose_files
        )
    };
    let poses = (!has_poses).then(|| format!("{}: {next}", layout.no_pose.clone().unwrap_or_else(usual)));
    color.into_iter().chain(poses)
}

/// Returns a time of day in milliseconds. Layouts count seconds since 1970 or since the device's start; times
/// in the years 2000 to 2100 count from 1970, as no device runs for 30 years.
fn unix_ms(time_s: f64) -> Option<i64> {
    (946_684_800.0..4_102_444_800.0).contains(&time_s).then(|| (time_s * 1e3).round() as i64)
}

/// The first frame. Frames with intrinsics for a picture of another size have pictures of other sizes: RTAB-Map's phone
/// may be turned while it records, and COLMAP undistorts each picture by itself.
struct First<'a> {
    sizes: Sizes,
    /// The picture of its intrinsics; `None` for [`Cameras::Each`].
    of: Option<Of>,
    cameras: &'a Cameras,
    color_is_turned: bool,
}

impl First<'_> {
    /// Returns whether a frame's pictures have the sizes of the first frame's.
    fn has_size_of(&self, source: &Source) -> bool {
        self.of.is_none() || source.numbers.is_none_or(|own| Some(own.of) == self.of)
    }

    /// Returns the cameras of a frame with intrinsics of its own.
    fn cameras_of(
        &self,
        source: &Source,
        container: &dyn Container,
    ) -> Result<Option<FrameCameras>, ClipError> {
        let Some(own) = source.numbers else { return Ok(None) };
        let sizes = if self.has_size_of(source) {
            self.sizes
        } else {
            Sizes::of(source, container, self.color_is_turned)?
        };
        sizes.cameras(self.cameras, Some(own)).map(Some)
    }
}

/// Widths and heights of a frame's pictures.
#[derive(Clone, Copy)]
struct Sizes {
    /// `None` without colour.
    color: Option<(u32, u32)>,
    depth: (u32, u32),
}

impl Sizes {
    /// Reads the sizes from the headers of a frame's pictures.
    fn of(source: &Source, container: &dyn Container, color_is_turned: bool) -> Result<Sizes, ClipError> {
        let lying = |(width, height)| if color_is_turned { (height, width) } else { (width, height) };
        let color = source.color.size(container)?.map(lying);
        let depth = source.depth.size(container)?;
        check_depth_size(source.number, depth)?;
        Ok(Sizes { color, depth })
    }

    /// Returns the number of pixels of a frame with these cameras, colour and depth.
    fn pixels(&self, cameras: &FrameCameras) -> u64 {
        let area = |camera: &Pinhole| u64::from(camera.width) * u64::from(camera.height);
        area(&cameras.depth) + self.color.map_or(0, |_| area(&cameras.color))
    }

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
            if layout::differs(aspect(picture), aspect(of), layout::MAX_ASPECT_RATIO) {
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

/// Refuses colour and depth cameras with different views.
fn check_views(color: &Pinhole, depth: &Pinhole) -> Result<(), ClipError> {
    // Width and height of the view at a distance of one metre.
    let view_m = |c: &Pinhole| (f64::from(c.width) / c.fx, f64::from(c.height) / c.fy);
    if layout::views_differ(view_m(color), view_m(depth)) {
        let ((color_x, color_y), (depth_x, depth_y)) = (view_m(color), view_m(depth));
        let reason = format!(
            "at one metre, colour ({}x{}) sees {color_x:.2} x {color_y:.2} m and depth ({}x{}) {depth_x:.2} x {depth_y:.2} m",
            color.width, color.height, depth.width, depth.height
        );
        return Err(ClipError::ColorDepthMismatch { reason });
    }
    Ok(())
}
