//! Locks of a data folder: for the one server of a SQLite file, and for the processes whose incoming files lie in the folder.

use super::StorageError;
use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;

/// Held while the file is open; the system releases it when the process ends, even after a crash.
pub struct FolderLock {
    _file: File,
    is_exclusive: bool,
}

impl FolderLock {
    /// Returns an error if a server uses the folder.
    pub fn refuse_in_use(folder: &Path) -> Result<(), StorageError> {
        if folder.exists() { FolderLock::take(folder).map(drop) } else { Ok(()) }
    }

    /// Locks the folder for one process.
    pub(super) fn take(folder: &Path) -> Result<FolderLock, StorageError> {
        let path = folder.join("lock");
        let file = open(&path).map_err(|source| StorageError::File { path: path.clone(), source })?;
        match file.try_lock() {
            Ok(()) => Ok(FolderLock { _file: file, is_exclusive: true }),
            Err(TryLockError::WouldBlock) => Err(StorageError::InUse { path: folder.to_owned() }),
            Err(TryLockError::Error(source)) => Err(StorageError::File { path, source }),
        }
    }

    /// Shares the folder of incoming files with other processes. Without any, it first runs `alone`, and no other process can
    /// share the folder meanwhile. Blocks while another process does this.
    pub(super) fn share(folder: &Path, alone: impl FnOnce() -> io::Result<()>) -> io::Result<FolderLock> {
        let file = open(&folder.join("incoming.lock"))?;
        match file.try_lock() {
            Ok(()) => alone()?,
            Err(TryLockError::WouldBlock) => {}
            Err(TryLockError::Error(error)) => return Err(error),
        }
        // This replaces the exclusive lock.
        file.lock_shared()?;
        Ok(FolderLock { _file: file, is_exclusive: false })
    }

    /// Returns whether no other process can hold a lock of its kind.
    pub(super) fn is_exclusive(&self) -> bool {
        self.is_exclusive
    }
}

fn open(path: &Path) -> io::Result<File> {
    File::options().create(true).append(true).open(path)
}
