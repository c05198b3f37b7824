//! Pending deletes: the blobs of deleted resources. They are recorded in the transaction of the deletion, and
//! struck off once the store has removed them. So a deletion succeeds only when every byte is gone, a client
//! can retry it if the store failed, and a process that dies in between leaves no unknown blobs.

use super::columns::{Columns, to_json};
use super::database::{Transaction, query};
use super::{Storage, StorageError};
use jiff::Timestamp;
use uuid::Uuid;

/// Most deletions that one pass of cleaning handles.
const AT_ONCE: i64 = 100;

/// Records blobs to remove. `owner` names the deleted resource.
pub(super) async fn add(
    transaction: &mut Transaction,
    owner: &str,
    keys: &[String],
    now: Timestamp,
) -> Result<(), StorageError> {
    if keys.is_empty() {
        return Ok(());
    }
    query("INSERT INTO doomed_blobs (id, owner, blob_keys, created_at) VALUES ($1, $2, $3, $4)")
        .bind(Uuid::now_v7().to_string())
        .bind(owner)
        .bind(to_json(&keys))
        .bind(now.as_millisecond())
        .execute(transaction)
        .await?;
    Ok(())
}

/// Assigns the pending deletes of all owners `PREFIX:...` to one owner.
pub(super) async fn take_over(
    transaction: &mut Transaction,
    owner: &str,
    prefix: &str,
) -> Result<(), StorageError> {
    // A semicolon sorts right after a colon.
    query("UPDATE doomed_blobs SET owner = $1 WHERE owner > $2 AND owner < $3")
        .bind(owner)
        .bind(format!("{prefix}:"))
        .bind(format!("{prefix};"))
        .execute(transaction)
        .await?;
    Ok(())
}

impl Storage {
    /// Removes an owner's pending blobs; returns whether there were any.
    pub(super) async fn delete_pending(&self, owner: &str) -> Result<bool, StorageError> {
        let rows = query("SELECT id, blob_keys FROM doomed_blobs WHERE owner = $1 ORDER BY id").bind(owner);
        let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
        for row in &rows {
            self.remove_row(row.id("id")?, row.json("blob_keys")?).await?;
        }
        Ok(!rows.is_empty())
    }

    /// Finishes deletions that were interrupted or whose store failed; returns the number of deletions.
    pub async fn finish_deletions(&self) -> Result<u64, StorageError> {
        let rows =
            query("SELECT id, blob_keys FROM doomed_blobs ORDER BY created_at, id LIMIT $1").bind(AT_ONCE);
        let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
        // One failure does not stop the others.
        let mut ended = Ok(rows.len() as u64);
        for row in &rows {
            if let Err(error) = self.remove_row(row.id("id")?, row.json("blob_keys")?).await {
                ended = Err(error);
            }
        }
        ended
    }

    async fn remove_row(&self, id: Uuid, keys: Vec<String>) -> Result<(), StorageError> {
        self.blobs.remove_all(&keys).await?;
        let mut transaction = self.database.begin().await?;
        query("DELETE FROM doomed_blobs WHERE id = $1")
            .bind(id.to_string())
            .execute(&mut transaction)
            .await?;
        transaction.commit().await
    }
}
