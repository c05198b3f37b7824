//! Files under keys. A key is written once and holds no name that a client chose.

use super::incoming::Arrived;
use super::{Incoming, Storage, StorageError};
use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt, PutPayload};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Folder of files that are still arriving, beside the blobs so that keeping one is a rename.
const INCOMING: &str = "incoming";

/// How long to wait after each failed write.
const PAUSES: [Duration; 2] = [Duration::from_millis(20), Duration::from_millis(200)];

/// How often a move of a file to its key is tried.
const KEEP_TRIES: u32 = 5;

pub(super) struct Blobs {
    pub(super) store: Box<dyn ObjectStore>,
    folder: PathBuf,
}

/// A blob as it is read: its size, then its bytes.
pub struct BlobReader {
    pub size_bytes: u64,
    pub stream: BoxStream<'static, Result<Bytes, StorageError>>,
}

impl Blobs {
    pub fn open(folder: &Path) -> Result<Blobs, StorageError> {
        let incoming = folder.join(INCOMING);
        std::fs::create_dir_all(&incoming).map_err(|source| StorageError::File { path: incoming, source })?;
        let store = LocalFileSystem::new_with_prefix(folder)?.with_fsync(true).with_automatic_cleanup(true);
        Ok(Blobs { store: Box::new(store), folder: folder.to_owned() })
    }

    pub fn incoming(&self) -> Result<Incoming, StorageError> {
        Incoming::new_in(&self.folder.join(INCOMING))
    }

    /// Keeps an arrived file under a key; on return it is durable.
    pub async fn keep(&self, mut file: Arrived, key: &str) -> Result<(), StorageError> {
        let name = file.path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let (from, to) = (Key::from_iter([INCOMING, name]), Key::from(key));
        // The store removes a folder with the last file in it. Where that happens while this one's folder is made, the
        // move fails; the file is then still where it was, and the next try makes the folder again.
        let mut moved = self.store.rename(&from, &to).await;
        for _ in 1..KEEP_TRIES {
            if moved.is_ok() || !file.path.exists() {
                break;
            }
            moved = self.store.rename(&from, &to).await;
        }
        moved?;
        // Renamed: nothing is left for the guard to remove.
        file.path.disable_cleanup(true);
        Ok(())
    }

    /// Writes a blob; a store that fails is asked again before the caller is told. Under the same key, since a write
    /// that failed may have come through.
    pub async fn put(&self, key: &str, bytes: Vec<u8>) -> Result<(), StorageError> {
        let (key, bytes) = (Key::from(key), PutPayload::from(bytes));
        for pause in PAUSES {
            match self.store.put(&key, bytes.clone()).await {
                Ok(_) => return Ok(()),
                Err(error) => tracing::warn!(%key, %error, "a blob could not be written; it is tried again"),
            }
            tokio::time::sleep(pause).await;
        }
        self.store.put(&key, bytes).await?;
        Ok(())
    }

    /// None when the blob was removed since the caller read its row.
    pub async fn read(&self, key: &str) -> Result<Option<BlobReader>, StorageError> {
        let found = match self.store.get(&Key::from(key)).await {
            Err(object_store::Error::NotFound { .. }) => return Ok(None),
            found => found?,
        };
        let size_bytes = found.meta.size;
        let stream = found.into_stream().map_err(StorageError::from).boxed();
        Ok(Some(BlobReader { size_bytes, stream }))
    }

    /// The same in one piece.
    pub async fn read_if_there(&self, key: &str) -> Result<Option<Bytes>, StorageError> {
        match self.store.get(&Key::from(key)).await {
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            found => Ok(Some(found?.bytes().await?)),
        }
    }

    pub async fn read_all(&self, key: &str) -> Result<Bytes, StorageError> {
        Ok(self.store.get(&Key::from(key)).await?.bytes().await?)
    }

    /// The blob as a file for readers that need to seek in it.
    pub fn file(&self, key: &str) -> PathBuf {
        self.folder.join(key)
    }

    /// Removes blobs that no row refers to any more. What cannot be removed now is swept at the next start.
    pub async fn discard(&self, keys: &[String]) {
        for key in keys {
            match self.store.delete(&Key::from(key.as_str())).await {
                Ok(()) | Err(object_store::Error::NotFound { .. }) => {}
                Err(error) => tracing::error!(key, %error, "a blob could not be removed"),
            }
        }
    }

    /// Removes every file that is not one of the keys. Only sound while nothing writes.
    pub fn sweep(&self, keys: &HashSet<String>) -> Result<(), StorageError> {
        for key in self.keys()?.iter().filter(|key| !keys.contains(*key)) {
            tracing::info!(key, "removing what an interrupted write left");
            let path = self.folder.join(key);
            std::fs::remove_file(&path).map_err(|source| StorageError::File { path, source })?;
        }
        Ok(())
    }

    /// Every file there is, also those that are arriving or being written: the store's own listing hides them.
    pub fn keys(&self) -> Result<Vec<String>, StorageError> {
        let mut keys = Vec::new();
        let mut folders = vec![self.folder.clone()];
        while let Some(folder) = folders.pop() {
            let error = |source| StorageError::File { path: folder.clone(), source };
            for entry in std::fs::read_dir(&folder).map_err(error)? {
                let entry = entry.map_err(error)?;
                let path = entry.path();
                if entry.file_type().map_err(error)?.is_dir() {
                    folders.push(path);
                } else {
                    keys.push(
                        path.strip_prefix(&self.folder).unwrap_or(&path).to_string_lossy().into_owned(),
                    );
                }
            }
        }
        Ok(keys)
    }
}

impl Storage {
    /// Begins to receive a file.
    pub fn incoming(&self) -> Result<Incoming, StorageError> {
        self.blobs.incoming()
    }
}
