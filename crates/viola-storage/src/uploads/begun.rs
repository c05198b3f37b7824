//! Repeated requests to begin an upload.

use super::{NewUpload, Storage};
use crate::database::query;
use crate::{HomeId, StorageError};
use jiff::Timestamp;
use uuid::Uuid;

impl Storage {
    /// Returns the upload of the same file to the same home, whatever has arrived of it; `None` if there is none, or if the
    /// content of the new one is unknown. A refused or expired one does not count.
    pub async fn same_upload(&self, new: &NewUpload, now: Timestamp) -> Result<Option<Uuid>, StorageError> {
        let Some(content_key) = &new.content_key else { return Ok(None) };
        let row = query(
            "SELECT id FROM uploads
            WHERE home_id = $1 AND content_key = $2 AND kind = $3
                AND COALESCE(length_bytes, $4) IS NOT DISTINCT FROM COALESCE($4, length_bytes)
                AND (state = 'arrived' OR (state IN ('arriving', 'finished') AND expires_at > $5))
            ORDER BY id LIMIT 1",
        )
        .bind(new.home.as_ref().map(HomeId::key))
        .bind(content_key)
        .bind(new.kind.name())
        .bind(new.length_bytes.map(|length| length as i64))
        .bind(now.as_millisecond());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        row.map(|row| row.id("id")).transpose()
    }

    /// Returns the upload that an equal request began and that has no byte yet; `None` if there is none, or if the home or
    /// the length is unknown.
    pub async fn begun_upload(&self, new: &NewUpload, now: Timestamp) -> Result<Option<Uuid>, StorageError> {
        let row = query(
            "SELECT id FROM uploads
            WHERE home_id = $1 AND state = 'arriving' AND kind = $2 AND metadata = $3 AND length_bytes = $4
                AND received_bytes = 0 AND expires_at > $5
            ORDER BY id LIMIT 1",
        )
        .bind(new.home.as_ref().map(HomeId::key))
        .bind(new.kind.name())
        .bind(&new.metadata)
        .bind(new.length_bytes.map(|length| length as i64))
        .bind(now.as_millisecond());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        row.map(|row| row.id("id")).transpose()
    }
}
