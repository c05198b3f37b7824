//! Errors of opening and reading a video.

use super::MAX_FRAMES;
use crate::container::is_machine_fault;
use std::io;

/// A refusal: its `Display` is for people, [`VideoError::code`] for programs.
#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    #[error("the video cannot be read: {0}")]
    Unreadable(#[source] io::Error),
    #[error("the file is not an mp4 or mov video; export the recording as mp4 with H.264 or HEVC")]
    NotVideo,
    #[error("the video ends too early; the recording was not finished or not sent whole, send it again")]
    Truncated,
    #[error("the video's tables are damaged ({what}); export the recording again")]
    Malformed { what: &'static str },
    #[error("the video's {what} takes {bytes} bytes, and at most {max} are taken")]
    TooLarge { what: &'static str, bytes: u64, max: u64 },
    #[error("the file has no video track")]
    NoVideoTrack,
    #[error("the video is in {found}; export it with H.264 or HEVC")]
    Codec { found: String },
    #[error("the video is encrypted; export it without protection")]
    Encrypted,
    #[error("the video is a fragmented mp4; remux it to a plain one (ffmpeg -i in.mp4 -c copy out.mp4)")]
    Fragmented,
    #[error("the video's edit list is more than one cut ({what}); export it without edits")]
    EditList { what: &'static str },
    #[error("the video changes its coding within the track; export it in one coding")]
    SeveralDescriptions,
    #[error("the video has {what}, which is not read; export it as progressive 4:2:0 in H.264 or HEVC")]
    Unsupported { what: &'static str },
    #[error("the video is {width}x{height}; at most {max_side} by side and {max_pixels} pixels are taken")]
    Size { width: u64, height: u64, max_side: u32, max_pixels: u64 },
    #[error(
        "the video has {frames} frames, and at most {MAX_FRAMES} are taken; split the recording into several clips"
    )]
    TooManyFrames { frames: u64 },
    #[error("frame {number} is asked for, and the video has {frames}")]
    NoSuchFrame { number: usize, frames: usize },
    #[error("frames must be asked for in ascending order")]
    NotAscending,
    #[error("the video's pictures are damaged near sample {sample}: {cause}")]
    Damaged { sample: usize, cause: String },
    #[error("the video broke its decoder near sample {sample}; convert it with ffmpeg and send it again")]
    DecoderBroke { sample: usize },
    #[error("the process that decodes video cannot be started: {0}")]
    ChildStart(#[source] io::Error),
    #[error("the process that decodes video said nothing for {seconds} s and was ended")]
    ChildSilent { seconds: f64 },
    #[error("the process that decodes video ended before its work was done ({status})")]
    ChildEnded { status: String },
    #[error("the process that decodes video was told to stop ({status})")]
    ChildStopped { status: String },
    #[error("the process that decodes video does not keep to the protocol: {what}")]
    ChildLied { what: &'static str },
    #[error("{message}")]
    ChildRefused { message: String },
}

impl VideoError {
    /// Returns whether the machine, not the file, is at fault: a retry may succeed.
    pub fn is_service_fault(&self) -> bool {
        match self {
            VideoError::ChildStart(_) | VideoError::ChildStopped { .. } => true,
            VideoError::Unreadable(error) => is_machine_fault(error),
            _ => false,
        }
    }

    /// Returns the stable name of the refusal, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            VideoError::Unreadable(_) => "unreadable",
            VideoError::NotVideo => "not_video",
            VideoError::Truncated => "video_truncated",
            VideoError::Malformed { .. } => "bad_video",
            VideoError::TooLarge { .. } => "video_too_large",
            VideoError::NoVideoTrack => "no_video_track",
            VideoError::Codec { .. } => "video_codec",
            VideoError::Encrypted => "video_encrypted",
            VideoError::Fragmented => "video_fragmented",
            VideoError::EditList { .. } => "video_edit_list",
            VideoError::SeveralDescriptions => "video_changes",
            VideoError::Unsupported { .. } => "video_unsupported",
            VideoError::Size { .. } => "video_size",
            VideoError::TooManyFrames { .. } => "too_many_frames",
            VideoError::NoSuchFrame { .. } => "no_such_frame",
            VideoError::NotAscending => "frames_not_ascending",
            VideoError::Damaged { .. } | VideoError::ChildRefused { .. } => "video_damaged",
            VideoError::DecoderBroke { .. } => "video_broke_decoder",
            VideoError::ChildStart(_) => "video_child_start",
            VideoError::ChildSilent { .. } => "video_child_silent",
            VideoError::ChildEnded { .. } => "video_child_ended",
            VideoError::ChildStopped { .. } => "video_child_stopped",
            VideoError::ChildLied { .. } => "video_child_lied",
        }
    }

    pub(super) fn malformed(what: &'static str) -> VideoError {
        VideoError::Malformed { what }
    }
}
