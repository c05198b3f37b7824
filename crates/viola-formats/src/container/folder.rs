//! A folder on this machine.

use super::contents::{read_bounded, region_of};
use super::names::{is_ignored, required, shown};
use super::{Container, ContainerError, MAX_ENTRIES, Region};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// Number of folder levels that are searched.
const MAX_DEPTH: usize = 8;

/// The files below a folder of this machine's owner. Links are followed, even those that lead out of it; only archives
/// come from strangers.
pub struct Folder {
    root: PathBuf,
    names: Vec<String>,
}

impl Folder {
    pub fn open(path: &Path) -> Result<Folder, ContainerError> {
        let root = fs::canonicalize(path).map_err(|source| ContainerError::unreadable(path, source))?;
        let mut folder = Folder { root, names: Vec::new() };
        folder.collect()?;
        folder.names.sort_unstable();
        Ok(folder)
    }

    fn collect(&mut self) -> Result<(), ContainerError> {
        let mut entries = 0;
        let mut open = vec![(String::new(), vec![self.root.clone()])];
        while let Some((prefix, above)) = open.pop() {
            let path = self.root.join(&prefix);
            let unreadable = |source| ContainerError::unreadable(&path, source);
            for entry in fs::read_dir(&path).map_err(unreadable)? {
                let entry = entry.map_err(unreadable)?;
                entries += 1;
                if entries > MAX_ENTRIES {
                    return Err(ContainerError::TooManyEntries);
                }
                // A name that is not UTF-8 belongs to no layout.
                let Ok(part) = entry.file_name().into_string() else { continue };
                if is_ignored(&part) {
                    continue;
                }
                let name = if prefix.is_empty() { part } else { format!("{prefix}/{part}") };
                // A broken link belongs to no layout.
                let Ok(metadata) = fs::metadata(entry.path()) else { continue };
                if metadata.is_file() {
                    self.names.push(name);
                } else if metadata.is_dir() && above.len() < MAX_DEPTH {
                    let folder = fs::canonicalize(entry.path()).map_err(unreadable)?;
                    // A link to a folder above it would never end.
                    if !above.iter().any(|above| above.starts_with(&folder)) {
                        open.push((name, above.iter().cloned().chain([folder]).collect()));
                    }
                }
            }
        }
        Ok(())
    }

    fn file(&self, name: &str) -> Result<File, ContainerError> {
        required(&self.names, name)?;
        let path = self.root.join(name);
        File::open(&path).map_err(|source| ContainerError::unreadable(&path, source))
    }
}

impl Container for Folder {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError> {
        read_bounded(&mut self.file(name)?, name, max_bytes)
    }

    fn region(&self, name: &str, max_bytes: u64) -> Result<Region, ContainerError> {
        let whole = Region::whole(self.file(name)?)
            .map_err(|source| ContainerError::Unreadable { name: shown(name), source })?;
        region_of(&whole, name, 0, whole.bytes, max_bytes)
    }
}
