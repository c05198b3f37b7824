//! The LiDAR maps of a home, one revision for every file that was put.

mod put;

pub use put::NewLidarMap;

use super::columns::Columns;
use super::database::{Connection, Row, query};
use super::{BlobReader, HomeId, Page, Storage, StorageError, homes};
use jiff::Timestamp;
use uuid::Uuid;
use viola_formats::lidar::LidarInfo;

/// One revision: a file that was put, and its summary.
#[derive(Debug, Clone, PartialEq)]
pub struct LidarMapRevision {
    id: Uuid,
    /// Counts from 1; the highest is the current one.
    pub revision: i64,
    pub size_bytes: u64,
    /// SHA-256 of the file, in lower-case hexadecimal.
    pub sha256: String,
    pub info: LidarInfo,
    pub created_at: Timestamp,
}

fn from_row(row: &Row) -> Result<LidarMapRevision, StorageError> {
    Ok(LidarMapRevision {
        id: row.id("id")?,
        revision: row.number("revision")?,
        size_bytes: row.count("size_bytes")?,
        sha256: row.text("sha256")?,
        info: row.json("info")?,
        created_at: row.time("created_at")?,
    })
}

fn file_key(id: Uuid) -> String {
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
    /// Returns the current revision.
    pub async fn lidar_map(&self, home: &HomeId) -> Result<LidarMapRevision, StorageError> {
        let mut connection = self.database.snapshot().await?;
        if !homes::exists(&mut connection, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        current_or_missing(&mut connection, home).await
    }

    /// Returns a page of the revisions below `after`, newest first.
    pub async fn lidar_map_revisions(
        &self,
        home: &HomeId,
        page: &Page<i64>,
    ) -> Result<Vec<LidarMapRevision>, StorageError> {
        let mut connection = self.database.snapshot().await?;
        if !homes::exists(&mut connection, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        let rows = query(
            "SELECT * FROM lidar_maps WHERE home_id = $1 AND revision < $2 ORDER BY revision DESC LIMIT $3",
        )
        .bind(home.key())
        .bind(page.after.unwrap_or(i64::MAX))
        .bind(i64::from(page.limit))
        .fetch_all(&mut connection)
        .await?;
        rows.iter().map(from_row).collect()
    }

    /// Returns the preview picture of the current revision.
    pub async fn lidar_map_image(&self, home: &HomeId) -> Result<BlobReader, StorageError> {
        let map = self.lidar_map(home).await?;
        self.blobs.read(&image_key(map.id)).await?.ok_or(StorageError::NoLidarMap)
    }

    /// Returns the file of a revision.
    pub async fn lidar_map_file(&self, id: Uuid) -> Result<bytes::Bytes, StorageError> {
        self.blobs.read_all(&file_key(id)).await
    }

    #[cfg(test)]
    pub(super) async fn lidar_map_blob_keys(&self) -> Result<Vec<String>, StorageError> {
        blob_keys(&mut *self.database.snapshot().await?, None).await
    }
}

pub(super) async fn current(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Option<LidarMapRevision>, StorageError> {
    let row = query("SELECT * FROM lidar_maps WHERE home_id = $1 ORDER BY revision DESC LIMIT 1")
        .bind(home.key())
        .fetch_optional(connection)
        .await?;
    row.as_ref().map(from_row).transpose()
}

async fn current_or_missing(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<LidarMapRevision, StorageError> {
    current(connection, home).await?.ok_or(StorageError::NoLidarMap)
}

/// Returns the number of the current revision; 0 before the first one.
pub(super) async fn current_revision(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<i64, StorageError> {
    Ok(current(connection, home).await?.map_or(0, |map| map.revision))
}

pub(super) async fn current_id(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Option<Uuid>, StorageError> {
    Ok(current(connection, home).await?.map(|map| map.id))
}

/// Returns the blob keys of one home's LiDAR maps, or of all.
pub(super) async fn blob_keys(
    connection: &mut Connection,
    home: Option<&HomeId>,
) -> Result<Vec<String>, StorageError> {
    let rows = query("SELECT id FROM lidar_maps WHERE $1 IS NULL OR home_id = $1")
        .bind(home.map(HomeId::key))
        .fetch_all(connection)
        .await?;
    let mut keys = Vec::new();
    for row in &rows {
        let id = row.id("id")?;
        keys.extend([file_key(id), image_key(id)]);
    }
    Ok(keys)
}
