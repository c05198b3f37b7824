//! Files that were lost, or lost bytes, since they were stored.

use super::StorageError;
use super::database::Row;

/// Compares the size of a file with that of its row; without a row the file was removed meanwhile.
pub(super) fn check_size(row: Option<&Row>, key: String, found: u64) -> Result<(), StorageError> {
    let Some(row) = row else { return Ok(()) };
    check_bytes(row.count("size_bytes")?, key, found)
}

/// Compares the size of a file with the one that was stored.
pub(super) fn check_bytes(expected: u64, key: String, found: u64) -> Result<(), StorageError> {
    if found == expected { Ok(()) } else { Err(StorageError::DamagedFile { key, found, expected }) }
}

/// Returns an error if a row names a file that the store does not have; without a row the file was removed meanwhile.
pub(super) fn check_removed(row: Option<&Row>, key: String) -> Result<(), StorageError> {
    if row.is_none() {
        return Ok(());
    }
    let source = "the database names it, and the store does not have it".into();
    Err(object_store::Error::NotFound { path: key, source }.into())
}
