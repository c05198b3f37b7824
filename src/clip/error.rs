//! Why a clip is refused or cannot be read on.

use crate::container::ContainerError;

/// A refusal: its `Display` is for people, [`ClipError::code`] for programs.
#[derive(Debug, thiserror::Error)]
pub enum ClipError {
    #[error(transparent)]
    Container(#[from] ContainerError),
    #[error(
        "no known layout among {files} files; looked for ScanNet (color/0.jpg, depth/0.png, pose/0.txt), \
         7-Scenes (frame-000000.color.png, .depth.png, .pose.txt) and TUM RGB-D (rgb.txt, depth.txt)"
    )]
    UnknownLayout { files: usize },
    #[error("there are several clips ({first}, {second}); send them one by one")]
    SeveralClips { first: String, second: String },
    #[error("no frame has both pictures: {color} colour pictures, {depth} depth pictures")]
    NoFrames { color: usize, depth: usize },
    #[error("there are {frames} frames, and at most {max} are taken; send the recording in parts")]
    TooManyFrames { frames: usize, max: usize },
    #[error("{name} is missing: without the camera's intrinsics the pictures cannot be used")]
    MissingIntrinsics { name: String },
    #[error("{name}: {reason}")]
    BadIntrinsics { name: String, reason: String },
    #[error("{name}, line {line}: {reason}")]
    BadIndex { name: String, line: usize, reason: String },
    #[error("two files are the same frame's: {first} and {second}")]
    DuplicateFrame { first: String, second: String },
    #[error("none of the {frames} frames has a pose in {place} that is a finite rigid motion")]
    NoFinitePose { frames: usize, place: &'static str },
    #[error("colour and depth do not belong together: {reason}")]
    ColorDepthMismatch { reason: String },
    #[error("{name} is not a picture that can be read: {reason}")]
    BadPicture { name: String, reason: String },
    #[error("{name} is {width}x{height}, and pictures may have at most {max_pixels} pixels")]
    PictureTooLarge { name: String, width: u32, height: u32, max_pixels: u64 },
    #[error("{name} is {found}; a depth picture is a PNG with 16 bits of grey")]
    DepthNotGrey16 { name: String, found: String },
    #[error(
        "{name} is {width}x{height}, but the clip's first picture of its kind is {first_width}x{first_height}"
    )]
    ImageSizeChanged { name: String, width: u32, height: u32, first_width: u32, first_height: u32 },
}

impl ClipError {
    /// Stable name of the refusal, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            ClipError::Container(error) => error.code(),
            ClipError::UnknownLayout { .. } => "unknown_layout",
            ClipError::SeveralClips { .. } => "several_clips",
            ClipError::NoFrames { .. } => "no_frames",
            ClipError::TooManyFrames { .. } => "too_many_frames",
            ClipError::MissingIntrinsics { .. } => "missing_intrinsics",
            ClipError::BadIntrinsics { .. } => "bad_intrinsics",
            ClipError::BadIndex { .. } => "bad_index",
            ClipError::DuplicateFrame { .. } => "duplicate_frame",
            ClipError::NoFinitePose { .. } => "no_finite_pose",
            ClipError::ColorDepthMismatch { .. } => "color_depth_mismatch",
            ClipError::BadPicture { .. } => "bad_picture",
            ClipError::PictureTooLarge { .. } => "picture_too_large",
            ClipError::DepthNotGrey16 { .. } => "depth_not_grey16",
            ClipError::ImageSizeChanged { .. } => "image_size_changed",
        }
    }
}
