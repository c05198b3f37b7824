//! A tar archive whose entries are read in place (POSIX.1-2017, pax, "ustar Interchange Format"; GNU tar
//! manual, "Basic Tar Format").

mod extended;
mod headers;

use super::contents::{read_bounded, region_of};
use super::names::{Entries, required, safe_name};
use super::{Container, ContainerError, Region, Scratch};
use headers::{Entry, Headers};

/// A checked archive: its index is in memory, its files stay in place.
pub struct Tar {
    region: Region,
    names: Vec<String>,
    /// Offset and length in bytes, one for each name; both are checked to lie in the archive.
    extents: Vec<(u64, u64)>,
    scratch: Scratch,
}

impl Tar {
    /// Reads all headers once.
    pub(super) fn index(region: Region, scratch: &Scratch) -> Result<Tar, ContainerError> {
        let mut entries = Entries::new();
        for entry in Headers::of(&region) {
            let Entry { name, offset, bytes, is_file } = entry?;
            // A name that is not UTF-8 belongs to no layout, but it must not lead out either.
            let safe = safe_name(&String::from_utf8_lossy(&name))?;
            if is_file && std::str::from_utf8(&name).is_ok() {
                entries.push(safe, (offset, bytes))?;
            }
        }
        let (names, extents) = entries.finish()?;
        Ok(Tar { region, names, extents, scratch: scratch.clone() })
    }
}

impl Container for Tar {
    fn scratch(&self) -> Scratch {
        self.scratch.clone()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
        let region = self.region(name, max_bytes)?;
        read_bounded(&mut region.reader(), name, max_bytes)
    }

    fn region(&self, name: &str, max_bytes: u64) -> Result<Region, ContainerError> {
        let (offset, bytes) = self.extents[required(&self.names, name)?];
        region_of(&self.region, name, offset, bytes, max_bytes)
    }
}
