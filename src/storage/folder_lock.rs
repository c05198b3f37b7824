//! Lock for one server at a time in a data folder.

use super::StorageError;
use std::fs::{File, TryLockError};
use std::path::Path;

/// Held while the file is open; the system releases it when the process ends, even after a crash.
pub struct FolderLock {
    _file: File,
}

impl FolderLock {
    /// Returns an error if a server uses the folder.
    pub fn refuse_in_use(folder: &Path) -> Result<(), StorageError> {
        if folder.exists() { FolderLock::take(folder).map(drop) } else { Ok(()) }
    }

    pub(super) fn take(folder: &Path) -> Result<FolderLock, StorageError> {
        let path = folder.join("lock");
        let file = File::options().create(true).append(true).open(&path);
        let file = file.map_err(|source| StorageError::File { path: path.clone(), source })?;
        match file.try_lock() {
            Ok(()) => Ok(FolderLock { _file: file }),
            Err(TryLockError::WouldBlock) => Err(StorageError::InUse { path: folder.to_owned() }),
            Err(TryLockError::Error(source)) => Err(StorageError::File { path, source }),
        }
    }
}
