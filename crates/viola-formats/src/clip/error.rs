//! Errors of opening and reading a clip.

use crate::container::ContainerError;
use crate::video::VideoError;

/// A refusal: its `Display` is for people, [`ClipError::code`] for programs.
#[derive(Debug, thiserror::Error)]
pub enum ClipError {
    #[error(transparent)]
    Container(#[from] ContainerError),
    #[error(
        "no known layout among {files} files; looked for Stray Scanner (odometry.csv, camera_matrix.csv), Record3D \
         (metadata, rgbd/0.depth), Polycam raw data (keyframes/cameras), 3D Scanner App (frame_00000.json), \
         ARKitScenes (lowres_wide.traj), Nerfstudio (transforms.json), COLMAP (sparse/images.bin, stereo/depth_maps), Spectacular AI (data.jsonl), ScanNet \
         (color/0.jpg, depth/0.png, pose/0.txt, or a .sens file), Redwood (a .log trajectory), 7-Scenes \
         (frame-000000.color.png, .depth.png, .pose.txt), TUM RGB-D (rgb.txt, depth.txt), RTAB-Map (a .db file), \
         ROS 2 bags (a .mcap or .db3 file) and points with a path (NAME.ply, NAME.txt)"
    )]
    UnknownLayout { files: usize },
    #[error("there are several clips ({first}, {second}); send them one by one")]
    SeveralClips { first: String, second: String },
    #[error("no frame has both pictures: {color} colour pictures, {depth} depth pictures")]
    NoFrames { color: usize, depth: usize },
    #[error("there are {frames} frames, and at most {max} are taken; split the recording into several clips")]
    TooManyFrames { frames: usize, max: usize },
    #[error("{name} is missing: without the camera's intrinsics the pictures cannot be used")]
    MissingIntrinsics { name: String },
    #[error("{name}: {reason}")]
    BadIntrinsics { name: String, reason: String },
    #[error("{name}, line {line}: {reason}")]
    BadIndex { name: String, line: usize, reason: String },
    #[error("{name} is not what the layout has: {reason}")]
    BadMetadata { name: String, reason: String },
    #[error("{name} is not metric: {reason}; export metric depth and poses")]
    NotMetric { name: String, reason: String },
    #[error("there are several trajectories ({first}, {second}); send one")]
    SeveralTrajectories { first: String, second: String },
    #[error("two files are the same frame's: {first} and {second}")]
    DuplicateFrame { first: String, second: String },
    #[error("colour and depth do not belong together: {reason}")]
    ColorDepthMismatch { reason: String },
    #[error(
        "{name} is not a picture that can be read: {reason}; export or copy the clip again, or remove this picture: a \
         frame without one of its pictures is left out"
    )]
    BadPicture { name: String, reason: String },
    #[error("{name} is {width}x{height}, and pictures may have at most {max_pixels} pixels")]
    PictureTooLarge { name: String, width: u32, height: u32, max_pixels: u64 },
    #[error("{name} is {found}; a depth picture is a PNG with 16 bits of grey")]
    DepthNotGrey16 { name: String, found: String },
    #[error("{name}: {source}")]
    Video { name: String, source: VideoError },
    #[error(
        "{name} is depth as a video, which is not read; give its pictures instead (ffmpeg -i data2.mkv -start_number 0 \
         -pix_fmt gray16be frames2/%08d.png)"
    )]
    DepthVideo { name: String },
    #[error("{name}: {reason}")]
    VideoFailed { name: String, code: &'static str, reason: String, is_service_fault: bool },
    #[error("the video ends before frame {frame}")]
    VideoEnded { frame: u32 },
    #[error("{name} is not depth that can be read: {reason}")]
    BadDepth { name: String, reason: String },
    #[error(
        "{name} is {width}x{height}, but the clip's first picture of its kind is {first_width}x{first_height}"
    )]
    ImageSizeChanged { name: String, width: u32, height: u32, first_width: u32, first_height: u32 },
}

impl ClipError {
    /// Returns whether the machine, not the clip, is at fault: a retry may succeed.
    pub fn is_service_fault(&self) -> bool {
        match self {
            ClipError::Container(error) => error.is_service_fault(),
            ClipError::Video { source, .. } => source.is_service_fault(),
            ClipError::VideoFailed { is_service_fault, .. } => *is_service_fault,
            _ => false,
        }
    }

    /// Returns the stable name of the refusal, for programs.
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
            ClipError::BadMetadata { .. } => "bad_metadata",
            ClipError::NotMetric { .. } => "not_metric",
            ClipError::SeveralTrajectories { .. } => "several_trajectories",
            ClipError::DuplicateFrame { .. } => "duplicate_frame",
            ClipError::ColorDepthMismatch { .. } => "color_depth_mismatch",
            ClipError::BadPicture { .. } => "bad_picture",
            ClipError::PictureTooLarge { .. } => "picture_too_large",
            ClipError::DepthNotGrey16 { .. } => "depth_not_grey16",
            ClipError::Video { source, .. } => source.code(),
            ClipError::DepthVideo { .. } => "depth_video",
            ClipError::VideoFailed { code, .. } => code,
            ClipError::VideoEnded { .. } => "video_ended",
            ClipError::BadDepth { .. } => "bad_depth",
            ClipError::ImageSizeChanged { .. } => "image_size_changed",
        }
    }
}
