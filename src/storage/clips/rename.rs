//! Titles of clips.

use super::{Clip, find, find_locked};
use crate::storage::changes::{self, Changed};
use crate::storage::database::query;
use crate::storage::{HomeId, Storage, StorageError};
use jiff::Timestamp;
use uuid::Uuid;

impl Storage {
    /// Sets a clip's title, if the clip is as `expected`. The same title again changes nothing.
    pub async fn rename_clip(
        &self,
        home: &HomeId,
        id: Uuid,
        title: Option<&str>,
        expected: impl Fn(&Clip) -> bool + Send,
        now: Timestamp,
    ) -> Result<Clip, StorageError> {
        let mut transaction = self.database.begin().await?;
        let clip = find_locked(&mut transaction, home, id).await?;
        if clip.title.as_deref() == title {
            return Ok(clip);
        }
        if !expected(&clip) {
            return Err(StorageError::Changed { what: "clip" });
        }
        query("UPDATE clips SET title = $2, updated_at = $3 WHERE id = $1")
            .bind(id.to_string())
            .bind(title)
            .bind(now.as_millisecond())
            .execute(&mut transaction)
            .await?;
        changes::record(&mut transaction, home, Changed::Clip { id, state: clip.state }, now).await?;
        let clip = find(&mut transaction, home, id).await?;
        transaction.commit().await?;
        Ok(clip)
    }
}
