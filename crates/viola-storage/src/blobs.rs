//! Files under keys, in a folder or on S3. A key is written once and contains no name that a client chose.
//!
//! Incoming files lie in a local folder in both cases. Every operation on S3 has a timeout, see [`limits`].

mod identity;
mod keep;
mod limits;
mod local_file;
mod place;
mod read;
mod sweep;
#[cfg(test)]
mod tests;

pub use local_file::LocalFile;
pub use place::{BlobPlace, S3Params};
pub use read::{BlobParts, BlobReader};

use super::error::StorageError;
use super::incoming::Incoming;
use futures::StreamExt;
use limits::Limits;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt, PutPayload};
use place::Place;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;

/// Pauses between tries.
const PAUSES: [Duration; 2] = [Duration::from_millis(20), Duration::from_millis(200)];

pub(super) struct Blobs {
    pub(super) store: Arc<dyn ObjectStore>,
    place: Place,
    place_name: String,
    /// Folder of incoming files and temporary copies. If it lies in the blob folder, a rename stores a file.
    incoming: PathBuf,
    limits: Limits,
    /// One permit for each part of a file that is in memory while it is sent to the store.
    parts: Semaphore,
}

impl Blobs {
    /// Opens a place without checking that it is reachable, see [`Blobs::ready`]. The folder `incoming` must
    /// hold nothing else: a sweep empties it.
    pub fn open(place: &BlobPlace, incoming: &Path) -> Result<Blobs, StorageError> {
        let limits = match place {
            BlobPlace::Folder(_) => Limits::NONE,
            BlobPlace::S3(_) => Limits::S3,
        };
        Blobs::open_within(place, incoming, limits)
    }

    fn open_within(place: &BlobPlace, incoming: &Path, limits: Limits) -> Result<Blobs, StorageError> {
        let whole = |path: &Path| {
            let made = std::fs::create_dir_all(path).and_then(|()| path.canonicalize());
            made.map_err(|source| StorageError::File { path: path.to_owned(), source })
        };
        let (incoming, place_name) = (whole(incoming)?, identity::name_of(place));
        let (store, place) = match place {
            BlobPlace::Folder(folder) => place::open_folder(&whole(folder)?, &incoming)?,
            BlobPlace::S3(params) => place::open_s3(params, &limits)?,
        };
        let parts = Semaphore::new(keep::PARTS_IN_MEMORY);
        Ok(Blobs { store, place, place_name, incoming, limits, parts })
    }

    pub fn incoming(&self) -> Result<Incoming, StorageError> {
        Incoming::new_in(&self.incoming)
    }

    /// Returns the folder of files that are not blobs yet.
    pub fn incoming_folder(&self) -> &Path {
        &self.incoming
    }

    /// Writes a blob. Retries use the same key, since a write that failed may have taken effect.
    pub async fn put(&self, key: &str, bytes: Vec<u8>) -> Result<(), StorageError> {
        self.put_payload(&Key::from(key), PutPayload::from(bytes)).await
    }

    async fn put_payload(&self, key: &Key, bytes: PutPayload) -> Result<(), StorageError> {
        let tries = tried("writing a blob", || self.store.put(key, bytes.clone()));
        self.limits.bound(tries).await?;
        Ok(())
    }

    /// Removes blobs that no row refers to any more. Returns an error unless all of them are removed.
    pub async fn remove_all(&self, keys: &[String]) -> Result<(), StorageError> {
        let tries = tried("removing blobs", || self.remove(keys));
        Ok(limits::within(self.limits.removal, tries).await?)
    }

    /// [`Blobs::remove_all`] for recorded deletions, which no sweep removes: a slow store has more time.
    pub async fn remove_recorded(&self, keys: &[String]) -> Result<(), StorageError> {
        let tries = tried("removing blobs", || self.remove(keys));
        Ok(self.limits.bound(tries).await?)
    }

    /// Removes blobs that no row refers to any more. If the store fails, a sweep removes the rest.
    pub async fn discard(&self, keys: &[String]) {
        if let Err(error) = self.remove_all(keys).await {
            tracing::error!(blobs = keys.len(), first = ?keys.first(), %error, "blobs could not be removed");
        }
    }

    /// Removes blobs; missing ones count as removed.
    async fn remove(&self, keys: &[String]) -> object_store::Result<()> {
        // As they are listed: a file of somebody else may have characters that `from` would replace.
        let keys: Vec<_> = keys.iter().map(|key| Ok(Key::parse(key)?)).collect();
        let mut removed = self.store.delete_stream(futures::stream::iter(keys).boxed());
        let mut failed = None;
        while let Some(removed) = removed.next().await {
            match removed {
                Ok(_) | Err(object_store::Error::NotFound { .. }) => {}
                Err(error) => failed = Some(error),
            }
        }
        failed.map_or(Ok(()), Err)
    }
}

/// Retries an operation after each of [`PAUSES`]. The client retries refusals, but not all broken requests.
async fn tried<T, Once>(what: &'static str, once: impl Fn() -> Once) -> object_store::Result<T>
where
    Once: Future<Output = object_store::Result<T>>,
{
    for pause in PAUSES {
        match once().await {
            Ok(done) => return Ok(done),
            Err(error @ object_store::Error::NotFound { .. }) => return Err(error),
            Err(error) => tracing::warn!(%error, "{what} failed; it is tried again"),
        }
        tokio::time::sleep(pause).await;
    }
    once().await
}
