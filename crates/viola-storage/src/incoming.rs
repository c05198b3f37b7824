//! Incoming files: on the disk, but not yet blobs.

use super::error::StorageError;
use sha2::{Digest, Sha256};
use std::path::Path;
use tempfile::TempPath;
use tokio::fs::File;
use tokio::io::AsyncWriteExt;

/// A file that arrives piece by piece. Dropping it removes the file, so an aborted upload leaves nothing.
pub struct Incoming {
    path: TempPath,
    file: File,
    sha256: Sha256,
    size_bytes: u64,
}

impl Incoming {
    pub(super) fn new_in(folder: &Path) -> Result<Incoming, StorageError> {
        let file = tempfile::NamedTempFile::new_in(folder)
            .map_err(|source| StorageError::File { path: folder.to_owned(), source })?;
        let (file, path) = file.into_parts();
        Ok(Incoming { path, file: File::from_std(file), sha256: Sha256::new(), size_bytes: 0 })
    }

    pub async fn write(&mut self, bytes: &[u8]) -> Result<(), StorageError> {
        self.sha256.update(bytes);
        self.size_bytes += bytes.len() as u64;
        let written = self.file.write_all(bytes).await;
        written.map_err(|source| StorageError::File { path: self.path.to_path_buf(), source })
    }

    pub fn size_bytes(&self) -> u64 {
        self.size_bytes
    }

    /// Waits until every byte is on the disk.
    pub async fn finish(mut self) -> Result<Arrived, StorageError> {
        let error = |source| StorageError::File { path: self.path.to_path_buf(), source };
        self.file.flush().await.map_err(error)?;
        self.file.sync_all().await.map_err(error)?;
        let sha256 = self.sha256.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Arrived { path: self.path, sha256, size_bytes: self.size_bytes })
    }
}

/// A complete, durable file that is not yet a blob. Dropping it removes the file.
pub struct Arrived {
    pub(super) path: TempPath,
    /// In lower-case hexadecimal.
    pub sha256: String,
    pub size_bytes: u64,
}

impl Arrived {
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the whole file. Blocks.
    pub fn read(&self) -> Result<Vec<u8>, StorageError> {
        std::fs::read(&self.path)
            .map_err(|source| StorageError::File { path: self.path.to_path_buf(), source })
    }
}
