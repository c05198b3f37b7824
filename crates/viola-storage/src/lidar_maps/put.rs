//! New revisions of a LiDAR map, the end of old ones, and the jobs that align clips to them.

use super::remove::remove_to;
use super::{FromEarlier, LidarMapRevision, current, file_key, image_key, levels, owner};
use crate::changes::{self, Changed};
use crate::columns::to_json;
use crate::database::query;
use crate::incoming::Arrived;
use crate::quota::{self, QuotaCheck};
use crate::{HomeId, Storage, StorageError, choices, home_maps, homes, jobs, pending_deletes};
use jiff::Timestamp;
use uuid::Uuid;
use viola_formats::lidar::LidarInfo;
use viola_geometry::{LevelName, MAX_LEVELS};

/// Revisions of a level whose files are kept; a new one removes older ones.
const KEPT_LIDAR_MAPS: i64 = 10;

/// A map whose file was read and validated.
pub struct NewLidarMap {
    pub level: LevelName,
    pub file: Arrived,
    /// Name of the file, from its sender.
    pub file_name: Option<String>,
    pub info: LidarInfo,
    /// The frame of the revision that it replaces, if the maps tell it.
    pub from_earlier: Option<FromEarlier>,
    /// Preview picture.
    pub image_png: Vec<u8>,
}

impl NewLidarMap {
    /// Returns the size of its files.
    pub fn bytes(&self) -> u64 {
        self.file.size_bytes.saturating_add(self.image_png.len() as u64)
    }
}

/// Returns the revision that a file for a level replaces. Refuses the file if that is not as `expected`, or if the home has the
/// maximum number of other levels.
fn replaced(
    maps: &[LidarMapRevision],
    level: LevelName,
    expected: impl Fn(Option<&LidarMapRevision>) -> bool,
) -> Result<Option<&LidarMapRevision>, StorageError> {
    let before = maps.iter().find(|map| map.level == level);
    if !expected(before) {
        return Err(StorageError::Changed { what: "LiDAR map" });
    }
    if before.is_none() && maps.len() >= MAX_LEVELS {
        return Err(StorageError::TooManyLevels);
    }
    Ok(before)
}

impl Storage {
    /// Returns the error with which [`Storage::put_lidar_map`] would refuse a file for a level because of the home's maps.
    pub async fn check_lidar_map(
        &self,
        home: &HomeId,
        level: LevelName,
        expected: impl Fn(Option<&LidarMapRevision>) -> bool,
    ) -> Result<(), StorageError> {
        replaced(&self.lidar_maps(home).await?, level, expected).map(|_| ())
    }

    /// Adds a revision of a level and queues every clip of the home for it, if the level's current revision is as
    /// `expected`. The same file as that of the current revision changes nothing. Returns the revision and whether it
    /// is new. `max_bytes` is the quota of a tenant without one of its own.
    pub async fn put_lidar_map(
        &self,
        home: &HomeId,
        new: NewLidarMap,
        max_bytes: Option<u64>,
        expected: impl Fn(Option<&LidarMapRevision>) -> bool + Send,
        now: Timestamp,
    ) -> Result<(LidarMapRevision, bool), StorageError> {
        let NewLidarMap { level, file, file_name, info, from_earlier, image_png } = new;
        let row = NewRow {
            id: Uuid::now_v7(),
            level,
            size_bytes: file.size_bytes,
            image_bytes: image_png.len() as u64,
            sha256: file.sha256.clone(),
            file_name,
            info,
            from_earlier,
        };
        let keys = [file_key(row.id), image_key(row.id)];
        // Concurrently: a slow store delays this once.
        let (file, image) =
            tokio::join!(self.blobs.keep(file, &keys[0]), self.blobs.put(&keys[1], image_png));
        let added = match file.and(image) {
            Ok(()) => self.insert_lidar_map(home, row, max_bytes, expected, now).await,
            Err(error) => Err(error),
        };
        self.discard_unless(&keys, &added, |(_, is_new)| *is_new).await;
        added
    }

    /// Makes an earlier revision of a level the current one again, as a new revision with the same file, if the
    /// level's current revision is as `expected`. `from_earlier` is the frame of the revision that it replaces. Returns the
    /// current revision and whether it is new.
    pub async fn restore_lidar_map(
        &self,
        home: &HomeId,
        earlier: &LidarMapRevision,
        from_earlier: Option<FromEarlier>,
        max_bytes: Option<u64>,
        expected: impl Fn(Option<&LidarMapRevision>) -> bool + Send,
        now: Timestamp,
    ) -> Result<(LidarMapRevision, bool), StorageError> {
        let bytes = self.earlier_lidar_map_file(home, earlier).await?;
        let image = self.blobs.read_all(&image_key(earlier.id)).await;
        let image = self.unless_gone(home, earlier, image).await?;
        let mut file = self.incoming()?;
        file.write(&bytes).await?;
        let new = NewLidarMap {
            level: earlier.level,
            file: file.finish().await?,
            file_name: earlier.file_name.clone(),
            info: earlier.info.clone(),
            from_earlier,
            image_png: image.to_vec(),
        };
        self.put_lidar_map(home, new, max_bytes, expected, now).await
    }

    /// Returns the file of an earlier revision.
    pub async fn earlier_lidar_map_file(
        &self,
        home: &HomeId,
        earlier: &LidarMapRevision,
    ) -> Result<bytes::Bytes, StorageError> {
        let file = self.lidar_map_file(earlier.id).await;
        self.unless_gone(home, earlier, file).await
    }

    /// Returns what was `read` of an earlier revision. A file that is missing may be gone with its home or its level.
    async fn unless_gone<T>(
        &self,
        home: &HomeId,
        earlier: &LidarMapRevision,
        read: Result<T, StorageError>,
    ) -> Result<T, StorageError> {
        if read.is_err() && self.lidar_map_revision(home, earlier.level, earlier.revision).await?.is_none() {
            return Err(StorageError::NoLidarMap);
        }
        read
    }

    /// Adds the row of a revision whose blobs are stored.
    async fn insert_lidar_map(
        &self,
        home: &HomeId,
        new: NewRow,
        max_bytes: Option<u64>,
        expected: impl Fn(Option<&LidarMapRevision>) -> bool + Send,
        now: Timestamp,
    ) -> Result<(LidarMapRevision, bool), StorageError> {
        let mut transaction = self.database.begin().await?;
        homes::lock_existing(&mut transaction, home).await?;
        let maps = levels(&mut transaction, home).await?;
        let before = replaced(&maps, new.level, expected)?;
        // Another request may have replaced the revision that it was compared with.
        let from_earlier =
            new.from_earlier.filter(|from| before.is_some_and(|before| before.revision == from.revision));
        if let Some(same) = before.filter(|before| before.sha256 == new.sha256) {
            return Ok((same.clone(), false));
        }
        let new_bytes = new.size_bytes + new.image_bytes;
        quota::check(&mut transaction, home.tenant(), new_bytes, QuotaCheck::Enforce { max_bytes }).await?;
        // Revisions count removed maps, too.
        let last = query("SELECT COALESCE(MAX(revision), 0) AS last FROM lidar_maps WHERE home_id = $1");
        let last = last.bind(home.key()).fetch_one(&mut transaction).await?;
        let revision = last.number("last")? + 1;
        query(
            "INSERT INTO lidar_maps (id, home_id, revision, size_bytes, sha256, info, created_at, level, image_bytes,
                 file_name, from_earlier)
            VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)",
        )
        .bind(new.id.to_string())
        .bind(home.key())
        .bind(revision)
        .bind(new.size_bytes as i64)
        .bind(&new.sha256)
        .bind(to_json(&new.info))
        .bind(now.as_millisecond())
        .bind(new.level.as_str())
        .bind(new.image_bytes as i64)
        .bind(&new.file_name)
        .bind(from_earlier.as_ref().map(to_json))
        .execute(&mut transaction)
        .await?;
        homes::grow(&mut transaction, home, new_bytes as i64).await?;
        if let Some(from_earlier) = &from_earlier {
            // Jobs before clips, as everywhere.
            jobs::lock_of_home(&mut transaction, home).await?;
            choices::carry_over(&mut transaction, home, new.level, from_earlier, revision).await?;
        }
        let mut stale_blobs = jobs::enqueue_home(&mut transaction, home, new.id, now).await?;
        stale_blobs.extend(remove_to(&mut transaction, home, new.level, KEPT_LIDAR_MAPS, now).await?);
        home_maps::outdated(&mut transaction, home, now).await?;
        changes::record(&mut transaction, home, Changed::LidarMap { revision }, now).await?;
        let added = current(&mut transaction, home, new.level).await?.ok_or(StorageError::NoLidarMap)?;
        let owner = owner(home, new.level);
        pending_deletes::add(&mut transaction, &owner, &stale_blobs, now).await?;
        transaction.commit().await?;
        self.discard_pending(&owner, &stale_blobs).await;
        Ok((added, true))
    }
}

struct NewRow {
    id: Uuid,
    level: LevelName,
    size_bytes: u64,
    image_bytes: u64,
    sha256: String,
    file_name: Option<String>,
    info: LidarInfo,
    from_earlier: Option<FromEarlier>,
}
