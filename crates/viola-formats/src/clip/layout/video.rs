//! Colour as a video.

use super::ClipError;
use crate::clip::files::find_file;
use crate::container::{Container, Region};
use crate::video::{Codec, VideoInfo, inspect};

/// An hour of a phone's video.
const MAX_BYTES: u64 = 16 << 30;

/// Returns the first of these files that exists, and the contents of its tables.
pub(super) fn find(
    container: &dyn Container,
    root: &str,
    files: &[&str],
) -> Result<Option<(String, Region, VideoInfo)>, ClipError> {
    let mut names = files.iter().map(|file| format!("{root}{file}"));
    let Some(name) = names.find_map(|name| find_file(container, &name)) else { return Ok(None) };
    let region = container.region(&name, MAX_BYTES)?;
    let info = inspect(&region).map_err(|source| ClipError::Video { name: name.clone(), source })?;
    Ok(Some((name, region, info)))
}

/// Describes a video in words.
pub(super) fn words(name: &str, info: &VideoInfo) -> String {
    let codec = match info.codec {
        Codec::H264 => "H.264",
        Codec::Hevc => "HEVC",
    };
    let rotation = match info.rotation_deg {
        0 => String::new(),
        rotation_deg => format!(
            "; the rotation by {rotation_deg} degrees in its header was not applied, as depth is not rotated"
        ),
    };
    let name = name.rsplit('/').next().unwrap_or(name);
    format!("{name} is {codec}, {} frames{rotation}", info.time_s.len())
}
