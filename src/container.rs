//! Where the files of a clip or a map lie: a folder, or a zip archive that nobody has to unpack.
//!
//! Both are hostile until shown otherwise. Names are checked before anything is read, every read says how
//! many bytes it is prepared to take, and no size that an archive declares is believed.

mod folder;
mod zip;

pub use folder::Folder;
pub use zip::Zip;

use std::collections::HashSet;
use std::path::Path;

/// Entries of one container, directories included: a hundred thousand frames of four files each.
pub const MAX_ENTRIES: usize = 400_000;
/// Length of an entry's name in bytes.
const MAX_NAME_BYTES: usize = 1024;

/// Named files, readable from several threads at once.
pub trait Container: Send + Sync {
    /// Names relative to the container's root, parts separated by `/`, in byte order. Hidden files
    /// (a part that begins with `.`) and what macOS adds to archives are left out.
    fn names(&self) -> &[String];

    /// The whole file, or [`ContainerError::FileTooLarge`] when it has more than `max_bytes`.
    fn read(&self, name: &str, max_bytes: u64) -> Result<Vec<u8>, ContainerError>;

    fn contains(&self, name: &str) -> bool {
        position(self.names(), name).is_some()
    }
}

/// Opens a folder, or a file that must be a zip archive.
pub fn open(path: &Path) -> Result<Box<dyn Container>, ContainerError> {
    let metadata = std::fs::metadata(path).map_err(|source| ContainerError::unreadable(path, source))?;
    if metadata.is_dir() { Ok(Box::new(Folder::open(path)?)) } else { Ok(Box::new(Zip::open(path)?)) }
}

/// Why a container is refused or cannot be read on.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    #[error("{name} cannot be read: {source}")]
    Unreadable { name: String, source: std::io::Error },
    #[error("the file is empty")]
    Empty,
    #[error("the file is not a zip archive; send a zip of the recording's folder")]
    NotAnArchive,
    #[error("the zip archive ends too early: its directory is missing; send the whole file again")]
    ZipTruncated,
    #[error("the zip archive is damaged: {reason}")]
    ZipDamaged { reason: String },
    #[error("entry {name} is encrypted; send the archive without a password")]
    ZipEncrypted { name: String },
    #[error("entry {name} uses a compression other than deflate; pack the archive again with plain deflate")]
    ZipMethod { name: String },
    #[error("{name} would unpack to {bytes} bytes from {packed} packed ones, which no recording does")]
    ZipBomb { name: String, bytes: u64, packed: u64 },
    #[error("there are more than {MAX_ENTRIES} entries; send the recording in parts")]
    TooManyEntries,
    #[error(
        "entry {name} is refused: its name is absolute, has a drive or `..`, is too long, or it is a link that leads out"
    )]
    PathEscapes { name: String },
    #[error("entry {name} is a link; send an archive of plain files")]
    Link { name: String },
    #[error("two entries are called {name}")]
    DuplicateName { name: String },
    #[error("{name} is missing")]
    Missing { name: String },
    #[error("{name} has more than {max_bytes} bytes, which is too large for what it should hold")]
    FileTooLarge { name: String, max_bytes: u64 },
}

impl ContainerError {
    /// Stable name of the refusal, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            ContainerError::Unreadable { .. } => "unreadable",
            ContainerError::Empty => "empty",
            ContainerError::NotAnArchive => "not_an_archive",
            ContainerError::ZipTruncated => "zip_truncated",
            ContainerError::ZipDamaged { .. } => "zip_damaged",
            ContainerError::ZipEncrypted { .. } => "zip_encrypted",
            ContainerError::ZipMethod { .. } => "zip_method",
            ContainerError::ZipBomb { .. } => "zip_bomb",
            ContainerError::TooManyEntries => "too_many_entries",
            ContainerError::PathEscapes { .. } => "path_escapes",
            ContainerError::Link { .. } => "link",
            ContainerError::DuplicateName { .. } => "duplicate_name",
            ContainerError::Missing { .. } => "missing_file",
            ContainerError::FileTooLarge { .. } => "file_too_large",
        }
    }

    /// Only the last part of the path is told: the rest is the host's business.
    pub(crate) fn unreadable(path: &Path, source: std::io::Error) -> ContainerError {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        ContainerError::Unreadable { name, source }
    }
}

/// Where a name is in a sorted list of names.
fn position(names: &[String], name: &str) -> Option<usize> {
    names.binary_search_by(|n| n.as_str().cmp(name)).ok()
}

/// An archive's name for an entry with `/` as the only separator, or a refusal when it leads out.
fn safe_name(raw: &str) -> Result<String, ContainerError> {
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

/// A name as messages show it: short, and without control characters.
fn shown(raw: &str) -> String {
    raw.chars().take(120).map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// Whether a checked name is of no interest: hidden, or macOS's resource forks.
fn is_ignored(name: &str) -> bool {
    name.is_empty() || name.split('/').any(|part| part.starts_with('.') || part == "__MACOSX")
}

/// Refuses names that occur twice.
fn check_unique<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), ContainerError> {
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(ContainerError::DuplicateName { name: shown(name) });
        }
    }
    Ok(())
}

/// Reads to the end, but no more than `max_bytes`.
fn read_bounded(
    reader: &mut dyn std::io::Read,
    name: &str,
    max_bytes: u64,
) -> Result<Vec<u8>, ContainerError> {
    use std::io::Read;
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
