//! Idempotency keys: a repeated upload makes no second clip. They live as long as the clip.

use super::database::{Connection, query};
use super::{HomeId, Storage, StorageError};
use jiff::Timestamp;
use uuid::Uuid;

/// Earlier use of a key.
pub(super) struct Used {
    pub clip: Uuid,
    pub sha256: String,
}

impl Storage {
    /// Returns the size of the clip that was uploaded to a home with this key; `None` if there is none.
    pub async fn bytes_of_key(&self, home: &HomeId, key: &str) -> Result<Option<u64>, StorageError> {
        let row = query(
            "SELECT clips.size_bytes FROM idempotency_keys JOIN clips ON clips.id = idempotency_keys.clip_id
            WHERE idempotency_keys.home_id = $1 AND idempotency_key = $2",
        );
        let row = row.bind(home.key()).bind(key);
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        row.map(|row| row.count("size_bytes")).transpose()
    }
}

pub(super) async fn find(
    connection: &mut Connection,
    home: &HomeId,
    key: &str,
) -> Result<Option<Used>, StorageError> {
    let row =
        query("SELECT clip_id, sha256 FROM idempotency_keys WHERE home_id = $1 AND idempotency_key = $2")
            .bind(home.key())
            .bind(key)
            .fetch_optional(connection)
            .await?;
    row.map(|row| Ok(Used { clip: row.id("clip_id")?, sha256: row.text("sha256")? })).transpose()
}

pub(super) async fn insert(
    connection: &mut Connection,
    home: &HomeId,
    key: &str,
    sha256: &str,
    clip: Uuid,
    now: Timestamp,
) -> Result<(), StorageError> {
    query(
        "INSERT INTO idempotency_keys (home_id, idempotency_key, sha256, clip_id, created_at)
        VALUES ($1, $2, $3, $4, $5)",
    )
    .bind(home.key())
    .bind(key)
    .bind(sha256)
    .bind(clip.to_string())
    .bind(now.as_millisecond())
    .execute(connection)
    .await?;
    Ok(())
}
