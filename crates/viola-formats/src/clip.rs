//! A recorded RGB-D clip: what was understood of it, and its frames, one at a time.
//!
//! [`Clip::open`] finds the layout by content, reads the small text files (poses, intrinsics, indices) and
//! keeps them; pictures stay in their container until [`Clip::load`] asks for one, so memory does not grow
//! with the clip's length beyond a hundred bytes a frame.

mod assemble;
mod depth;
mod error;
mod files;
mod layout;
mod npy;
mod part;
mod picture;
mod stream;
mod up;
pub mod write;

pub use error::ClipError;
pub use stream::FrameStream;
pub use up::Up;

use crate::container::{self, Container};
use crate::video::Tools;
use serde::{Deserialize, Serialize};
use std::path::Path;
use viola_geometry::{Pinhole, Pose3, Vector3};

/// Frames of one clip.
const MAX_FRAMES: usize = 100_000;

/// What was understood of a clip, told to whoever sent it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct ClipInfo {
    /// Layout by name, for example `stray_scanner`, `record3d`, `polycam`, `scannet`, `tum_rgbd`.
    pub layout: String,
    /// Direction and camera axes of the poses as the files have them, for example
    /// `camera-to-world, OpenCV (x right, y down, z forward)`.
    pub pose_convention: String,
    /// Unit of the depth pictures, for example `millimetres (16-bit PNG)`.
    pub depth_unit: String,
    /// Which way is up and how it is known, for example `world z (layout)` or `unknown`.
    pub gravity: String,
    /// Where the intrinsics come from.
    pub intrinsics: String,
    /// Frames with both pictures.
    pub frames: usize,
    /// Frames with a finite pose.
    pub frames_with_pose: usize,
    /// Frames that cannot be used because their pose is missing or not a finite rigid motion.
    pub skipped_without_pose: usize,
    /// Frames left out because one of their pictures is missing.
    pub skipped_incomplete: usize,
    pub color_width: u32,
    pub color_height: u32,
    pub depth_width: u32,
    pub depth_height: u32,
    /// Seconds from the first to the last frame, when the layout has times.
    pub duration_s: Option<f64>,
    /// When the first frame was recorded, in milliseconds since 1970 UTC, when the layout has times of day.
    pub recorded_at_ms: Option<i64>,
    /// Anything else worth telling: assumptions made, files ignored.
    pub notes: Vec<String>,
}

/// What is known of a frame without decoding its pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameHeader {
    /// The number that the layout gives the frame; `--frames` counts in it.
    pub number: u32,
    pub time_s: Option<f64>,
    /// Finite, with a unit rotation; none where the capture has none.
    pub world_from_camera: Option<Pose3>,
    /// What the accelerometer felt around then, in the camera's axes and any unit: against gravity, when at rest.
    pub force_in_camera: Option<Vector3>,
}

/// How long cameras take to read their pictures, from the first row to the last: what moves meanwhile leans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shutter {
    pub color_s: f64,
    pub depth_s: f64,
}

/// A decoded frame. The colour camera and the depth camera share one pose.
#[derive(Debug, Clone)]
pub struct Frame {
    pub header: FrameHeader,
    pub color_camera: Pinhole,
    pub color: image::RgbImage,
    pub depth_camera: Pinhole,
    pub depth: DepthImage,
}

/// Metric depth along z, row after row from the top; 0 where there is no reading.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    pub width: u32,
    pub height: u32,
    pub depth_m: Vec<f32>,
}

impl DepthImage {
    pub fn at(&self, x: u32, y: u32) -> f32 {
        self.depth_m[(y * self.width + x) as usize]
    }
}

/// An opened clip. Frames are loaded one by one, from several threads at once where that helps.
pub struct Clip {
    info: ClipInfo,
    frames: Vec<FrameHeader>,
    up_in_world: Option<Vector3>,
    shutter: Option<Shutter>,
    origin: Origin,
}

/// Where frames come from.
enum Origin {
    Files(Box<files::Files>),
    Memory(Box<dyn Fn(usize) -> Frame + Send + Sync>),
}

impl Clip {
    /// Opens a folder, an archive or a file and finds the layout by content, wherever its root lies inside.
    /// Reads poses, intrinsics and indices, and the headers of the first pictures. Video is decoded on the thread that
    /// asks for it, which is for files that are trusted.
    pub fn open(path: &Path) -> Result<Clip, ClipError> {
        Clip::open_with(path, &Tools::default())
    }

    /// The same for files of strangers: video is decoded by other processes.
    pub fn open_with(path: &Path, tools: &Tools) -> Result<Clip, ClipError> {
        assemble::assemble(container::open(path)?, tools)
    }

    /// [`Clip::open`] for what is in a container already, wherever that lies.
    pub fn from_container(container: Box<dyn Container>) -> Result<Clip, ClipError> {
        assemble::assemble(container, &Tools::default())
    }

    /// A clip without files: `load(index)` makes the frame of `frames[index]`.
    pub fn from_frames(
        info: ClipInfo,
        frames: Vec<FrameHeader>,
        up_in_world: Option<Vector3>,
        load: impl Fn(usize) -> Frame + Send + Sync + 'static,
    ) -> Clip {
        Clip { info, frames, up_in_world, shutter: None, origin: Origin::Memory(Box::new(load)) }
    }

    pub fn info(&self) -> &ClipInfo {
        &self.info
    }

    /// Whether colour is a video, so that frames between those that are wanted are decoded too.
    pub fn has_video(&self) -> bool {
        matches!(&self.origin, Origin::Files(files) if files.video.is_some())
    }

    /// The frames with both pictures, in the order in which they were recorded.
    pub fn frames(&self) -> &[FrameHeader] {
        &self.frames
    }

    /// Against gravity in the world of the device's poses: as the layout has it, else as the device felt it.
    pub fn up_in_world(&self) -> Option<Up> {
        self.up_by(self.frames.iter().filter_map(|frame| Some((frame, frame.world_from_camera.as_ref()?))))
    }

    /// [`Clip::up_in_world`] by some of the device's poses only.
    pub fn up_by<'a>(&self, posed: impl IntoIterator<Item = (&'a FrameHeader, &'a Pose3)>) -> Option<Up> {
        self.up_in_world.map(Up::of_device).or_else(|| Up::felt(posed))
    }

    /// How the cameras read their pictures, where that is known.
    pub fn shutter(&self) -> Option<Shutter> {
        self.shutter
    }

    /// Decodes frame `index` of [`Clip::frames`]. Where many frames are wanted, [`Clip::stream`] is faster.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn load(&self, index: usize) -> Result<Frame, ClipError> {
        let mut decoded = self.stream(vec![index]).next_batch(1);
        decoded.pop().expect("one frame was asked for")
    }

    /// Decodes the frames with these places in [`Clip::frames`], in their order, as many at a time as are asked for.
    /// Places in ascending order are fastest: a video is then decoded once.
    ///
    /// # Panics
    /// When there is no such frame.
    pub fn stream(&self, indices: Vec<usize>) -> FrameStream<'_> {
        FrameStream::new(self, indices)
    }
}
