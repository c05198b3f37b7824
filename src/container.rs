//! Where the files of a clip or a map lie: a folder, an archive that nobody has to unpack, or a file by itself.
//!
//! All are hostile until shown otherwise. Names are checked before anything is read, every read says how
//! many bytes it is prepared to take, and no size that an archive declares is believed.

mod error;
mod folder;
mod kind;
mod names;
mod packed;
mod region;
mod single;
mod spool;
mod tar;
mod zip;

pub use error::ContainerError;
pub use folder::Folder;
pub use region::{Region, RegionReader};
pub use single::Single;
pub use tar::Tar;
pub use zip::Zip;

use kind::Kind;
use names::{position, shown};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Entries of one container, directories included: a hundred thousand frames of four files each.
pub const MAX_ENTRIES: usize = 400_000;
/// Up to this size an entry, or an archive, may unpack to any multiple of what is packed.
const RATIO_FREE_BYTES: u64 = 16 << 20;

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

/// Opens a folder, or a file that is a zip or tar archive, a tar archive packed by gzip or zstd, or anything else: then
/// it is a container of that one file. Which it is, its content says.
///
/// A packed tar archive is unpacked into an unnamed temporary file, within limits.
pub fn open(path: &Path) -> Result<Box<dyn Container>, ContainerError> {
    let unreadable = |source| ContainerError::unreadable(path, source);
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if metadata.is_dir() {
        return Ok(Box::new(Folder::open(path)?));
    }
    if !metadata.is_file() {
        // To open a pipe is to wait for whoever writes into it.
        return Err(unreadable(std::io::Error::other("it is neither a file nor a folder")));
    }
    let region = File::open(path).and_then(Region::whole).map_err(unreadable)?;
    let mut head = Vec::new();
    region.reader().take(Kind::HEAD_BYTES as u64).read_to_end(&mut head).map_err(unreadable)?;
    if head.is_empty() {
        return Err(ContainerError::Empty);
    }
    match Kind::of(&head) {
        Kind::Zip => Ok(Box::new(Zip::open(path)?)),
        Kind::Tar => Ok(Box::new(Tar::index(region)?)),
        Kind::Packed(packing) => packed::open(&region, packing),
        Kind::Other => Ok(Box::new(Single::new(region, path))),
    }
}

/// Reads to the end, but no more than `max_bytes`.
fn read_bounded(reader: &mut dyn Read, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
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
fn region_of(
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
