//! A clip whose pictures lie in a container: their places, and the decoding of frames.

use super::rendered::Cloud;
use super::rows::Rows;
use super::{ClipError, Frame, FrameHeader, colmap_depth, depth, npy, picture};
use crate::container::{Container, ContainerError, Region};
use crate::video::Tools;
use image::{RgbImage, imageops};
use std::sync::Arc;
use viola_geometry::{Pinhole, Pose3};

/// Maximum number of files with one name and different endings that are looked through: it bounds the time of a hostile
/// archive.
const MAX_ENDINGS: usize = 64;

/// Returns whether a name has this ending, in letters of any case: cameras write `.JPG`.
pub(super) fn has_ending(name: &str, ending: &str) -> bool {
    let start = name.len().checked_sub(ending.len());
    start.and_then(|start| name.get(start..)).is_some_and(|own| own.eq_ignore_ascii_case(ending))
}

/// Returns the name of the file that is called `name`, or else of one whose ending differs only in the case of its letters.
pub(super) fn find_file(container: &dyn Container, name: &str) -> Option<String> {
    if container.contains(name) {
        return Some(name.to_string());
    }
    let dot = name.rfind('.').filter(|dot| !name[*dot..].contains('/'))?;
    let mut others = names_from(container, &name[..=dot]).take(MAX_ENDINGS);
    others.find(|other| other.eq_ignore_ascii_case(name)).cloned()
}

/// Returns the names that begin with a folder or with a part of a name, in their order.
pub(super) fn names_from<'a>(container: &'a dyn Container, start: &str) -> impl Iterator<Item = &'a String> {
    let names = container.names();
    let first = names.partition_point(|name| name.as_str() < start);
    names[first..].iter().take_while(move |name| name.starts_with(start))
}

/// Place of a frame's colour picture.
#[derive(Debug, Clone)]
pub(super) enum ColorAt {
    /// A file, JPEG or PNG.
    File(String),
    /// A part of the clip's one large file.
    Part { part: Part, size: (u32, u32) },
    /// A frame of the clip's video, numbered in presentation order; `size` is the video's.
    Video { frame: u32, size: (u32, u32) },
    /// The clip has no colour.
    Absent,
}

/// Place of a frame's depth.
#[derive(Debug, Clone)]
pub(super) enum DepthAt {
    /// A file, PNG with 16 bits of grey.
    Png(String),
    /// A file, NumPy's array.
    Npy(String, npy::Allowed),
    /// A file, LZFSE of 32-bit floats in metres; `size` if it is known. `is_wide` as colour is.
    Floats { name: String, size: Option<(u32, u32)>, is_wide: bool },
    /// A file, COLMAP's array of 32-bit floats.
    Colmap(String),
    /// The depth that a camera at this pose has of a point cloud.
    Rendered { cloud: Arc<Cloud>, world_from_camera: Pose3, size: (u32, u32) },
    /// A part of the clip's one large file.
    Part { part: Part, size: (u32, u32) },
}

/// A picture inside of a large file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub at: u64,
    pub bytes: u32,
    pub coding: Coding,
    /// The frame's number, for messages.
    pub number: u32,
    /// Bytes of the depth's confidence, which lies right behind the picture; 0 without any.
    pub confidence_bytes: u32,
}

/// Encoding of a part.
#[derive(Debug, Clone, Copy)]
pub(super) enum Coding {
    /// A JPEG or PNG file; depth is a PNG with 16 bits of grey.
    Picture,
    /// Pixels of a picture of this width and height, row by row.
    Raw((u32, u32)),
    /// Readings of 16 bits, packed with zlib.
    Zlib,
    /// Readings of 16 bits of a picture of this width and height, packed with RVL.
    Rvl((u32, u32)),
    /// A PNG whose four channels are the bytes of 32-bit floats in metres.
    FloatPicture,
    /// A PNG with 16 bits of inverse depth: `a / (reading - b)` metres.
    InversePicture { a: f32, b: f32 },
    /// Bare pixels of a stride.
    Rows(Rows),
}

impl Part {
    pub fn read(&self, region: Option<&Region>, kind: &str) -> Result<Vec<u8>, ClipError> {
        let name = self.name(kind);
        let region =
            region.ok_or_else(|| ClipError::BadMetadata { name: name.clone(), reason: "lost".into() })?;
        let mut bytes = vec![0; self.bytes as usize];
        region
            .read_exact_at(self.at, &mut bytes)
            .map_err(|source| ContainerError::Unreadable { name, source })?;
        Ok(bytes)
    }

    /// Returns the confidence of the depth; `None` without any.
    pub fn read_confidence(&self, region: Option<&Region>) -> Result<Option<Vec<u8>>, ClipError> {
        if self.confidence_bytes == 0 {
            return Ok(None);
        }
        let behind = Part { at: self.at + u64::from(self.bytes), bytes: self.confidence_bytes, ..*self };
        behind.read(region, "confidence").map(Some)
    }

    pub fn name(&self, kind: &str) -> String {
        format!("the {kind} of frame {}", self.number)
    }
}

impl ColorAt {
    /// Returns width and height, from the picture's header; `None` without a picture.
    pub fn size(&self, container: &dyn Container) -> Result<Option<(u32, u32)>, ClipError> {
        match self {
            ColorAt::File(name) => picture::size(container, name).map(Some),
            ColorAt::Part { size, .. } | ColorAt::Video { size, .. } => Ok(Some(*size)),
            ColorAt::Absent => Ok(None),
        }
    }
}

impl DepthAt {
    /// Returns width and height, from the picture's header.
    pub fn size(&self, container: &dyn Container) -> Result<(u32, u32), ClipError> {
        match self {
            DepthAt::Png(name) => picture::size(container, name),
            DepthAt::Npy(name, allowed) => npy::size(container, name, *allowed),
            DepthAt::Floats { name, size, is_wide } => depth::floats_size(container, name, *size, *is_wide),
            DepthAt::Colmap(name) => colmap_depth::size(container, name),
            DepthAt::Part { size, .. } | DepthAt::Rendered { size, .. } => Ok(*size),
        }
    }
}

/// The two cameras of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cameras {
    pub color: Pinhole,
    pub depth: Pinhole,
}

/// The pictures of a frame in about fifty bytes: files are indices into the container's names.
pub(super) struct Pictures {
    color: Option<Place>,
    depth: DepthPlace,
    confidence: Option<u32>,
    /// The frame's own cameras, if it has any.
    cameras: Option<Box<Cameras>>,
}

/// A picture without its name.
enum Place {
    File(u32),
    Part(Box<Part>),
    /// The number of the video's frame.
    Video(u32),
}

enum DepthPlace {
    Png(u32),
    Npy(u32, npy::Allowed),
    Floats(u32),
    Colmap(u32),
    Rendered(Arc<Cloud>, Box<Pose3>),
    Part(Box<Part>),
}

impl Pictures {
    /// Looks up the names; a missing one is an error.
    pub fn new(
        container: &dyn Container,
        color: ColorAt,
        depth: DepthAt,
        confidence: Option<String>,
        cameras: Option<Cameras>,
    ) -> Result<Pictures, ContainerError> {
        let names = container.names();
        let place = |name: String| match names.binary_search(&name) {
            Ok(place) => Ok(place as u32),
            Err(_) => Err(ContainerError::Missing { name }),
        };
        Ok(Pictures {
            color: match color {
                ColorAt::File(name) => Some(Place::File(place(name)?)),
                ColorAt::Part { part, .. } => Some(Place::Part(Box::new(part))),
                ColorAt::Video { frame, .. } => Some(Place::Video(frame)),
                ColorAt::Absent => None,
            },
            depth: match depth {
                DepthAt::Png(name) => DepthPlace::Png(place(name)?),
                DepthAt::Npy(name, allowed) => DepthPlace::Npy(place(name)?, allowed),
                DepthAt::Colmap(name) => DepthPlace::Colmap(place(name)?),
                DepthAt::Floats { name, .. } => DepthPlace::Floats(place(name)?),
                DepthAt::Rendered { cloud, world_from_camera, .. } => {
                    DepthPlace::Rendered(cloud, Box::new(world_from_camera))
                }
                DepthAt::Part { part, .. } => DepthPlace::Part(Box::new(part)),
            },
            confidence: confidence.map(place).transpose()?,
            cameras: cameras.map(Box::new),
        })
    }

    /// Returns the number of the video's frame with the colour, if colour is a video.
    pub fn video_frame(&self) -> Option<usize> {
        match self.color {
            Some(Place::Video(frame)) => Some(frame as usize),
            _ => None,
        }
    }
}

pub(super) struct Video {
    pub name: String,
    pub region: Region,
    pub tools: Tools,
}

/// The clip's container, and the data common to all frames.
pub(super) struct Files {
    pub container: Box<dyn Container>,
    /// The large file that contains the [`Part`]s.
    pub region: Option<Region>,
    /// The video with the colour, and its decoding tools.
    pub video: Option<Video>,
    /// True if the pictures and the video's frames are turned clockwise by a quarter beside the colour camera.
    pub color_is_turned: bool,
    pub pictures: Vec<Pictures>,
    /// Pixels of the largest frame, colour and depth.
    pub pixels_a_frame: u64,
    pub cameras: Cameras,
    pub depth_units_per_m: f32,
}

impl Files {
    /// Decodes a frame; `of_video` is its colour if colour is a video.
    pub fn load(
        &self,
        index: usize,
        header: &FrameHeader,
        of_video: Option<Result<RgbImage, ClipError>>,
    ) -> Result<Frame, ClipError> {
        let Pictures { color, depth, confidence, cameras } = &self.pictures[index];
        let container = self.container.as_ref();
        let name = |place: &u32| container.names()[*place as usize].as_str();
        let cameras = cameras.as_deref().unwrap_or(&self.cameras);
        let Pinhole { width, height, .. } = cameras.color;
        let (width, height) = if self.color_is_turned { (height, width) } else { (width, height) };
        let stored = Pinhole { width, height, ..cameras.color };
        let color = match color {
            None => None,
            Some(Place::File(place)) => {
                let name = name(place);
                Some(picture::decode_color(&picture::read(container, name)?, name, &stored)?)
            }
            Some(Place::Video(frame)) => {
                Some(of_video.unwrap_or(Err(ClipError::VideoEnded { frame: *frame }))?)
            }
            Some(Place::Part(part)) => {
                let bytes = part.read(self.region.as_ref(), "colour")?;
                Some(part.decode_color(bytes, &stored)?)
            }
        };
        let color = if self.color_is_turned { color.as_ref().map(imageops::rotate270) } else { color };
        let mut depth = match depth {
            DepthPlace::Png(place) => {
                let name = name(place);
                let metres = |units| depth::metres(units, self.depth_units_per_m);
                picture::decode_depth(&picture::read(container, name)?, name, &cameras.depth, metres)?
            }
            DepthPlace::Npy(place, allowed) => {
                npy::decode(container, name(place), *allowed, &cameras.depth, self.depth_units_per_m)?
            }
            DepthPlace::Part(part) => {
                let bytes = part.read(self.region.as_ref(), "depth")?;
                let mut depth = part.decode_depth(&bytes, &cameras.depth, self.depth_units_per_m)?;
                if let Some(packed) = part.read_confidence(self.region.as_ref())? {
                    depth::drop_doubtful_of(&packed, &part.name("confidence"), &mut depth)?;
                }
                depth
            }
            DepthPlace::Colmap(place) => colmap_depth::decode(container, name(place), &cameras.depth)?,
            DepthPlace::Rendered(cloud, world_from_camera) => cloud.depth(&cameras.depth, world_from_camera),
            DepthPlace::Floats(place) => depth::decode_floats(container, name(place), &cameras.depth)?,
        };
        if let Some(place) = confidence {
            depth::drop_doubtful(container, name(place), &mut depth)?;
        }
        Ok(Frame {
            header: header.clone(),
            color_camera: cameras.color,
            color,
            depth_camera: cameras.depth,
            depth,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Names(Vec<String>);

    impl Container for Names {
        fn names(&self) -> &[String] {
            &self.0
        }

        fn read(&self, name: &str, _max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
            Err(ContainerError::Missing { name: name.to_string() })
        }

        fn region(&self, name: &str, _max_bytes: u64) -> Result<Region, ContainerError> {
            Err(ContainerError::Missing { name: name.to_string() })
        }
    }

    #[test]
    fn files_are_found_by_endings_in_any_case() {
        let mut names =
            ["a.d/b", "a/1.JPG", "a/1.depth.png", "a/10.jpg", "a/2.JPG", "a/2.jpg", "a/3.Jpeg", "é.PNG"]
                .map(str::to_string)
                .to_vec();
        names.sort_unstable();
        let container = Names(names);
        for (name, found) in [
            ("a/1.jpg", Some("a/1.JPG")),
            ("a/1.DEPTH.png", None),
            ("a/1.depth.PNG", Some("a/1.depth.png")),
            ("a/2.jpg", Some("a/2.jpg")),
            ("a/2.JPG", Some("a/2.JPG")),
            ("a/3.jpeg", Some("a/3.Jpeg")),
            ("a/3.jpg", None),
            ("A/3.jpeg", None),
            ("a.D/b", None),
            ("a.", None),
            ("a", None),
            ("", None),
            ("é.png", Some("é.PNG")),
        ] {
            assert_eq!(find_file(&container, name).as_deref(), found, "{name}");
        }
    }

    #[test]
    fn endings_are_told_in_any_case() {
        for (name, ending, is_told) in [
            ("bag_0.MCAP", ".mcap", true),
            ("bag_0.db3", ".db3", true),
            ("db", ".db", false),
            ("a.db3", ".db", false),
            ("éa", "xa", false),
            ("", "", true),
        ] {
            assert_eq!(has_ending(name, ending), is_told, "{name}");
        }
    }
}
