//! Storing of arrived files as blobs.

use super::limits::{Limits, within};
use super::place::Place;
use super::{Blobs, StorageError, tried};
use crate::incoming::Arrived;
use futures::StreamExt;
use futures::stream::FuturesUnordered;
use object_store::path::Path as Key;
use object_store::{MultipartUpload, ObjectStoreExt};
use std::io;
use tokio::fs::File;
use tokio::io::AsyncReadExt;
use tokio::sync::SemaphorePermit;

/// Size of the parts in which larger files go to S3. S3 allows at most 10,000 parts, so files of 78 GiB, and
/// at least 5 MiB a part.
const PART_BYTES: usize = 8 << 20;

/// Parts of one file that are sent at once.
const PARTS_AT_ONCE: usize = 2;

/// Parts of all files in memory at once; limits their memory.
pub(super) const PARTS_IN_MEMORY: usize = 16;

/// Tries of a move of a file to its key.
const MOVE_TRIES: u32 = 5;

impl Blobs {
    /// Stores an arrived file under a key; on return it is durable.
    pub async fn keep(&self, file: Arrived, key: &str) -> Result<(), StorageError> {
        let key = Key::from(key);
        match &self.place {
            Place::Folder { incoming: Some(incoming), .. } => self.rename(file, incoming, &key).await,
            _ => self.upload(&file, &key).await,
        }
    }

    /// [`Blobs::keep`] that removes the blob if it fails, since a write that failed may have taken effect.
    pub async fn keep_or_discard(&self, file: Arrived, key: &str) -> Result<(), StorageError> {
        let kept = self.keep(file, key).await;
        if kept.is_err() {
            self.discard(&[key.to_owned()]).await;
        }
        kept
    }

    async fn rename(&self, mut file: Arrived, incoming: &Key, key: &Key) -> Result<(), StorageError> {
        let name = file.path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let from = incoming.clone().join(name);
        // The store removes a folder with its last file. If that happens while this file's folder is created,
        // the move fails, the file stays in place, and the next try creates the folder again.
        let mut moved = self.store.rename(&from, key).await;
        for _ in 1..MOVE_TRIES {
            if moved.is_ok() || !file.path.exists() {
                break;
            }
            moved = self.store.rename(&from, key).await;
        }
        moved?;
        // Renamed: nothing is left for the guard to remove.
        file.path.disable_cleanup(true);
        Ok(())
    }

    async fn upload(&self, file: &Arrived, key: &Key) -> Result<(), StorageError> {
        let mut parts = Parts::of(file).await?;
        if file.size_bytes <= PART_BYTES as u64 {
            let _permit = self.permit().await?;
            return self.put_payload(key, parts.next().await?.into()).await;
        }
        let tries = tried("beginning an upload in parts", || self.store.put_multipart(key));
        let upload = self.limits.bound(tries).await?;
        let mut unfinished = Unfinished { upload: None, limits: self.limits };
        let upload = unfinished.upload.insert(upload);
        self.upload_parts(upload.as_mut(), parts).await?;
        let complete = async {
            match upload.complete().await {
                Ok(_) => Ok(()),
                // The upload may be complete, and only the answer lost.
                Err(error) => match self.store.head(key).await {
                    Ok(found) if found.size == file.size_bytes => Ok(()),
                    _ => Err(error),
                },
            }
        };
        self.limits.bound(complete).await?;
        unfinished.upload = None;
        Ok(())
    }

    /// Reads and sends parts concurrently, in the order of the file.
    async fn upload_parts(
        &self,
        upload: &mut dyn MultipartUpload,
        mut parts: Parts<'_>,
    ) -> Result<(), StorageError> {
        let mut sending = FuturesUnordered::new();
        loop {
            tokio::select! {
                permit = self.permit(), if parts.left_bytes > 0 && sending.len() < PARTS_AT_ONCE => {
                    let (permit, limits) = (permit?, self.limits);
                    let part = upload.put_part(parts.next().await?.into());
                    sending.push(async move {
                        let sent = limits.bound(part).await;
                        drop(permit);
                        sent
                    });
                }
                Some(sent) = sending.next(), if !sending.is_empty() => sent?,
                else => return Ok(()),
            }
        }
    }

    /// Waits for a permit for a part in memory.
    async fn permit(&self) -> Result<SemaphorePermit<'_>, StorageError> {
        let permit = async { Ok(self.parts.acquire().await.expect("it is never closed")) };
        Ok(self.limits.bound(permit).await?)
    }
}

/// A file that is read part by part.
struct Parts<'a> {
    of: &'a Arrived,
    file: File,
    left_bytes: u64,
}

impl<'a> Parts<'a> {
    async fn of(of: &'a Arrived) -> Result<Parts<'a>, StorageError> {
        let error = |source| StorageError::File { path: of.path.to_path_buf(), source };
        Ok(Parts { of, file: File::open(&of.path).await.map_err(error)?, left_bytes: of.size_bytes })
    }

    async fn next(&mut self) -> Result<Vec<u8>, StorageError> {
        let size = self.left_bytes.min(PART_BYTES as u64);
        let mut bytes = Vec::with_capacity(size as usize);
        let read = (&mut self.file).take(size).read_to_end(&mut bytes).await;
        let read = match read {
            Ok(read) if (read as u64) < size => Err(io::Error::from(io::ErrorKind::UnexpectedEof)),
            read => read,
        };
        read.map_err(|source| StorageError::File { path: self.of.path.to_path_buf(), source })?;
        self.left_bytes -= size;
        Ok(bytes)
    }
}

/// A multipart upload. Dropping it aborts the upload in the background, even if its caller is cancelled;
/// otherwise the parts would stay, invisible and billed.
struct Unfinished {
    upload: Option<Box<dyn MultipartUpload>>,
    limits: Limits,
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let (Some(mut upload), limits) = (self.upload.take(), self.limits) else { return };
        let Ok(runtime) = tokio::runtime::Handle::try_current() else { return };
        runtime.spawn(async move {
            if let Err(error) = within(limits.removal, upload.abort()).await {
                tracing::warn!(%error, "an upload in parts could not be aborted; a lifecycle rule has to end it");
            }
        });
    }
}
