//! Files that lost bytes since they were stored.

use super::columns::Columns;
use super::database::{Row, query};
use super::{Storage, StorageError, clips};
use uuid::Uuid;

/// Compares the size of a file with that of its row; without a row the file was removed meanwhile.
pub(super) fn check_size(row: Option<&Row>, key: String, found: u64) -> Result<(), StorageError> {
    let Some(row) = row else { return Ok(()) };
    let expected = row.count("size_bytes")?;
    if found == expected { Ok(()) } else { Err(StorageError::DamagedFile { key, found, expected }) }
}

impl Storage {
    /// Returns an error if the file of a clip has another size than the one that was stored.
    pub(super) async fn check_clip_file(&self, id: Uuid, found: u64) -> Result<(), StorageError> {
        let row = query("SELECT size_bytes FROM clips WHERE id = $1").bind(id.to_string());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        check_size(row.as_ref(), clips::file_key(id), found)
    }
}
