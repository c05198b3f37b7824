//! Frames of a recorded video: mp4 and mov files with H.264 or HEVC.
//!
//! A video from a stranger is looked at in three steps. `inspect` reads the tables of the file, and nothing of the
//! pictures. `decode` plans which samples must be decoded for the frames that are wanted, and decodes them: on this
//! thread, or in another process with limits on memory and time ([`Tools`]), so that a file that breaks a decoder
//! hurts nothing else. Only the frames that are wanted become RGB.
//!
//! Frames are numbered in the order in which they are shown, from 0, after the file's edit list, as ffmpeg numbers
//! them. The rotation in the track's header is told and not applied, because depth pictures and intrinsics of the
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
mod status;
mod track;

pub use decoder::{Planes, Samples};
pub use error::VideoError;
pub use frames::Frames;
pub use info::{Codec, MAX_FRAMES, VideoInfo};
pub use limits::Limits;
pub use protocol::{NumberList, serve};
pub use status::was_asked_to_stop;

use crate::container::Region;
use inside::{Inside, Step};
use region::clone;
use std::path::PathBuf;
use std::sync::Arc;
use track::Track;

/// Programs that decode video outside this process, by their full paths. Default: none, and video is decoded on this
/// thread.
#[derive(Debug, Clone, Default)]
pub struct Tools {
    /// The `viola` binary, whose command `decode-video` is the child.
    pub viola: Option<PathBuf>,
    /// ffmpeg, which is tried before `viola` and gives the same pixels; where it fails the other goes on.
    pub ffmpeg: Option<PathBuf>,
    /// What a child may take.
    pub limits: Limits,
}

/// Reads the tables of a video. Costs at most the size of the tables in memory, and decodes nothing.
pub fn inspect(region: &Region) -> Result<VideoInfo, VideoError> {
    let track = Track::read(region)?;
    Ok(track.info())
}

/// Frames of a video, in the order of their numbers.
///
/// `wanted` are numbers of frames in ascending order, each below the length of [`VideoInfo::time_s`]. Groups of
/// pictures without a wanted frame are passed over. The tables are read at once, and what is wrong with them is told
/// at once; pictures that cannot be decoded are told by the iterator, which then ends.
pub fn decode(region: &Region, wanted: &[usize], tools: &Tools) -> Result<Frames, VideoError> {
    let track = open(region, wanted)?;
    Frames::open(clone(region)?, track, wanted, tools)
}

/// The same frames as they are coded, decoded on this thread: for comparison with other decoders.
pub fn decode_planes(
    region: &Region,
    wanted: &[usize],
) -> Result<impl Iterator<Item = Result<(usize, Planes), VideoError>> + Send, VideoError> {
    let track = open(region, wanted)?;
    let mut inside = Some(Inside::open(clone(region)?, Arc::new(track), wanted)?);
    Ok(std::iter::from_fn(move || {
        loop {
            match inside.as_mut()?.step() {
                Ok(Step::Working) => {}
                Ok(Step::Frame(number, planes)) => return Some(Ok((number, planes))),
                Ok(Step::Done) => inside = None,
                Err(error) => {
                    inside = None;
                    return Some(Err(error));
                }
            }
        }
    }))
}

/// The tables of a video that has the wanted frames.
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
