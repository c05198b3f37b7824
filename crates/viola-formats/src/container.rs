//! Where the files of a clip or a map lie: a folder, an archive that nobody has to unpack, or a file by itself.
//!
//! All are hostile until shown otherwise. Names are checked before anything is read, every read says how
//! many bytes it is prepared to take, and no size that an archive declares is believed.

mod contents;
mod error;
mod fault;
mod folder;
mod kind;
mod names;
mod packed;
mod region;
mod single;
mod spool;
mod tar;
mod zip;

pub use contents::Container;
pub use error::{ContainerError, MAX_ENTRIES};
pub use fault::is_machine_fault;
pub use folder::Folder;
pub use region::{Region, RegionReader};
pub use single::Single;
pub use tar::Tar;
pub use zip::Zip;

use kind::Kind;
use std::fs::File;
use std::io::Read;
use std::path::Path;

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
