//! Containers of the files of a clip or a map: a folder, an archive read without unpacking, or a single file.
//!
//! All content is untrusted. Names are checked before anything is read, every read has a limit in bytes, and
//! sizes that an archive declares are not trusted.

mod contents;
mod error;
mod fault;
mod folder;
mod kind;
mod names;
mod packed;
mod region;
mod scratch;
mod single;
mod spool;
mod tar;
mod zip;

pub use contents::{Container, FileSum};
pub use error::{ContainerError, MAX_ENTRIES};
pub use fault::is_machine_fault;
pub use folder::Folder;
pub use packed::unzstd;
pub use region::{Region, RegionReader};
pub use scratch::{Budget, Scratch};
pub use single::Single;
pub use spool::Spool;
pub use tar::Tar;
pub use zip::Zip;

use kind::Kind;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Opens a folder, a zip or tar archive, a tar archive compressed with gzip or zstd, or any other file as a
/// container of that file alone. The kind is detected by content.
///
/// A packed tar archive is unpacked into an unnamed temporary file, within limits.
pub fn open(path: &Path) -> Result<Box<dyn Container>, ContainerError> {
    open_in(path, &Scratch::default())
}

/// Opens like [`open`], and unpacks in `scratch`.
pub fn open_in(path: &Path, scratch: &Scratch) -> Result<Box<dyn Container>, ContainerError> {
    let unreadable = |source| ContainerError::unreadable(path, source);
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if metadata.is_dir() {
        return Ok(Box::new(Folder::open(path)?));
    }
    if !metadata.is_file() {
        // Opening a pipe would block until there is a writer.
        return Err(unreadable(std::io::Error::other("it is neither a file nor a folder")));
    }
    let region = File::open(path).and_then(Region::whole).map_err(unreadable)?;
    let mut head = Vec::new();
    region.reader().take(Kind::HEAD_BYTES as u64).read_to_end(&mut head).map_err(unreadable)?;
    if head.is_empty() {
        return Err(ContainerError::Empty);
    }
    match Kind::of(&head) {
        Kind::Zip => Ok(Box::new(Zip::index(region, scratch)?)),
        Kind::Tar => Ok(Box::new(Tar::index(region, scratch)?)),
        Kind::Packed(packing) => packed::open(&region, packing, scratch),
        Kind::Other => Ok(Box::new(Single::new(region, path, scratch))),
    }
}
