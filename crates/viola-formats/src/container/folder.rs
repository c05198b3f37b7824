//! A folder on this machine.

use super::contents::{read_bounded, region_of};
use super::names::{is_ignored, required, shown};
use super::{Container, ContainerError, MAX_ENTRIES, Region};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// Number of folder levels that are searched.
const MAX_DEPTH: usize = 8;

/// The files below a folder. Links to files inside it are followed, links to folders are not.
pub struct Folder {
    root: PathBuf,
    names: Vec<String>,
}

impl Folder {
    pub fn open(path: &Path) -> Result<Folder, ContainerError> {
        let root = fs::canonicalize(path).map_err(|source| ContainerError::unreadable(path, source))?;
        let mut folder = Folder { root, names: Vec::new() };
        folder.collect(&mut 0)?;
        folder.names.sort_unstable();
        Ok(folder)
    }

    fn collect(&mut self, entries: &mut usize) -> Result<(), ContainerError> {
        let mut open = vec![(String::new(), 0)];
        while let Some((prefix, depth)) = open.pop() {
            let path = self.root.join(&prefix);
            let unreadable = |source| ContainerError::unreadable(&path, source);
            for entry in fs::read_dir(&path).map_err(unreadable)? {
                let entry = entry.map_err(unreadable)?;
                *entries += 1;
                if *entries > MAX_ENTRIES {
                    return Err(ContainerError::TooManyEntries);
                }
                // A name that is not UTF-8 belongs to no layout.
                let Ok(part) = entry.file_name().into_string() else { continue };
                if is_ignored(&part) {
                    continue;
                }
                let name = if prefix.is_empty() { part } else { format!("{prefix}/{part}") };
                let kind = entry.file_type().map_err(unreadable)?;
                if kind.is_dir() {
                    if depth + 1 < MAX_DEPTH {
                        open.push((name, depth + 1));
                    }
                } else if kind.is_file() || (kind.is_symlink() && self.link_is_file(&name)?) {
                    self.names.push(name);
                }
            }
        }
        Ok(())
    }

    /// Returns whether a link leads to a file inside the folder; broken links and links to folders do not.
    fn link_is_file(&self, name: &str) -> Result<bool, ContainerError> {
        let Ok(target) = fs::canonicalize(self.root.join(name)) else { return Ok(false) };
        if !target.starts_with(&self.root) {
            return Err(ContainerError::PathEscapes { name: shown(name) });
        }
        Ok(target.is_file())
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
