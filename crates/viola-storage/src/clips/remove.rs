//! Removal of clips.

use super::super::changes::{self, Changed};
use super::super::database::query;
use super::super::{HomeId, Storage, StorageError, home_maps, homes, jobs, pending_deletes};
use super::{Clip, find_locked, owner};
use jiff::Timestamp;
use uuid::Uuid;

impl Storage {
    /// Removes a clip with its results, if the clip is as `expected`. A worker on it loses its lease. Returns an error if
    /// the clip is removed but one of its files is not; another call retries that.
    pub async fn delete_clip(
        &self,
        home: &HomeId,
        id: Uuid,
        expected: impl Fn(&Clip) -> bool + Send,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        let owner = owner(home, id);
        let mut transaction = self.database.begin().await?;
        let clip = match find_locked(&mut transaction, home, id).await {
            Err(StorageError::NoSuchClip) => {
                drop(transaction);
                let had_left = self.delete_pending(&owner).await?;
                return if had_left { Ok(()) } else { Err(StorageError::NoSuchClip) };
            }
            found => found?,
        };
        if !expected(&clip) {
            return Err(StorageError::Changed { what: "clip" });
        }
        if clip.placement.is_some() {
            // The map has the clip until the others in it are aligned, which must not take all the night after a new LiDAR map.
            jobs::advance_home(&mut transaction, home).await?;
        }
        query("DELETE FROM clips WHERE id = $1").bind(id.to_string()).execute(&mut transaction).await?;
        homes::grow(&mut transaction, home, -(clip.stored_bytes() as i64)).await?;
        if clip.result_key.is_some() {
            home_maps::changed(&mut transaction, home, now).await?;
        }
        changes::record(&mut transaction, home, Changed::ClipRemoved { id }, now).await?;
        pending_deletes::add(&mut transaction, &owner, &clip.blobs(), now).await?;
        transaction.commit().await?;
        self.delete_pending(&owner).await?;
        Ok(())
    }
}
