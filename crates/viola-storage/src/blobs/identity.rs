//! The id of a store, in a file of the store: a wrong bucket, prefix or folder has another one, or none.

use super::{BlobPlace, Blobs, StorageError};
use uuid::Uuid;

/// Key of the file with the id. It is no blob: listings leave it out, and a sweep leaves it alone.
pub(super) const STORE_ID: &str = "viola-store-id";

/// Returns the name of a place for people.
pub(super) fn name_of(place: &BlobPlace) -> String {
    match place {
        BlobPlace::Folder(folder) => format!("the folder {}", folder.display()),
        BlobPlace::S3(s3) if s3.prefix.is_empty() => format!("the bucket {}", s3.bucket),
        BlobPlace::S3(s3) => format!("the bucket {} with the prefix {}", s3.bucket, s3.prefix),
    }
}

impl Blobs {
    /// Returns the name of the place for people.
    pub fn place_name(&self) -> &str {
        &self.place_name
    }

    /// Returns the id of the store; `None` if it has none yet.
    pub async fn store_id(&self) -> Result<Option<Uuid>, StorageError> {
        let Some(bytes) = self.read_if_there(STORE_ID).await? else { return Ok(None) };
        let text = String::from_utf8_lossy(&bytes);
        match text.trim().parse() {
            Ok(id) => Ok(Some(id)),
            Err(_) => Err(StorageError::DamagedStoreId { place: self.place_name.clone() }),
        }
    }

    /// Gives the store an id; on return it is durable.
    pub async fn put_store_id(&self, id: Uuid) -> Result<(), StorageError> {
        self.put(STORE_ID, format!("{id}\n").into_bytes()).await
    }
}
