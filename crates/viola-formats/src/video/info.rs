//! What the tables of a video say.

/// A video with more frames than this is refused: an hour at 25 frames a second has 90 000.
pub const MAX_FRAMES: usize = 100_000;

/// How the pictures are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    /// ITU-T H.264.
    H264,
    /// ITU-T H.265.
    Hevc,
}

/// What the tables of a video say.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoInfo {
    pub codec: Codec,
    /// Size in pixels of the pictures as they are coded and cropped, before any rotation.
    pub width: u32,
    pub height: u32,
    /// Clockwise turn that a player would apply, of 0, 90, 180 and 270 degrees. The frames are not turned.
    pub rotation_deg: u16,
    /// When each frame is shown, in the order of showing, in seconds from the first.
    pub time_s: Vec<f64>,
}
