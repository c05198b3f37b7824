//! Parts of a video's file.

use super::error::VideoError;
use crate::container::Region;

/// `length` bytes from `at`, where 0 is the region's first byte; the caller has bounded `length`.
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

/// The same part of the file, for another reader.
pub(super) fn clone(region: &Region) -> Result<Region, VideoError> {
    region.part(0, region.bytes).map_err(VideoError::Unreadable)
}
