//! The interface of all containers.

use super::error::ContainerError;
use super::names::{position, shown};
use super::region::Region;
use super::scratch::Scratch;
use flate2::CrcReader;
use std::io::{self, Read};

/// Up to this unpacked size, an entry or an archive may have any compression ratio.
pub(super) const RATIO_FREE_BYTES: u64 = 16 << 20;

/// Length and CRC-32 of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileSum {
    pub bytes: u64,
    pub crc32: u32,
}

/// Named files, readable from several threads at once.
pub trait Container: Send + Sync {
    /// Returns the names relative to the container's root, with `/` between parts, in byte order. Hidden
    /// files (a part that begins with `.`) and macOS's additions to archives are left out.
    fn names(&self) -> &[String];

    /// Returns the whole file, or [`ContainerError::FileTooLarge`] if it has more than `max_bytes`.
    fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError>;

    /// Returns the file as a part of an open file, for readers that seek. Every call unpacks a compressed
    /// entry into an unnamed temporary file, which is deleted with the region.
    fn region(&self, name: &str, max_bytes: u64) -> Result<Region, ContainerError>;

    /// Returns the sums of the files, one for each name; `None` if the container is one file by itself. Reads all files, except
    /// for a zip archive, whose directory has the sums.
    fn sums(&self) -> Result<Option<Vec<FileSum>>, ContainerError> {
        let sum = |name: &String| -> Result<FileSum, ContainerError> {
            let region = self.region(name, u64::MAX)?;
            let mut reader = CrcReader::new(region.reader());
            io::copy(&mut reader, &mut io::sink())
                .map_err(|source| ContainerError::Unreadable { name: shown(name), source })?;
            Ok(FileSum { bytes: region.bytes, crc32: reader.crc().sum() })
        };
        self.names().iter().map(sum).collect::<Result<_, _>>().map(Some)
    }

    /// Returns the place for copies of scattered parts.
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn contains(&self, name: &str) -> bool {
        position(self.names(), name).is_some()
    }
}

/// Reads to the end; more than `max_bytes` are an error.
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

/// Returns a part of an open file as a file called `name`, if the part lies inside.
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
