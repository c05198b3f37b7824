//! COLMAP's sparse model: cameras and the poses of images, as text or binary. Its points are not used.

use super::super::text::{Table, pose_from_quaternion, read_table};
use super::super::{ClipError, Numbers, Of};
use crate::clip::MAX_FRAMES;
use crate::container::Container;
use nalgebra::Quaternion;
use std::collections::BTreeMap;
use viola_geometry::{Pose3, Vector3};

/// The binary file of images holds 24 bytes for each point in each picture.
const MAX_IMAGES_BYTES: u64 = 96 << 20;
const MAX_CAMERAS_BYTES: u64 = 16 << 20;
/// Bytes of a point of an image.
const POINT_BYTES: usize = 24;
const MAX_NAME_BYTES: usize = 255;

/// Name of a camera model, the number of its parameters, and the number of its focal lengths. The place in the list
/// is its number in binary files (src/colmap/sensor/models.h).
const CAMERA_MODELS: [(&str, usize, usize); 11] = [
    ("SIMPLE_PINHOLE", 3, 1),
    ("PINHOLE", 4, 2),
    ("SIMPLE_RADIAL", 4, 1),
    ("RADIAL", 5, 1),
    ("OPENCV", 8, 2),
    ("OPENCV_FISHEYE", 8, 2),
    ("FULL_OPENCV", 12, 2),
    ("FOV", 5, 2),
    ("SIMPLE_RADIAL_FISHEYE", 4, 1),
    ("RADIAL_FISHEYE", 5, 1),
    ("THIN_PRISM_FISHEYE", 12, 2),
];

/// Cameras by their numbers, and images.
pub(super) struct Model {
    pub cameras: BTreeMap<u32, Numbers>,
    pub images: Vec<Image>,
}

/// An image of the model.
pub(super) struct Image {
    pub name: String,
    pub camera: u32,
    /// `None` if it is not a finite rigid motion.
    pub world_from_camera: Option<Pose3>,
}

impl Model {
    pub fn read(container: &dyn Container, folder: &str, is_binary: bool) -> Result<Model, ClipError> {
        let file = |kind: &str| format!("{folder}{kind}.{}", if is_binary { "bin" } else { "txt" });
        let (cameras, images) = (file("cameras"), file("images"));
        if !container.contains(&cameras) {
            return Err(ClipError::MissingIntrinsics { name: cameras });
        }
        if is_binary {
            let of_cameras = container.read(&cameras, MAX_CAMERAS_BYTES)?;
            let of_images = container.read(&images, MAX_IMAGES_BYTES)?;
            return Ok(Model {
                cameras: Bytes::new(&of_cameras, &cameras).cameras()?,
                images: Bytes::new(&of_images, &images).images()?,
            });
        }
        Ok(Model {
            cameras: text_cameras(&read_table(container, &cameras)?, &cameras)?,
            images: text_images(&read_table(container, &images)?, &images)?,
        })
    }
}

/// Returns the intrinsics of a camera; `None` if they are not those of its model. Distortion is ignored: a dense
/// workspace has undistorted pictures.
fn numbers(model: usize, size: [u64; 2], parameters: &[f64]) -> Option<Numbers> {
    let (_, count, focals) = CAMERA_MODELS.get(model)?;
    if parameters.len() != *count || !parameters.iter().all(|value| value.is_finite()) {
        return None;
    }
    let [width, height] = size.map(u32::try_from);
    let of = Of::Size(width.ok().filter(|width| *width > 0)?, height.ok().filter(|height| *height > 0)?);
    let (fx, fy) = (parameters[0], parameters[*focals - 1]);
    Some(Numbers { fx, fy, cx: parameters[*focals], cy: parameters[*focals + 1], of })
}

fn image(rotation: [f64; 4], translation: [f64; 3], camera: u32, name: String) -> Image {
    let [w, x, y, z] = rotation;
    let camera_from_world = pose_from_quaternion(Quaternion::new(w, x, y, z), Vector3::from(translation));
    Image { name, camera, world_from_camera: camera_from_world.map(|pose| pose.inverse()) }
}

fn text_cameras(table: &Table, name: &str) -> Result<BTreeMap<u32, Numbers>, ClipError> {
    let camera = |row: &str| {
        let words: Vec<&str> = row.split_whitespace().collect();
        let [id, model, width, height, parameters @ ..] = words.as_slice() else { return None };
        let model = CAMERA_MODELS.iter().position(|(known, ..)| known == model)?;
        let parameters: Vec<f64> = parameters.iter().map(|word| word.parse().ok()).collect::<Option<_>>()?;
        Some((id.parse().ok()?, numbers(model, [width.parse().ok()?, height.parse().ok()?], &parameters)?))
    };
    table
        .rows()
        .map(|(line, row)| {
            camera(row).ok_or_else(|| bad_line(name, line, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS"))
        })
        .collect()
}

/// Each image has two lines, and the second, its points, may be empty: lines that end in a name are images.
fn text_images(table: &Table, name: &str) -> Result<Vec<Image>, ClipError> {
    let parsed = |row: &str| {
        let mut words = row.splitn(10, ' ');
        let mut next = || words.next().and_then(|word| word.parse::<f64>().ok());
        let (id, q) = (next()?, [next()?, next()?, next()?, next()?]);
        let (t, camera) = ([next()?, next()?, next()?], next()?);
        let name = words.next()?.trim();
        let is_id = |value: f64| value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value);
        let is_unit = (q.iter().map(|value| value * value).sum::<f64>() - 1.0).abs() < 0.1;
        let is_image = is_id(id) && is_id(camera) && is_unit && name.len() <= MAX_NAME_BYTES;
        is_image.then(|| image(q, t, camera as u32, name.to_string()))
    };
    let mut all = table.rows().filter_map(|(_, row)| parsed(row));
    let images: Vec<Image> = all.by_ref().take(MAX_FRAMES).collect();
    if images.is_empty() {
        return Err(bad_line(name, 1, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"));
    }
    match all.count() {
        0 => Ok(images),
        more => Err(ClipError::TooManyFrames { frames: MAX_FRAMES + more, max: MAX_FRAMES }),
    }
}

fn bad_line(name: &str, line: usize, form: &str) -> ClipError {
    ClipError::BadIndex { name: name.to_string(), line, reason: format!("expected {form}") }
}

/// The rest of a binary file.
struct Bytes<'a> {
    rest: &'a [u8],
    name: &'a str,
}

impl<'a> Bytes<'a> {
    fn new(rest: &'a [u8], name: &'a str) -> Bytes<'a> {
        Bytes { rest, name }
    }

    fn bad(&self, reason: &str) -> ClipError {
        ClipError::BadMetadata { name: self.name.to_string(), reason: reason.to_string() }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ClipError> {
        let (taken, rest) =
            self.rest.split_first_chunk::<N>().ok_or_else(|| self.bad("it ends too early"))?;
        self.rest = rest;
        Ok(*taken)
    }

    fn u32(&mut self) -> Result<u32, ClipError> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn u64(&mut self) -> Result<u64, ClipError> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], ClipError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.take()?);
        }
        Ok(numbers)
    }

    /// Skips bytes that the file must have.
    fn skip(&mut self, bytes: Option<usize>) -> Result<(), ClipError> {
        let rest = bytes.and_then(|bytes| self.rest.get(bytes..));
        self.rest = rest.ok_or_else(|| self.bad("it ends too early"))?;
        Ok(())
    }

    fn cameras(mut self) -> Result<BTreeMap<u32, Numbers>, ClipError> {
        let mut cameras = BTreeMap::new();
        for _ in 0..self.u64()? {
            let (id, model) = (self.u32()?, self.u32()? as usize);
            let size = [self.u64()?, self.u64()?];
            let count = CAMERA_MODELS.get(model).map_or(0, |(_, count, _)| *count);
            let mut parameters = Vec::with_capacity(count);
            for _ in 0..count {
                let [parameter] = self.numbers()?;
                parameters.push(parameter);
            }
            let numbers = numbers(model, size, &parameters);
            cameras
                .insert(id, numbers.ok_or_else(|| self.bad(&format!("camera {id} is of no known model")))?);
        }
        Ok(cameras)
    }

    fn images(mut self) -> Result<Vec<Image>, ClipError> {
        let mut images = Vec::new();
        let count = self.u64()?;
        for _ in 0..count {
            // The file has room for more than a million.
            if images.len() == MAX_FRAMES {
                let frames = usize::try_from(count).unwrap_or(usize::MAX);
                return Err(ClipError::TooManyFrames { frames, max: MAX_FRAMES });
            }
            self.u32()?;
            let (rotation, translation) = (self.numbers()?, self.numbers()?);
            let camera = self.u32()?;
            let end = self.rest.iter().take(MAX_NAME_BYTES + 1).position(|byte| *byte == 0);
            let name = end.and_then(|end| std::str::from_utf8(&self.rest[..end]).ok());
            let name = name.ok_or_else(|| self.bad("the name of an image is not text"))?.to_string();
            self.skip(Some(name.len() + 1))?;
            let points = usize::try_from(self.u64()?).ok();
            self.skip(points.and_then(|points| points.checked_mul(POINT_BYTES)))?;
            images.push(image(rotation, translation, camera, name));
        }
        Ok(images)
    }
}
