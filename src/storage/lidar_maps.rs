//! The LiDAR maps of a home, one revision for every file that was put.

use super::changes::{self, Changed};
use super::columns::{Columns, to_json};
use super::database::{Connection, Row, query};
use super::incoming::Arrived;
use super::{BlobReader, HomeId, Page, Storage, StorageError, homes, jobs};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_formats::lidar::LidarInfo;

/// One file that was put, and what was understood of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct LidarMapRevision {
    #[serde(skip)]
    id: Uuid,
    /// Counts from 1; the highest is the current one.
    #[schema(minimum = 1, example = 2)]
    pub revision: i64,
    #[schema(example = 15540)]
    pub size_bytes: u64,
    /// Of the file, in lower-case hexadecimal.
    pub sha256: String,
    pub info: LidarInfo,
    pub created_at: Timestamp,
}

/// A map that was read and found good.
pub struct NewLidarMap {
    pub file: Arrived,
    pub info: LidarInfo,
    /// Preview picture.
    pub image_png: Vec<u8>,
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
    /// What names its file.
    pub fn id(&self) -> Uuid {
        self.id
    }
}

impl Storage {
    /// Adds a revision and queues every clip of the home for it. The same file as the current revision's
    /// changes nothing; the flag tells whether there is a new revision.
    pub async fn put_lidar_map(
        &self,
        home: &HomeId,
        new: NewLidarMap,
        now: Timestamp,
    ) -> Result<(LidarMapRevision, bool), StorageError> {
        let id = Uuid::now_v7();
        let row =
            NewRow { id, size_bytes: new.file.size_bytes, sha256: new.file.sha256.clone(), info: new.info };
        // Side by side: a store that is slow is waited for once.
        let (file_key, image_key) = (file_key(id), image_key(id));
        let (file, image) =
            tokio::join!(self.blobs.keep(new.file, &file_key), self.blobs.put(&image_key, new.image_png));
        if let Err(error) = file.and(image) {
            self.blobs.discard(&[file_key, image_key]).await;
            return Err(error);
        }
        let added = self.insert_lidar_map(home, row, now).await;
        let is_for_nothing = match &added {
            Ok((_, is_new)) => !is_new,
            // The row may be there all the same; a sweep decides.
            Err(error) => !error.is_unsettled(),
        };
        if is_for_nothing {
            self.blobs.discard(&[file_key, image_key]).await;
        }
        added
    }

    async fn insert_lidar_map(
        &self,
        home: &HomeId,
        new: NewRow,
        now: Timestamp,
    ) -> Result<(LidarMapRevision, bool), StorageError> {
        let mut transaction = self.database.begin().await?;
        if !homes::lock(&mut transaction, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        let current = current(&mut transaction, home).await?;
        let revision = current.as_ref().map_or(0, |current| current.revision) + 1;
        if let Some(current) = current
            && current.sha256 == new.sha256
        {
            return Ok((current, false));
        }
        query(
            "INSERT INTO lidar_maps (id, home_id, revision, size_bytes, sha256, info, created_at)
            VALUES ($1, $2, $3, $4, $5, $6, $7)",
        )
        .bind(new.id.to_string())
        .bind(home.key())
        .bind(revision)
        .bind(new.size_bytes as i64)
        .bind(&new.sha256)
        .bind(to_json(&new.info))
        .bind(now.as_millisecond())
        .execute(&mut transaction)
        .await?;
        homes::grow(&mut transaction, home, new.size_bytes as i64).await?;
        let stale_blobs = jobs::enqueue_home(&mut transaction, home, new.id, now).await?;
        changes::record(&mut transaction, home, Changed::LidarMap { revision }, now).await?;
        let added = current_or_missing(&mut transaction, home).await?;
        transaction.commit().await?;
        self.blobs.discard(&stale_blobs).await;
        Ok((added, true))
    }

    /// The current revision.
    pub async fn lidar_map(&self, home: &HomeId) -> Result<LidarMapRevision, StorageError> {
        let mut connection = self.database.snapshot().await?;
        if !homes::exists(&mut connection, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        current_or_missing(&mut connection, home).await
    }

    /// The newest first; a page goes on below the revision `after`.
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

    /// The preview picture of the current revision.
    pub async fn lidar_map_image(&self, home: &HomeId) -> Result<BlobReader, StorageError> {
        let map = self.lidar_map(home).await?;
        self.blobs.read(&image_key(map.id)).await?.ok_or(StorageError::NoLidarMap)
    }

    /// The file of a revision.
    pub async fn lidar_map_file(&self, id: Uuid) -> Result<bytes::Bytes, StorageError> {
        self.blobs.read_all(&file_key(id)).await
    }

    #[cfg(test)]
    pub(super) async fn lidar_map_blob_keys(&self) -> Result<Vec<String>, StorageError> {
        blob_keys(&mut *self.database.snapshot().await?, None).await
    }
}

struct NewRow {
    id: Uuid,
    size_bytes: u64,
    sha256: String,
    info: LidarInfo,
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

/// The id of the current revision.
/// 0 before the first one.
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

/// The blobs of one home's maps, or of all.
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
