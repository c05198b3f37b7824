//! Removal of levels.

use super::{LidarMapRevision, file_key, image_key, levels, owner};
use crate::changes::{self, Changed};
use crate::database::{Transaction, query};
use crate::{Choice, HomeId, Storage, StorageError, corrections, home_maps, homes, jobs, pending_deletes};
use jiff::Timestamp;
use viola_geometry::LevelName;

impl Storage {
    /// Removes the LiDAR maps of a level with all that people chose and corrected on it, and queues every clip
    /// of the home for the other levels, if the level's current revision is as `expected`. Returns an error if the level is removed
    /// but one of its files is not; another call retries that.
    pub async fn delete_lidar_map(
        &self,
        home: &HomeId,
        level: LevelName,
        expected: impl Fn(Option<&LidarMapRevision>) -> bool + Send,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        let owner = owner(home, level);
        let mut transaction = self.database.begin().await?;
        homes::lock_existing(&mut transaction, home).await?;
        let (removed, left): (Vec<_>, Vec<_>) =
            levels(&mut transaction, home).await?.into_iter().partition(|map| map.level == level);
        if removed.is_empty() {
            drop(transaction);
            let had_left = self.delete_pending(&owner).await?;
            return if had_left { Ok(()) } else { Err(StorageError::NoLidarMap) };
        }
        if !expected(removed.first()) {
            return Err(StorageError::Changed { what: "LiDAR map" });
        }
        let newest = left.iter().max_by_key(|map| map.revision).ok_or(StorageError::LastLevel)?;
        let mut keys = remove_to(&mut transaction, home, level, 0, now).await?;
        // Jobs before clips, as everywhere.
        jobs::lock_of_home(&mut transaction, home).await?;
        withdraw_choices(&mut transaction, home, level).await?;
        corrections::forget_level(&mut transaction, home, level, now).await?;
        keys.extend(jobs::enqueue_home(&mut transaction, home, newest.id, now).await?);
        home_maps::outdated(&mut transaction, home, now).await?;
        let revision = newest.revision;
        changes::record(&mut transaction, home, Changed::LidarMap { revision }, now).await?;
        pending_deletes::add(&mut transaction, &owner, &keys, now).await?;
        transaction.commit().await?;
        self.delete_pending(&owner).await?;
        Ok(())
    }
}

/// Removes all revisions of a level except the newest `kept`; returns the keys of their blobs.
pub(super) async fn remove_to(
    transaction: &mut Transaction,
    home: &HomeId,
    level: LevelName,
    kept: i64,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let rows = query(
        "UPDATE lidar_maps SET removed_at = $3 WHERE home_id = $1 AND level = $2 AND removed_at IS NULL
            AND revision NOT IN (SELECT revision FROM lidar_maps
                WHERE home_id = $1 AND level = $2 AND removed_at IS NULL ORDER BY revision DESC LIMIT $4)
        RETURNING id, size_bytes, image_bytes",
    );
    let rows = rows.bind(home.key()).bind(level.as_str()).bind(now.as_millisecond()).bind(kept);
    let (mut keys, mut bytes) = (Vec::new(), 0);
    for row in &rows.fetch_all(&mut *transaction).await? {
        let id = row.id("id")?;
        keys.extend([file_key(id), image_key(id)]);
        bytes += row.number("size_bytes")? + row.number("image_bytes")?;
    }
    homes::grow(transaction, home, -bytes).await?;
    forget_removed(transaction, home).await?;
    Ok(keys)
}

/// Deletes the rows of removed revisions that no kept job names: a robot's map may change every day. The newest row stays, since
/// the next revision counts from it.
async fn forget_removed(transaction: &mut Transaction, home: &HomeId) -> Result<(), StorageError> {
    let forget = query(
        "DELETE FROM lidar_maps WHERE home_id = $1 AND removed_at IS NOT NULL
            AND revision < (SELECT MAX(revision) FROM lidar_maps AS newest WHERE newest.home_id = $1)
            AND NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.lidar_map_id = lidar_maps.id)",
    );
    forget.bind(home.key()).execute(transaction).await?;
    Ok(())
}

/// Withdraws the choices on a level: their frame is gone.
async fn withdraw_choices(
    transaction: &mut Transaction,
    home: &HomeId,
    level: LevelName,
) -> Result<(), StorageError> {
    let rows = query("SELECT id, choice FROM clips WHERE home_id = $1 AND choice IS NOT NULL ORDER BY id");
    for row in &rows.bind(home.key()).fetch_all(transaction).await? {
        if row.json::<Choice>("choice")?.level == level {
            let withdraw = query("UPDATE clips SET choice = NULL WHERE id = $1").bind(row.text("id")?);
            withdraw.execute(transaction).await?;
        }
    }
    Ok(())
}
