//! A recorded RGB-D clip: its summary, and its frames one at a time.
//!
//! [`Clip::open`] detects the layout by content, reads the small text files (poses, intrinsics, indices) and
//! keeps them. Pictures stay in their container until [`Clip::load`], so memory grows by 180 to 400 bytes per frame.

mod assemble;
mod colmap_depth;
mod depth;
mod error;
mod files;
mod layout;
mod npy;
mod part;
mod picture;
mod rendered;
mod rows;
mod rvl;
mod sqlite;
mod stream;
mod up;
pub mod write;

pub use error::ClipError;
pub use stream::FrameStream;
pub use up::Up;

use crate::container::{self, Container, Scratch};
use crate::video::Tools;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;
use viola_geometry::{Pinhole, Pose3, Vector3};

/// Maximum number of frames of one clip.
const MAX_FRAMES: usize = 100_000;

/// Summary of a clip for its sender.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ClipInfo {
    /// Name of the layout, for example `stray_scanner`, `record3d`, `polycam`, `scannet`, `tum_rgbd`.
    pub layout: String,
    /// Direction and camera axes of the poses in the files, for example `camera-to-world, OpenCV (x right, y
    /// down, z forward)`.
    pub pose_convention: String,
    /// Unit of the depth pictures, for example `millimetres (16-bit PNG)`.
    pub depth_unit: String,
    /// Up direction and its source, for example `world z is up (rule of the layout)` or `unknown`.
    pub gravity: String,
    /// Source of the intrinsics.
    pub intrinsics: String,
    /// Frames with both pictures, or with depth if the clip has no colour.
    pub frames: usize,
    /// Frames with a finite pose.
    pub frames_with_pose: usize,
    /// Frames whose pose is missing or not a finite rigid motion.
    pub skipped_without_pose: usize,
    /// Frames left out because one of their pictures is missing.
    pub skipped_incomplete: usize,
    /// 0 if the clip has no colour.
    pub color_width: u32,
    pub color_height: u32,
    pub depth_width: u32,
    pub depth_height: u32,
    /// Seconds from the first to the last frame, if the layout has times.
    pub duration_s: Option<f64>,
    /// False if poses and depth have a common but unknown unit; the alignment then finds the scale.
    #[serde(default = "is_metric")]
    pub metric: bool,
    /// Time of the first frame in milliseconds since 1970 UTC, if the layout has times of day.
    pub recorded_at_ms: Option<i64>,
    /// Notes for the sender: assumptions made, files ignored.
    pub notes: Vec<String>,
}

impl ClipInfo {
    /// Returns the summary of a clip in memory that comes from no file: all frames have poses, in metres. `color` and `depth`
    /// are the width and height of the pictures in pixels.
    pub fn in_memory(frames: usize, color: [u32; 2], depth: [u32; 2]) -> ClipInfo {
        ClipInfo {
            frames,
            frames_with_pose: frames,
            color_width: color[0],
            color_height: color[1],
            depth_width: depth[0],
            depth_height: depth[1],
            metric: true,
            ..ClipInfo::default()
        }
    }
}

/// Summaries of older versions are of metric clips.
fn is_metric() -> bool {
    true
}

/// Data of a frame that needs no decoding.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameHeader {
    /// Number of the frame in the layout; `--frames` refers to it.
    pub number: u32,
    pub time_s: Option<f64>,
    /// Finite, with a unit rotation; `None` if the capture has none.
    pub world_from_camera: Option<Pose3>,
    /// Specific force around that time, in the camera's axes and any unit: opposite to gravity at rest.
    pub force_in_camera: Option<Vector3>,
}

/// Readout times of the rolling shutters, from first to last row: motion meanwhile shears the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shutter {
    pub color_s: f64,
    pub depth_s: f64,
}

/// A decoded frame. The colour camera and the depth camera share one pose.
#[derive(Debug, Clone)]
pub struct Frame {
    pub header: FrameHeader,
    /// The depth camera if there is no colour.
    pub color_camera: Pinhole,
    /// `None` if the clip has no colour.
    pub color: Option<image::RgbImage>,
    pub depth_camera: Pinhole,
    pub depth: DepthImage,
}

/// Depth along z in metres, row by row from the top; 0 means no reading.
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

/// An opened clip. Several threads can load frames at once.
#[derive(Clone)]
pub struct Clip {
    info: ClipInfo,
    frames: Vec<FrameHeader>,
    up_in_world: Option<Vector3>,
    shutter: Option<Shutter>,
    /// Factor of the origin's depth.
    scale: f64,
    origin: Arc<Origin>,
}

/// Source of the frames.
enum Origin {
    Files(Box<files::Files>),
    Memory(Box<dyn Fn(usize) -> Frame + Send + Sync>),
}

impl Clip {
    /// Opens a folder, an archive or a file and detects the layout by content, with its root at any depth.
    /// Reads poses, intrinsics and indices, and the headers of the first pictures. Video is decoded on the
    /// calling thread, so use this only for trusted files.
    pub fn open(path: &Path) -> Result<Clip, ClipError> {
        Clip::open_with(path, &Tools::default())
    }

    /// Opens an untrusted clip like [`Clip::open`]; video is decoded by the processes of `tools`.
    pub fn open_with(path: &Path, tools: &Tools) -> Result<Clip, ClipError> {
        Clip::open_in(path, tools, &Scratch::default())
    }

    /// Opens an untrusted clip like [`Clip::open_with`]; archives are unpacked in `scratch`.
    pub fn open_in(path: &Path, tools: &Tools, scratch: &Scratch) -> Result<Clip, ClipError> {
        assemble::assemble(container::open_in(path, scratch)?, tools)
    }

    /// Opens a clip that is in a container already, like [`Clip::open`].
    pub fn from_container(container: Box<dyn Container>) -> Result<Clip, ClipError> {
        assemble::assemble(container, &Tools::default())
    }

    /// Returns a clip without files: `load(index)` makes the frame of `frames[index]`.
    pub fn from_frames(
        info: ClipInfo,
        frames: Vec<FrameHeader>,
        up_in_world: Option<Vector3>,
        load: impl Fn(usize) -> Frame + Send + Sync + 'static,
    ) -> Clip {
        Clip::new(info, frames, up_in_world, None, Origin::Memory(Box::new(load)))
    }

    fn new(
        info: ClipInfo,
        frames: Vec<FrameHeader>,
        up_in_world: Option<Vector3>,
        shutter: Option<Shutter>,
        origin: Origin,
    ) -> Clip {
        Clip { info, frames, up_in_world, shutter, scale: 1.0, origin: Arc::new(origin) }
    }

    /// Returns the clip with positions and depth multiplied by `factor`.
    pub fn scaled(&self, factor: f64) -> Clip {
        let mut clip = self.clone();
        clip.scale *= factor;
        let poses = clip.frames.iter_mut().filter_map(|frame| frame.world_from_camera.as_mut());
        poses.for_each(|pose| pose.translation.vector *= factor);
        clip
    }

    /// Returns the clip with an unknown unit of poses and depth, whatever its files say.
    pub fn with_unknown_scale(mut self) -> Clip {
        self.info.metric = false;
        self
    }

    pub fn info(&self) -> &ClipInfo {
        &self.info
    }

    /// Returns the files of the clip; `None` if its frames are made in memory.
    pub fn container(&self) -> Option<&dyn Container> {
        match &*self.origin {
            Origin::Files(files) => Some(files.container.as_ref()),
            Origin::Memory(_) => None,
        }
    }

    /// Returns whether colour is a video: frames between the wanted ones are then decoded too.
    pub fn has_video(&self) -> bool {
        matches!(&*self.origin, Origin::Files(files) if files.video.is_some())
    }

    /// Returns whether the frames have colour pictures.
    pub fn has_color(&self) -> bool {
        self.info.color_width > 0
    }

    /// Returns the usable frames in recording order: those with both pictures, or with depth if the clip has no
    /// colour.
    pub fn frames(&self) -> &[FrameHeader] {
        &self.frames
    }

    /// Returns the up direction in the world of the poses, by the layout or else by the accelerometer.
    pub fn up_in_world(&self) -> Option<Up> {
        self.up_by(self.frames.iter().filter_map(|frame| Some((frame, frame.world_from_camera.as_ref()?))))
    }

    /// Returns [`Clip::up_in_world`] by the given poses only.
    pub fn up_by<'a>(&self, posed: impl IntoIterator<Item = (&'a FrameHeader, &'a Pose3)>) -> Option<Up> {
        self.up_in_world.map(Up::of_device).or_else(|| Up::felt(posed))
    }

    /// Returns the readout times of the cameras, if they are known.
    pub fn shutter(&self) -> Option<Shutter> {
        self.shutter
    }

    /// Decodes frame `index` of [`Clip::frames`]. For many frames, [`Clip::stream`] is faster.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn load(&self, index: usize) -> Result<Frame, ClipError> {
        let mut decoded = self.stream(vec![index]).next_batch(1);
        decoded.pop().expect("one frame was asked for")
    }

    /// Decodes the frames at these indices of [`Clip::frames`], in their order and in batches. Indices of a
    /// clip with video must ascend: the video is decoded once.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn stream(&self, indices: Vec<usize>) -> FrameStream<'_> {
        FrameStream::new(self, indices)
    }
}
