//! What every container can do.

use super::error::ContainerError;
use super::names::{position, shown};
use super::region::Region;
use std::io::Read;

/// Up to this size an entry, or an archive, may unpack to any multiple of what is packed.
pub(super) const RATIO_FREE_BYTES: u64 = 16 << 20;

/// Named files, readable from several threads at once.
pub trait Container: Send + Sync {
    /// Names relative to the container's root, parts separated by `/`, in byte order. Hidden files
    /// (a part that begins with `.`) and what macOS adds to archives are left out.
    fn names(&self) -> &[String];

    /// The whole file, or [`ContainerError::FileTooLarge`] when it has more than `max_bytes`.
    fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError>;

    /// The file as a part of an open file, for readers that seek. An entry that is packed by itself is unpacked into an
    /// unnamed temporary file first, which is gone with the region; every call does so again.
    fn region(&self, name: &str, max_bytes: u64) -> Result<Region, ContainerError>;

    fn contains(&self, name: &str) -> bool {
        position(self.names(), name).is_some()
    }
}

/// Reads to the end, but no more than `max_bytes`.
pub(super) fn read_bounded(
    reader: &mut dyn Read,
    name: &str,
    max_bytes: u64,
) -> Result<Vec<u8>, ContainerError> {
    let mut bytes = Vec::new();
    reader
        .take(max_bytes.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|source| ContainerError::Unreadable { name: shown(name), source })?;
    if bytes.len() as u64 > max_bytes {
        return Err(ContainerError::FileTooLarge { name: shown(name), max_bytes });
    }
    Ok(bytes)
}

/// A part of an open file, which the file's own length has been shown to hold, as a file called `name`.
pub(super) fn region_of(
    whole: &Region,
    name: &str,
    offset: u64,
    bytes: u64,
    max_bytes: u64,
) -> Result<Region, ContainerError> {
    if bytes > max_bytes {
        return Err(ContainerError::FileTooLarge { name: shown(name), max_bytes });
    }
    whole.part(offset, bytes).map_err(|source| ContainerError::Unreadable { name: shown(name), source })
}
