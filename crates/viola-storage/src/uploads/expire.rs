//! Expiry of uploads.

use super::{Storage, piece_keys};
use crate::database::query;
use crate::{StorageError, pending_deletes};
use jiff::Timestamp;

/// Most uploads that are removed in one transaction.
const BATCH: i64 = 100;

/// The name under which the pending deletes of expired uploads are recorded.
const OWNER: &str = "expired-uploads";

/// Selects the uploads that expire. One that receives a piece, or is joined to another one, is left alone.
const DUE: &str = "SELECT id FROM uploads
    WHERE expires_at <= $1 AND (state IN ('arriving', 'joined', 'finished', 'refused')
        OR (state = 'arrived' AND kind = 'partial'))
    ORDER BY expires_at LIMIT $2 FOR UPDATE SKIP LOCKED";

impl Storage {
    /// Removes idle uploads and old records of ended ones; returns their number. A complete file was
    /// acknowledged and never expires.
    pub async fn expire_uploads(&self, now: Timestamp) -> Result<u64, StorageError> {
        let mut expired = 0;
        loop {
            let mut transaction = self.database.begin().await?;
            let rows = query(DUE).bind(now.as_millisecond()).bind(BATCH).fetch_all(&mut transaction).await?;
            let mut keys = Vec::new();
            for row in &rows {
                let id = row.id("id")?;
                keys.extend(piece_keys(&mut transaction, id).await?);
                query("DELETE FROM uploads WHERE id = $1")
                    .bind(id.to_string())
                    .execute(&mut transaction)
                    .await?;
            }
            pending_deletes::add(&mut transaction, OWNER, &keys, now).await?;
            // The cleaner finishes the deletions.
            transaction.commit().await?;
            expired += rows.len() as u64;
            if (rows.len() as i64) < BATCH {
                return Ok(expired);
            }
        }
    }
}
