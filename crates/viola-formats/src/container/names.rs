//! The names of a container's entries: checked, unique and in order.

use super::{ContainerError, MAX_ENTRIES};

/// Maximum length of an entry's name in bytes.
pub(super) const MAX_NAME_BYTES: usize = 1024;
/// Maximum length of all names together: more than 150 bytes for each of `MAX_ENTRIES`.
const MAX_NAMES_BYTES: usize = 64 << 20;

/// Collects an archive's entries and their data.
pub(super) struct Entries<T> {
    found: Vec<(String, T)>,
    names_bytes: usize,
}

impl<T> Entries<T> {
    pub fn new() -> Entries<T> {
        Entries { found: Vec::new(), names_bytes: 0 }
    }

    /// Adds an entry whose name [`safe_name`] has checked.
    pub fn push(&mut self, name: String, entry: T) -> Result<(), ContainerError> {
        self.names_bytes += name.len();
        if self.found.len() >= MAX_ENTRIES || self.names_bytes > MAX_NAMES_BYTES {
            return Err(ContainerError::TooManyEntries);
        }
        self.found.push((name, entry));
        Ok(())
    }

    /// Returns the names in byte order, and the data of each. Duplicate names are refused, even among ignored
    /// entries.
    pub fn finish(mut self) -> Result<(Vec<String>, Vec<T>), ContainerError> {
        self.found.sort_unstable_by(|(a, _), (b, _)| a.cmp(b));
        if let Some(twice) = self.found.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(ContainerError::DuplicateName { name: shown(&twice[0].0) });
        }
        self.found.retain(|(name, _)| !is_ignored(name));
        Ok(self.found.into_iter().unzip())
    }
}

/// Returns the index of a name in a sorted list.
pub(super) fn position(names: &[String], name: &str) -> Option<usize> {
    names.binary_search_by(|n| n.as_str().cmp(name)).ok()
}

/// Returns the [`position`] of a name, or [`ContainerError::Missing`].
pub(super) fn required(names: &[String], name: &str) -> Result<usize, ContainerError> {
    position(names, name).ok_or_else(|| ContainerError::Missing { name: shown(name) })
}

/// Returns an entry's name with `/` as the only separator, or an error if it leads out.
pub(super) fn safe_name(raw: &str) -> Result<String, ContainerError> {
    let escapes = || ContainerError::PathEscapes { name: shown(raw) };
    let name = raw.replace('\\', "/");
    let has_drive = name.as_bytes().get(1) == Some(&b':') && name.as_bytes()[0].is_ascii_alphabetic();
    if name.starts_with('/') || has_drive || name.contains('\0') || name.len() > MAX_NAME_BYTES {
        return Err(escapes());
    }
    let mut parts = Vec::new();
    for part in name.split('/') {
        match part {
            ".." => return Err(escapes()),
            "" | "." => {}
            _ => parts.push(part),
        }
    }
    Ok(parts.join("/"))
}

/// Formats a name for messages: short, and without control characters.
pub(super) fn shown(raw: &str) -> String {
    raw.chars().take(120).map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// Returns whether a checked name is ignored: hidden files and macOS's resource forks.
pub(super) fn is_ignored(name: &str) -> bool {
    name.is_empty() || name.split('/').any(|part| part.starts_with('.') || part == "__MACOSX")
}
