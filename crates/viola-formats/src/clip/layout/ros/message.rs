//! The messages that make a clip (ros2/common_interfaces and ros2/geometry2).

use super::cdr::Cdr;
use crate::clip::ClipError;
use crate::clip::files::Coding;
use crate::clip::layout::text::pose_from_quaternion;
use crate::clip::layout::trajectory::Timed;
use crate::clip::picture;
use crate::clip::rows::{Encoding, Rows};
use nalgebra::Quaternion;
use std::ops::Range;
use viola_geometry::{Pose3, Vector3};

/// Maximum size of one message: a picture.
pub(super) const MAX_MESSAGE_BYTES: u64 = 64 << 20;
pub(super) const MAX_TOPICS: usize = 1000;
/// Maximum transforms of one message.
const MAX_TRANSFORMS: u32 = 10_000;
/// Maximum length of a frame's name.
const MAX_FRAME_BYTES: usize = 255;
/// Bytes before compressed depth: a kind and two parameters (compressed_depth_image_transport,
/// compression_common.hpp).
const DEPTH_HEADER_BYTES: usize = 12;

/// Advice for recordings of ROS 1.
pub(super) const ROS_1_ADVICE: &str =
    "convert the bag to ROS 2 (`pip install rosbags`, then `rosbags-convert --src FILE.bag --dst FOLDER`)";

/// The function that is called with each message: topic, kind, bytes.
pub(super) type Visit<'a> = &'a mut dyn FnMut(&str, Kind, &[u8]) -> Result<(), ClipError>;

/// A kind of message that is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Image,
    CompressedImage,
    CameraInfo,
    Odometry,
    PoseStamped,
    Transforms,
}

impl Kind {
    /// Returns the kind of a type's name, which some writers give without `msg`.
    pub fn of(name: &str) -> Option<Kind> {
        Some(match name.replace("/msg/", "/").as_str() {
            "sensor_msgs/Image" => Kind::Image,
            "sensor_msgs/CompressedImage" => Kind::CompressedImage,
            "sensor_msgs/CameraInfo" => Kind::CameraInfo,
            "nav_msgs/Odometry" => Kind::Odometry,
            "geometry_msgs/PoseStamped" | "geometry_msgs/PoseWithCovarianceStamped" => Kind::PoseStamped,
            "tf2_msgs/TFMessage" => Kind::Transforms,
            _ => return None,
        })
    }
}

/// A message's time and frame of reference.
pub(super) struct Header {
    pub time_s: f64,
    pub frame: String,
}

fn header(cdr: &mut Cdr) -> Option<Header> {
    let (seconds, nanoseconds) = (cdr.u32()? as i32, cdr.u32()?);
    let time_s = f64::from(seconds) + f64::from(nanoseconds) * 1e-9;
    Some(Header { time_s, frame: frame(cdr)? })
}

/// Returns a frame's name; old ones begin with a slash.
fn frame(cdr: &mut Cdr) -> Option<String> {
    let name = cdr.text()?.trim_start_matches('/');
    (name.len() <= MAX_FRAME_BYTES).then(|| name.to_string())
}

/// A picture inside of a message.
pub(super) struct Image {
    pub header: Header,
    pub is_depth: bool,
    pub size: (u32, u32),
    pub coding: Coding,
    /// Place of the picture's bytes in the message.
    pub data: Range<usize>,
}

/// Parses a bare picture. `None` is a damaged message; the inner error is the reason why the picture cannot be read.
pub(super) fn image(message: &[u8]) -> Option<Result<Image, String>> {
    let mut cdr = Cdr::new(message)?;
    let header = header(&mut cdr)?;
    let (height, width) = (cdr.u32()?, cdr.u32()?);
    let encoding = cdr.text()?;
    let is_big_endian = cdr.u8()? != 0;
    let stride = cdr.u32()?;
    let data = range(message, cdr.bytes()?);
    Some(rows(encoding, (width, height), stride, is_big_endian, data.len()).map(|rows| Image {
        header,
        is_depth: rows.encoding.is_depth(),
        size: (width, height),
        coding: Coding::Rows(rows),
        data,
    }))
}

/// Returns the rows of a bare picture that has this number of bytes, or the reason why it cannot be read.
fn rows(
    encoding: &str,
    (width, height): (u32, u32),
    stride: u32,
    is_big_endian: bool,
    bytes: usize,
) -> Result<Rows, String> {
    let known = Encoding::of(encoding).ok_or_else(|| format!("its encoding {encoding:.40} is not read"))?;
    // Another camera of the robot, or a placeholder before its first picture.
    picture::check_pixels("it", width, height).map_err(reason)?;
    let rows = Rows { encoding: known, is_big_endian, width, height, stride };
    let wanted = rows
        .bytes()
        .ok_or_else(|| format!("its step is {stride} bytes, and a row has {width} pixels of {encoding}"))?;
    if wanted > bytes as u64 {
        return Err(format!("it has {bytes} bytes instead of {wanted}"));
    }
    Ok(rows)
}

/// Returns why a picture cannot be read, without the advice for a picture that is a file.
fn reason(error: ClipError) -> String {
    match error {
        ClipError::BadPicture { reason, .. } => reason,
        error => error.to_string(),
    }
}

/// Parses a compressed picture, as [`image`] does a bare one.
pub(super) fn compressed_image(message: &[u8]) -> Option<Result<Image, String>> {
    let mut cdr = Cdr::new(message)?;
    let header = header(&mut cdr)?;
    let format = cdr.text()?;
    let bytes = cdr.bytes()?;
    let packed =
        if format.contains("compressedDepth") { packed_depth(format, bytes) } else { packed_picture(bytes) };
    Some(packed.map(|Packed { is_depth, size, coding, bytes }| Image {
        header,
        is_depth,
        size,
        coding,
        data: range(message, bytes),
    }))
}

/// A compressed picture without its message.
struct Packed<'a> {
    is_depth: bool,
    size: (u32, u32),
    coding: Coding,
    bytes: &'a [u8],
}

/// Returns a JPEG or PNG, or the reason why it cannot be read.
fn packed_picture(bytes: &[u8]) -> Result<Packed<'_>, String> {
    let size = picture::size_of(bytes, "it").map_err(reason)?;
    Ok(Packed { is_depth: picture::is_grey16(bytes), size, coding: Coding::Picture, bytes })
}

/// Returns the depth behind the parameters of `compressedDepth`, or the reason why it cannot be read.
fn packed_depth<'a>(format: &str, bytes: &'a [u8]) -> Result<Packed<'a>, String> {
    let cut = "it ends too early";
    let (parameters, packed) = bytes.split_at_checked(DEPTH_HEADER_BYTES).ok_or(cut)?;
    let parameters: Vec<f32> =
        parameters.as_chunks().0.iter().map(|value| f32::from_le_bytes(*value)).collect();
    let is_inverse = format.starts_with("32FC1");
    if format.contains("rvl") {
        // Inverse depth in RVL is possible, but no recording of it is known.
        if is_inverse {
            return Err("inverse depth that is packed by RVL is not read".to_string());
        }
        let (size, bytes) = packed.split_at_checked(8).ok_or(cut)?;
        let side = |at: usize| size[at..].first_chunk().map_or(0, |side| u32::from_le_bytes(*side));
        let size = picture::check_pixels("it", side(0), side(4)).map_err(reason)?;
        return Ok(Packed { is_depth: true, size, coding: Coding::Rvl(size), bytes });
    }
    let size = picture::size_of(packed, "it").map_err(reason)?;
    let inverse = Coding::InversePicture { a: parameters[1], b: parameters[2] };
    let coding = if is_inverse { inverse } else { Coding::Picture };
    Ok(Packed { is_depth: true, size, coding, bytes: packed })
}

/// Returns the place of a part of a message.
fn range(message: &[u8], part: &[u8]) -> Range<usize> {
    let from = part.as_ptr() as usize - message.as_ptr() as usize;
    from..from + part.len()
}

/// A camera's intrinsics.
pub(super) struct CameraInfo {
    pub frame: String,
    pub size: (u32, u32),
    /// fx, fy, cx, cy of the picture as the camera took it.
    pub raw: [f64; 4],
    /// The same of the rectified picture.
    pub rectified: [f64; 4],
    pub is_distorted: bool,
}

pub(super) fn camera_info(message: &[u8]) -> Option<CameraInfo> {
    let mut cdr = Cdr::new(message)?;
    let Header { frame, .. } = header(&mut cdr)?;
    let (height, width) = (cdr.u32()?, cdr.u32()?);
    let _model = cdr.text()?;
    let mut is_distorted = false;
    for _ in 0..cdr.u32()? {
        let [value] = cdr.f64s()?;
        is_distorted |= value != 0.0;
    }
    let k: [f64; 9] = cdr.f64s()?;
    let _rotation: [f64; 9] = cdr.f64s()?;
    let p: [f64; 12] = cdr.f64s()?;
    let raw = [k[0], k[4], k[2], k[5]];
    let rectified = if p[0] > 0.0 { [p[0], p[5], p[2], p[6]] } else { raw };
    Some(CameraInfo { frame, size: (width, height), raw, rectified, is_distorted })
}

/// A pose of a child frame in a parent frame. Poses that are no rigid motion are `None`.
pub(super) struct Transform {
    pub parent: String,
    pub child: String,
    pub pose: Option<Timed<Pose3>>,
}

/// Parses an odometry message.
pub(super) fn odometry(message: &[u8]) -> Option<Transform> {
    let mut cdr = Cdr::new(message)?;
    let header = header(&mut cdr)?;
    let child = frame(&mut cdr)?;
    transform(&mut cdr, header, child)
}

/// Parses a pose with a header; its child frame has no name.
pub(super) fn pose_stamped(message: &[u8]) -> Option<Transform> {
    let mut cdr = Cdr::new(message)?;
    let header = header(&mut cdr)?;
    transform(&mut cdr, header, String::new())
}

/// Parses a list of transforms.
pub(super) fn transforms(message: &[u8]) -> Option<Vec<Transform>> {
    let mut cdr = Cdr::new(message)?;
    let count = cdr.u32()?;
    if count > MAX_TRANSFORMS {
        return None;
    }
    let mut transforms = Vec::new();
    for _ in 0..count {
        let header = header(&mut cdr)?;
        let child = frame(&mut cdr)?;
        transforms.push(transform(&mut cdr, header, child)?);
    }
    Some(transforms)
}

fn transform(cdr: &mut Cdr, header: Header, child: String) -> Option<Transform> {
    let [x, y, z, qx, qy, qz, qw] = cdr.f64s()?;
    let value = pose_from_quaternion(Quaternion::new(qw, qx, qy, qz), Vector3::new(x, y, z));
    let pose = value.map(|value| Timed { time_s: header.time_s, value });
    Some(Transform { parent: header.frame, child, pose })
}
