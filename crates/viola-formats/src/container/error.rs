//! Errors of opening and reading a container.

use super::fault::is_machine_fault;
use std::io;
use std::path::Path;

/// Maximum number of entries, directories included: a hundred thousand frames of four files each.
pub const MAX_ENTRIES: usize = 400_000;

/// A refusal: its `Display` is for people, [`ContainerError::code`] for programs.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    #[error("{name} cannot be read: {source}")]
    Unreadable { name: String, source: io::Error },
    #[error("there is no room to unpack {name}: {source}")]
    CannotUnpack { name: String, source: io::Error },
    #[error("the archive unpacks to more than {max_bytes} bytes; split the recording into several clips")]
    UnpacksTooLarge { max_bytes: u64 },
    #[error("the file is empty")]
    Empty,
    #[error("the file is not a zip archive; send a zip of the recording's folder")]
    NotAnArchive,
    #[error(
        "the {packing} file holds no tar archive; send a tar.gz, a tar.zst or a zip of the recording's folder"
    )]
    NoTarInside { packing: &'static str },
    #[error("{name} is an archive inside of the archive or folder; send it by itself")]
    ArchiveInside { name: String },
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
    #[error("the tar archive ends too early: its end mark is missing; send the whole file again")]
    TarTruncated,
    #[error("the tar archive is damaged: {reason}")]
    TarDamaged { reason: String },
    #[error("entry {name} is a sparse file; pack the archive again without --sparse")]
    TarSparse { name: String },
    #[error("entry {name} is a device, a pipe or part of a file; send an archive of plain files")]
    TarSpecialFile { name: String },
    #[error("the {packing} stream ends too early; send the whole file again")]
    PackingTruncated { packing: &'static str },
    #[error("the {packing} stream is damaged: {reason}")]
    PackingDamaged { packing: &'static str, reason: String },
    #[error("the {packing} stream is in more than {max} pieces, which no packer makes of a recording")]
    PackingPieces { packing: &'static str, max: u32 },
    #[error(
        "the zstd stream looks back over more than {max_bytes} bytes; pack it again without --ultra and --long"
    )]
    ZstdWindow { max_bytes: u64 },
    #[error(
        "the archive unpacks to more than {max_bytes} bytes from {packed} packed ones, which no recording does"
    )]
    ArchiveBomb { max_bytes: u64, packed: u64 },
    #[error(
        "there are more than {MAX_ENTRIES} entries, or their names are too long; split the recording into several clips"
    )]
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
    /// Returns the stable name of the refusal, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            ContainerError::Unreadable { .. } => "unreadable",
            ContainerError::CannotUnpack { .. } => "cannot_unpack",
            ContainerError::UnpacksTooLarge { .. } => "unpacks_too_large",
            ContainerError::Empty => "empty",
            // One code for all: the file is no archive of a recording.
            ContainerError::NotAnArchive
            | ContainerError::NoTarInside { .. }
            | ContainerError::ArchiveInside { .. } => "not_an_archive",
            ContainerError::ZipTruncated => "zip_truncated",
            ContainerError::ZipDamaged { .. } => "zip_damaged",
            ContainerError::ZipEncrypted { .. } => "zip_encrypted",
            ContainerError::ZipMethod { .. } => "zip_method",
            ContainerError::ZipBomb { .. } => "zip_bomb",
            ContainerError::TarTruncated => "tar_truncated",
            ContainerError::TarDamaged { .. } => "tar_damaged",
            ContainerError::TarSparse { .. } => "tar_sparse",
            ContainerError::TarSpecialFile { .. } => "tar_special_file",
            ContainerError::PackingTruncated { .. } => "packing_truncated",
            ContainerError::PackingDamaged { .. } => "packing_damaged",
            ContainerError::PackingPieces { .. } => "packing_pieces",
            ContainerError::ZstdWindow { .. } => "zstd_window",
            ContainerError::ArchiveBomb { .. } => "archive_bomb",
            ContainerError::TooManyEntries => "too_many_entries",
            ContainerError::PathEscapes { .. } => "path_escapes",
            ContainerError::Link { .. } => "link",
            ContainerError::DuplicateName { .. } => "duplicate_name",
            ContainerError::Missing { .. } => "missing_file",
            ContainerError::FileTooLarge { .. } => "file_too_large",
        }
    }

    /// Returns whether the machine, not the file, is at fault: a retry may succeed.
    pub fn is_service_fault(&self) -> bool {
        match self {
            ContainerError::CannotUnpack { .. } => true,
            ContainerError::Unreadable { source, .. } => is_machine_fault(source),
            _ => false,
        }
    }

    /// Returns the error of a zip archive that cannot be read: damaged, unless the machine is at fault.
    pub(super) fn damaged_zip(name: &str, source: io::Error) -> ContainerError {
        if is_machine_fault(&source) {
            return ContainerError::Unreadable { name: name.to_owned(), source };
        }
        ContainerError::ZipDamaged { reason: format!("{name}: {source}") }
    }

    /// Returns an error with only the last part of the path: the rest is private to the host.
    pub(crate) fn unreadable(path: &Path, source: io::Error) -> ContainerError {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        ContainerError::Unreadable { name, source }
    }
}
