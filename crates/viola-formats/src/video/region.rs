//! Parts of a video's file.

use super::error::VideoError;
use crate::container::Region;

/// Reads `length` bytes from `at`, counted from the region's start; the caller has limited `length`.
pub(super) fn read(region: &Region, at: u64, length: usize) -> Result<Vec<u8>, VideoError> {
    let inside = at.checked_add(length as u64).is_some_and(|end| end <= region.bytes);
    if !inside {
        return Err(VideoError::Truncated);
    }
    let mut bytes = vec![0; length];
    region.read_exact_at(at, &mut bytes).map_err(|error| match error.kind() {
        std::io::ErrorKind::UnexpectedEof => VideoError::Truncated,
        _ => VideoError::Unreadable(error),
    })?;
    Ok(bytes)
}

/// Returns the same part of the file, for another reader.
pub(super) fn clone(region: &Region) -> Result<Region, VideoError> {
    region.part(0, region.bytes).map_err(VideoError::Unreadable)
}
