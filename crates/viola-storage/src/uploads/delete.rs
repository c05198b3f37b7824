//! Deletes uploads with their bytes.

use super::{Storage, UploadError, find_living, owner, piece_keys};
use crate::database::{Transaction, query};
use crate::{StorageError, pending_deletes};
use jiff::Timestamp;
use uuid::Uuid;

impl Storage {
    /// Deletes an upload and its bytes. A clip that was made of it stays.
    pub async fn delete_upload(&self, id: Uuid, now: Timestamp) -> Result<(), UploadError> {
        // A refusal inside the transaction keeps its lock until the driver has rolled back, after the answer.
        self.living_upload(id, now).await?;
        let mut transaction = self.database.begin().await?;
        // A join by another process may take the pieces.
        let lock = query("SELECT id FROM uploads WHERE id = $1 FOR UPDATE");
        lock.bind(id.to_string()).fetch_optional(&mut transaction).await?;
        find_living(&mut transaction, id, now).await?;
        Ok(self.delete_locked(transaction, id, now).await?)
    }

    /// Deletes an upload and its bytes; `transaction` has locked it, and is committed.
    async fn delete_locked(
        &self,
        mut transaction: Transaction,
        id: Uuid,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        let keys = piece_keys(&mut transaction, id).await?;
        query("DELETE FROM uploads WHERE id = $1").bind(id.to_string()).execute(&mut transaction).await?;
        pending_deletes::add(&mut transaction, &owner(id), &keys, now).await?;
        transaction.commit().await?;
        self.discard_pending(&owner(id), &keys).await;
        Ok(())
    }

    /// Deletes an upload whose first request broke, since its client does not know the path. The upload stays if a repeated
    /// request finds it by its content, and if another request has resumed it, which may have acknowledged bytes.
    pub async fn abandon_upload(&self, id: Uuid, now: Timestamp) -> Result<(), StorageError> {
        let mut transaction = self.database.begin().await?;
        // The first request incremented the fence once.
        let unknown =
            query("SELECT id FROM uploads WHERE id = $1 AND content_key IS NULL AND fence <= 1 FOR UPDATE");
        if unknown.bind(id.to_string()).fetch_optional(&mut transaction).await?.is_none() {
            return Ok(());
        }
        self.delete_locked(transaction, id, now).await
    }
}
