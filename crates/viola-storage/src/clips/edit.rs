//! Facts about clips that a person corrects.

use super::{Clip, find, find_locked};
use crate::changes::{self, Changed};
use crate::columns::stored;
use crate::database::query;
use crate::{HomeId, Storage, StorageError, clock, home_maps};
use jiff::Timestamp;
use uuid::Uuid;

/// A correction of a clip; what is `None` stays.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ClipEdit {
    /// The title, or none.
    pub title: Option<Option<String>>,
    /// The time of the recording, or none.
    pub recorded_at: Option<Option<Timestamp>>,
}

impl Storage {
    /// Corrects a clip, if the clip is as `expected`. The same facts again change nothing. A clip in the home's map makes the
    /// map due if its time changes: later clips win there.
    pub async fn edit_clip(
        &self,
        home: &HomeId,
        id: Uuid,
        edit: ClipEdit,
        expected: impl Fn(&Clip) -> bool + Send,
        now: Timestamp,
    ) -> Result<Clip, StorageError> {
        let mut transaction = self.database.begin().await?;
        let clip = find_locked(&mut transaction, home, id).await?;
        let title = edit.title.unwrap_or_else(|| clip.title.clone());
        let recorded_at = edit.recorded_at.map_or(clip.recorded_at, |time| time.map(stored));
        if title == clip.title && recorded_at == clip.recorded_at {
            return Ok(clip);
        }
        if !expected(&clip) {
            return Err(StorageError::Changed { what: "clip" });
        }
        let update = concat!(
            "UPDATE clips SET title = $2, recorded_at = $3, ",
            clock::change_at!("$4"),
            " WHERE id = $1"
        );
        query(update)
            .bind(id.to_string())
            .bind(&title)
            .bind(recorded_at.map(Timestamp::as_millisecond))
            .bind(now.as_millisecond())
            .execute(&mut transaction)
            .await?;
        if recorded_at != clip.recorded_at && clip.result_key.is_some() {
            home_maps::changed(&mut transaction, home, now).await?;
        }
        changes::record(&mut transaction, home, Changed::Clip { id, state: clip.state }, now).await?;
        let clip = find(&mut transaction, home, id).await?;
        transaction.commit().await?;
        Ok(clip)
    }
}
