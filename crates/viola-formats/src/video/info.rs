//! Data from the tables of a video.

/// Maximum number of frames of a video: an hour at 25 frames per second has 90 000.
pub const MAX_FRAMES: usize = 100_000;

/// Compression of the pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    /// ITU-T H.264.
    H264,
    /// ITU-T H.265.
    Hevc,
}

/// Data from the tables of a video.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoInfo {
    pub codec: Codec,
    /// Size in pixels of the pictures as they are coded and cropped, before any rotation.
    pub width: u32,
    pub height: u32,
    /// Clockwise rotation that a player would apply: 0, 90, 180 or 270 degrees. The frames are not rotated.
    pub rotation_deg: u16,
    /// Presentation time of each frame, in presentation order, in seconds from the first.
    pub time_s: Vec<f64>,
}
