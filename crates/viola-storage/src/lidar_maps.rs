//! The LiDAR maps of a home: one for each level, one revision for every file that was put.

mod put;
mod remove;

pub use put::NewLidarMap;

use super::damage::{check_removed, check_size};
use super::database::{Connection, Row, query};
use super::{BlobReader, HomeId, Page, Storage, StorageError, homes};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_formats::lidar::LidarInfo;
use viola_geometry::{LevelName, Pose2};

/// One revision: a file that was put, and its summary.
#[derive(Debug, Clone, PartialEq)]
pub struct LidarMapRevision {
    id: Uuid,
    pub level: LevelName,
    /// Counts from 1 over all levels of the home; the highest of a level is its current one.
    pub revision: i64,
    pub size_bytes: u64,
    /// SHA-256 of the file, in lower-case hexadecimal.
    pub sha256: String,
    /// Name of the file, from its sender.
    pub file_name: Option<String>,
    pub info: LidarInfo,
    /// `None` for the first revision, and if the maps do not tell it.
    pub from_earlier: Option<FromEarlier>,
    pub created_at: Timestamp,
}

/// The frame of a revision and that of the one that it replaced.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FromEarlier {
    pub revision: i64,
    /// From the frame of `revision`.
    pub map_from_earlier: Pose2,
}

fn from_row(row: &Row) -> Result<LidarMapRevision, StorageError> {
    Ok(LidarMapRevision {
        id: row.id("id")?,
        level: row.name("level")?,
        revision: row.number("revision")?,
        size_bytes: row.count("size_bytes")?,
        sha256: row.text("sha256")?,
        file_name: row.maybe_text("file_name")?,
        info: row.json("info")?,
        from_earlier: row.maybe_json("from_earlier")?,
        created_at: row.time("created_at")?,
    })
}

/// Returns the name under which the pending deletes of a level are recorded.
fn owner(home: &HomeId, level: LevelName) -> String {
    format!("lidar-map:{}:{level}", home.key())
}

pub(super) fn file_key(id: Uuid) -> String {
    format!("lidar-maps/{id}/file")
}

fn image_key(id: Uuid) -> String {
    format!("lidar-maps/{id}/image.png")
}

impl LidarMapRevision {
    /// Returns the id that names its file.
    pub fn id(&self) -> Uuid {
        self.id
    }
}

impl Storage {
    /// Returns the current revision of a level.
    pub async fn lidar_map(&self, home: &HomeId, level: LevelName) -> Result<LidarMapRevision, StorageError> {
        let mut connection = self.database.snapshot().await?;
        homes::require(&mut connection, home).await?;
        current(&mut connection, home, level).await?.ok_or(StorageError::NoLidarMap)
    }

    /// Returns the current revisions of all levels, by the levels' names.
    pub async fn lidar_maps(&self, home: &HomeId) -> Result<Vec<LidarMapRevision>, StorageError> {
        let mut connection = self.database.snapshot().await?;
        homes::require(&mut connection, home).await?;
        levels(&mut connection, home).await
    }

    /// Returns a revision of a level by its number; `None` if it was removed.
    pub async fn lidar_map_revision(
        &self,
        home: &HomeId,
        level: LevelName,
        revision: i64,
    ) -> Result<Option<LidarMapRevision>, StorageError> {
        let row = query(
            "SELECT * FROM lidar_maps WHERE home_id = $1 AND level = $2 AND revision = $3 AND removed_at IS NULL",
        )
        .bind(home.key())
        .bind(level.as_str())
        .bind(revision)
        .fetch_optional(&mut self.database.reader().await?)
        .await?;
        row.as_ref().map(from_row).transpose()
    }

    /// Returns a page of a level's revisions below `after`, newest first.
    pub async fn lidar_map_revisions(
        &self,
        home: &HomeId,
        level: LevelName,
        page: &Page<i64>,
    ) -> Result<Vec<LidarMapRevision>, StorageError> {
        let mut connection = self.database.snapshot().await?;
        homes::require(&mut connection, home).await?;
        let rows = query(
            "SELECT * FROM lidar_maps WHERE home_id = $1 AND level = $4 AND revision < $2
                AND removed_at IS NULL ORDER BY revision DESC LIMIT $3",
        )
        .bind(home.key())
        .bind(page.after.unwrap_or(i64::MAX))
        .bind(i64::from(page.limit))
        .bind(level.as_str())
        .fetch_all(&mut connection)
        .await?;
        rows.iter().map(from_row).collect()
    }

    /// Returns the preview picture of a revision.
    pub async fn lidar_map_image(&self, map: &LidarMapRevision) -> Result<BlobReader, StorageError> {
        match self.blobs.read(&image_key(map.id)).await? {
            Some(image) => Ok(image),
            None => Err(self.removed_or_lost(map.id, image_key(map.id)).await),
        }
    }

    /// Returns the file of a revision, to be sent.
    pub async fn lidar_map_blob(&self, map: &LidarMapRevision) -> Result<BlobReader, StorageError> {
        let Some(blob) = self.blobs.read(&file_key(map.id)).await? else {
            return Err(self.removed_or_lost(map.id, file_key(map.id)).await);
        };
        check_size(self.lidar_map_size_row(map.id).await?.as_ref(), file_key(map.id), blob.size_bytes)?;
        Ok(blob)
    }

    /// Returns the error for a file that the store does not have.
    async fn removed_or_lost(&self, id: Uuid, key: String) -> StorageError {
        let row = self.lidar_map_size_row(id).await;
        row.and_then(|row| check_removed(row.as_ref(), key)).err().unwrap_or(StorageError::NoLidarMap)
    }

    /// Returns the row of a map that is kept.
    async fn lidar_map_size_row(&self, id: Uuid) -> Result<Option<Row>, StorageError> {
        let row = query("SELECT size_bytes FROM lidar_maps WHERE id = $1 AND removed_at IS NULL");
        Ok(row.bind(id.to_string()).fetch_optional(&mut self.database.reader().await?).await?)
    }

    /// Returns the file of a revision.
    pub async fn lidar_map_file(&self, id: Uuid) -> Result<bytes::Bytes, StorageError> {
        let bytes = self.blobs.read_all(&file_key(id)).await?;
        check_size(self.lidar_map_size_row(id).await?.as_ref(), file_key(id), bytes.len() as u64)?;
        Ok(bytes)
    }
}

/// Selects the current revisions of a home's levels.
pub(super) const CURRENT_OF_LEVELS: &str = "SELECT * FROM lidar_maps
    WHERE home_id = $1 AND removed_at IS NULL AND revision =
        (SELECT MAX(revision) FROM lidar_maps AS of_level
        WHERE of_level.home_id = $1 AND of_level.level = lidar_maps.level AND of_level.removed_at IS NULL)
    ORDER BY level";

/// Selects the kept LiDAR maps of a home.
pub(super) const OF_HOME: &str = "SELECT id FROM lidar_maps WHERE home_id = $1 AND removed_at IS NULL";

/// Returns the current revision of a level.
pub(super) async fn current(
    connection: &mut Connection,
    home: &HomeId,
    level: LevelName,
) -> Result<Option<LidarMapRevision>, StorageError> {
    let row = query(
        "SELECT * FROM lidar_maps WHERE home_id = $1 AND level = $2 AND removed_at IS NULL
        ORDER BY revision DESC LIMIT 1",
    );
    let row = row.bind(home.key()).bind(level.as_str()).fetch_optional(connection).await?;
    row.as_ref().map(from_row).transpose()
}

/// Returns the current revisions of all levels, by the levels' names.
pub(super) async fn levels(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Vec<LidarMapRevision>, StorageError> {
    let rows = query(CURRENT_OF_LEVELS).bind(home.key()).fetch_all(connection).await?;
    rows.iter().map(from_row).collect()
}

/// Returns the number of a level's current revision; 0 before the first one.
pub(super) async fn current_revision(
    connection: &mut Connection,
    home: &HomeId,
    level: LevelName,
) -> Result<i64, StorageError> {
    Ok(current(connection, home, level).await?.map_or(0, |map| map.revision))
}

/// Returns the newest revision of all levels, which stands for the set of current maps.
pub(super) async fn newest(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Option<LidarMapRevision>, StorageError> {
    let row = query(
        "SELECT * FROM lidar_maps WHERE home_id = $1 AND removed_at IS NULL ORDER BY revision DESC LIMIT 1",
    );
    row.bind(home.key()).fetch_optional(connection).await?.as_ref().map(from_row).transpose()
}

/// Returns the blob keys of a home's LiDAR maps.
pub(super) async fn blob_keys(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Vec<String>, StorageError> {
    let mut keys = Vec::new();
    for row in &query(OF_HOME).bind(home.key()).fetch_all(connection).await? {
        let id = row.id("id")?;
        keys.extend([file_key(id), image_key(id)]);
    }
    Ok(keys)
}
