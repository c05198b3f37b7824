//! The uploaded files of clips.

use super::file_key;
use crate::damage::{check_removed, check_size};
use crate::database::{Row, query};
use crate::{BlobReader, LocalFile, Storage, StorageError};
use uuid::Uuid;

impl Storage {
    /// Returns the uploaded file unchanged; `None` if the clip was removed.
    pub async fn clip_recording(&self, id: Uuid) -> Result<Option<BlobReader>, StorageError> {
        let blob = self.blobs.read(&file_key(id)).await?;
        match &blob {
            Some(blob) => self.check_clip_file(id, blob.size_bytes).await?,
            None => check_removed(self.clip_size_row(id).await?.as_ref(), file_key(id))?,
        }
        Ok(blob)
    }

    /// Returns the uploaded file, for readers that seek in it.
    pub async fn clip_file(&self, id: Uuid) -> Result<LocalFile, StorageError> {
        let file = self.blobs.local_file(&file_key(id)).await?;
        let found = std::fs::metadata(&*file);
        let found = found.map_err(|source| StorageError::File { path: file.to_path_buf(), source })?;
        self.check_clip_file(id, found.len()).await?;
        Ok(file)
    }

    /// Returns an error if the file of a clip has another size than the one that was stored.
    async fn check_clip_file(&self, id: Uuid, found: u64) -> Result<(), StorageError> {
        check_size(self.clip_size_row(id).await?.as_ref(), file_key(id), found)
    }

    async fn clip_size_row(&self, id: Uuid) -> Result<Option<Row>, StorageError> {
        let row = query("SELECT size_bytes FROM clips WHERE id = $1").bind(id.to_string());
        Ok(row.fetch_optional(&mut self.database.reader().await?).await?)
    }
}
