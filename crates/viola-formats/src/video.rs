//! Frames of a recorded video: mp4 and mov files with H.264 or HEVC.
//!
//! An untrusted video is read in steps. `inspect` reads only the tables of the file. `decode` selects the
//! samples that the wanted frames need, and decodes them on this thread, or in another process with limits on
//! memory and time ([`Tools`]), so that a file that breaks a decoder harms nothing else. Only the wanted
//! frames are converted to RGB.
//!
//! Frames are numbered in presentation order, from 0, after the file's edit list, as ffmpeg numbers them. The
//! rotation in the track's header is reported but not applied, because depth pictures and intrinsics of the
//! recorders are not rotated either.

mod boxes;
mod child;
mod colour;
mod decoder;
mod error;
mod ffmpeg;
mod frames;
mod hevc_sps;
mod info;
mod inside;
mod limits;
mod nal;
mod parameters;
mod plan;
mod protocol;
mod region;
mod samples;
mod sandbox;
mod status;
mod track;

pub use decoder::{Planes, Samples};
pub use error::VideoError;
pub use frames::Frames;
pub use info::{Codec, MAX_FRAMES, VideoInfo};
pub use limits::Limits;
pub use protocol::{NumberList, serve};
pub use sandbox::open_no_more_files;
pub use status::was_asked_to_stop;

use crate::container::Region;
use inside::Inside;
use region::clone;
use std::path::PathBuf;
use std::sync::Arc;
use track::Track;

/// Full paths of programs that decode video outside this process. Default: none, and video is decoded on this
/// thread.
#[derive(Debug, Clone, Default)]
pub struct Tools {
    /// The `viola` binary, whose command `decode-video` is the child.
    pub viola: Option<PathBuf>,
    /// ffmpeg, tried before `viola` and with the same pixels; the pure-Rust decoder is the fallback.
    pub ffmpeg: Option<PathBuf>,
    /// Limits of a child process.
    pub limits: Limits,
}

/// Reads the tables of a video, without decoding. Memory is limited by the size of the tables.
pub fn inspect(region: &Region) -> Result<VideoInfo, VideoError> {
    let track = Track::read(region)?;
    Ok(track.info())
}

/// Returns the wanted frames of a video, in the order of their numbers.
///
/// `wanted` are numbers of frames in ascending order, each below the length of [`VideoInfo::time_s`]. Groups
/// of pictures without a wanted frame are skipped. Bad tables are an error of this call; pictures that cannot
/// be decoded are an error of the iterator, which then ends.
pub fn decode(region: &Region, wanted: &[usize], tools: &Tools) -> Result<Frames, VideoError> {
    let track = open(region, wanted)?;
    Frames::open(clone(region)?, track, wanted, tools)
}

/// Returns the same frames as YUV planes, decoded on this thread: for comparison with other decoders.
pub fn decode_planes(
    region: &Region,
    wanted: &[usize],
) -> Result<impl Iterator<Item = Result<(usize, Planes), VideoError>> + Send, VideoError> {
    let track = open(region, wanted)?;
    let mut inside = Some(Inside::open(clone(region)?, Arc::new(track), wanted)?);
    Ok(std::iter::from_fn(move || {
        let frame = inside.as_mut()?.next().transpose();
        if !matches!(frame, Some(Ok(_))) {
            inside = None;
        }
        frame
    }))
}

/// Reads the tables of a video, and checks that it has the wanted frames.
fn open(region: &Region, wanted: &[usize]) -> Result<Track, VideoError> {
    let track = Track::read(region)?;
    let frames = track.shown.len();
    if let Some(&number) = wanted.iter().find(|number| **number >= frames) {
        return Err(VideoError::NoSuchFrame { number, frames });
    }
    if wanted.windows(2).any(|pair| pair[0] >= pair[1]) {
        return Err(VideoError::NotAscending);
    }
    Ok(track)
}
