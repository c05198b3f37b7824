//! A file that is no archive: a container of one name.

use super::contents::{FileSum, read_bounded, region_of};
use super::names::required;
use super::{Container, ContainerError, Region, Scratch};
use std::path::Path;

/// Maximum length of the name in characters.
const MAX_NAME_CHARS: usize = 200;

/// One open file.
pub struct Single {
    region: Region,
    names: [String; 1],
    scratch: Scratch,
}

impl Single {
    /// Names the file as its path does, with characters replaced that are invalid in a container.
    pub(super) fn new(region: Region, path: &Path, scratch: &Scratch) -> Single {
        let own = path.file_name().unwrap_or_default().to_string_lossy();
        let plain = |c: char| if c.is_control() || matches!(c, '/' | '\\' | ':') { '_' } else { c };
        // A leading dot would hide it.
        let name: String = own.trim_start_matches('.').chars().take(MAX_NAME_CHARS).map(plain).collect();
        let name = if name.is_empty() { "file".to_owned() } else { name };
        Single { region, names: [name], scratch: scratch.clone() }
    }
}

impl Container for Single {
    fn scratch(&self) -> Scratch {
        self.scratch.clone()
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
        required(&self.names, name)?;
        read_bounded(&mut self.region.reader(), name, max_bytes)
    }

    fn region(&self, name: &str, max_bytes: u64) -> Result<Region, ContainerError> {
        required(&self.names, name)?;
        region_of(&self.region, name, 0, self.region.bytes, max_bytes)
    }

    fn sums(&self) -> Result<Option<Vec<FileSum>>, ContainerError> {
        Ok(None)
    }
}
