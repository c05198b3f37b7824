//! The fused maps of homes: which are due to be merged, by whom, and the revisions that came of it.

use super::changes::{self, Changed};
use super::columns::{Columns, to_json};
use super::database::{Connection, Row, Transaction};
use super::{BlobReader, ClipState, HomeId, Storage, StorageError, homes, lidar_maps};
use crate::align::Reason;
use crate::home::HomeMapInfo;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::time::Duration;
use uuid::Uuid;

/// Revisions of a home's map that are kept; older ones go when a new one comes. Readers that began with one have long
/// ended when it is this old.
const KEPT: i64 = 5;

/// One state of a home's fused map. It never changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct HomeMap {
    /// Counts from 1; the highest is the current one.
    #[schema(minimum = 1, example = 4)]
    pub revision: i64,
    /// The LiDAR map in whose frame it is.
    #[schema(minimum = 1, example = 1)]
    pub lidar_map_revision: i64,
    /// The clips that are in it, by id.
    pub clips: Vec<Uuid>,
    pub info: HomeMapInfo,
    pub created_at: Timestamp,
    #[serde(skip)]
    blob_key: String,
}

/// A clip that is not in its home's map, and why.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct LeftOut {
    pub clip: Uuid,
    pub state: ClipState,
    pub reasons: Vec<Reason>,
}

/// A home whose map this worker merges.
#[derive(Debug, Clone)]
pub struct MergeClaim {
    pub home: HomeId,
    wanted: i64,
    fence: i64,
    lidar_map_revision: i64,
    clips: Vec<(Uuid, String)>,
}

impl MergeClaim {
    /// How many clips the map is made of.
    pub fn clips(&self) -> usize {
        self.clips.len()
    }
}

fn from_row(row: &Row) -> Result<HomeMap, StorageError> {
    Ok(HomeMap {
        revision: row.number("revision")?,
        lidar_map_revision: row.number("lidar_map_revision")?,
        clips: row.json("clips")?,
        info: row.json("info")?,
        created_at: row.time("created_at")?,
        blob_key: row.text("blob_key")?,
    })
}

/// Takes a home whose map is behind, that nobody merges now, and none of whose clips is on its way: a new LiDAR map
/// that sends all of them around again makes one new revision, and the old one stays until then.
const CLAIM: &str = "UPDATE homes SET map_fence = map_fence + 1, map_lease_until = $2
    WHERE id = (
        SELECT id FROM homes
        WHERE map_made < map_wanted AND (map_lease_until IS NULL OR map_lease_until <= $1)
            AND NOT EXISTS (SELECT 1 FROM clips WHERE home_id = homes.id AND state IN ('queued', 'aligning'))
        ORDER BY id LIMIT 1)
    RETURNING id, map_wanted, map_fence";

impl Storage {
    /// Gives a home whose map is due to a worker, none when there is none.
    pub async fn claim_merge(
        &self,
        lease: Duration,
        now: Timestamp,
    ) -> Result<Option<MergeClaim>, StorageError> {
        let mut transaction = self.database.begin().await?;
        let row = sqlx::query(CLAIM)
            .bind(now.as_millisecond())
            .bind((now + lease).as_millisecond())
            .fetch_optional(&mut *transaction)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let home = row.home("id")?;
        let clips = aligned(&mut transaction, &home).await?;
        let claim = MergeClaim {
            wanted: row.number("map_wanted")?,
            fence: row.number("map_fence")?,
            lidar_map_revision: lidar_maps::current_revision(&mut transaction, &home).await?,
            home,
            clips,
        };
        transaction.commit().await?;
        Ok(Some(claim))
    }

    /// The cloud of one of a claim's clips, by its place in the order of their ids. None when the clip was removed or
    /// aligned anew since: then the home is due again anyway.
    pub async fn merge_cloud(
        &self,
        claim: &MergeClaim,
        place: usize,
    ) -> Result<Option<bytes::Bytes>, StorageError> {
        let Some((_, result_key)) = claim.clips.get(place) else { return Ok(None) };
        match self.blobs.read_all(&format!("{result_key}/cloud.ply")).await {
            Err(StorageError::Blobs(object_store::Error::NotFound { .. })) => Ok(None),
            cloud => Ok(Some(cloud?)),
        }
    }

    /// Keeps a merged map as the home's next revision. False when the claim was lost; then nothing changes.
    pub async fn finish_merge(
        &self,
        claim: &MergeClaim,
        info: &HomeMapInfo,
        cloud_ply: Vec<u8>,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        // A key of its own for every attempt, as with the results of clips.
        let blob_key = format!("home-maps/{}.ply", Uuid::now_v7());
        self.blobs.put(&blob_key, cloud_ply).await?;
        let mut transaction = self.database.begin().await?;
        let held = sqlx::query(
            "UPDATE homes SET map_made = $3, map_lease_until = NULL WHERE id = $1 AND map_fence = $2",
        )
        .bind(claim.home.as_str())
        .bind(claim.fence)
        .bind(claim.wanted);
        if held.execute(&mut *transaction).await?.rows_affected() == 0 {
            drop(transaction);
            self.blobs.discard(&[blob_key]).await;
            return Ok(false);
        }
        let stale = insert(&mut transaction, claim, info, &blob_key, now).await?;
        transaction.commit().await?;
        self.blobs.discard(&stale).await;
        Ok(true)
    }

    /// Gives a claim back after an error, to be tried again from `due` on.
    pub async fn give_back_merge(&self, claim: &MergeClaim, due: Timestamp) -> Result<(), StorageError> {
        let mut transaction = self.database.begin().await?;
        sqlx::query("UPDATE homes SET map_lease_until = $3 WHERE id = $1 AND map_fence = $2")
            .bind(claim.home.as_str())
            .bind(claim.fence)
            .bind(due.as_millisecond())
            .execute(&mut *transaction)
            .await?;
        transaction.commit().await?;
        Ok(())
    }

    /// The current revision of a home's map; none before the first merge.
    pub async fn home_map(&self, home: &HomeId) -> Result<Option<HomeMap>, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        if !homes::exists(&mut snapshot, home).await? {
            return Err(StorageError::NoSuchHome);
        }
        let row = sqlx::query("SELECT * FROM home_maps WHERE home_id = $1 ORDER BY revision DESC LIMIT 1");
        let row = row.bind(home.as_str()).fetch_optional(&mut *snapshot).await?;
        row.as_ref().map(from_row).transpose()
    }

    /// The clips of a home that are not aligned, the oldest first.
    pub async fn clips_left_out(&self, home: &HomeId) -> Result<Vec<LeftOut>, StorageError> {
        let rows = sqlx::query(
            "SELECT id, state, reasons FROM clips WHERE home_id = $1 AND state <> 'aligned' ORDER BY id",
        )
        .bind(home.as_str())
        .fetch_all(self.database.reader())
        .await?;
        let left_out = |row: &Row| {
            Ok(LeftOut { clip: row.id("id")?, state: row.name("state")?, reasons: row.json("reasons")? })
        };
        rows.iter().map(left_out).collect()
    }

    /// The points of a revision as PLY; none when it has been replaced and removed since.
    pub async fn home_map_points(&self, map: &HomeMap) -> Result<Option<BlobReader>, StorageError> {
        self.blobs.read(&map.blob_key).await
    }

    pub(super) async fn home_map_blob_keys(&self) -> Result<Vec<String>, StorageError> {
        blob_keys(&mut *self.database.snapshot().await?, None).await
    }
}

/// The set of aligned clips of a home changed, or will have with this transaction.
pub(super) async fn changed(connection: &mut Connection, home: &HomeId) -> Result<(), StorageError> {
    sqlx::query("UPDATE homes SET map_wanted = map_wanted + 1 WHERE id = $1")
        .bind(home.as_str())
        .execute(connection)
        .await?;
    Ok(())
}

async fn aligned(connection: &mut Connection, home: &HomeId) -> Result<Vec<(Uuid, String)>, StorageError> {
    let rows = sqlx::query(
        "SELECT id, result_key FROM clips
        WHERE home_id = $1 AND state = 'aligned' AND result_key IS NOT NULL ORDER BY id",
    )
    .bind(home.as_str())
    .fetch_all(connection)
    .await?;
    rows.iter().map(|row| Ok((row.id("id")?, row.text("result_key")?))).collect()
}

/// Adds a revision and removes the oldest; gives the blobs of those.
async fn insert(
    transaction: &mut Transaction,
    claim: &MergeClaim,
    info: &HomeMapInfo,
    blob_key: &str,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let newest =
        sqlx::query("SELECT COALESCE(MAX(revision), 0) AS revision FROM home_maps WHERE home_id = $1")
            .bind(claim.home.as_str());
    let revision = newest.fetch_one(&mut **transaction).await?.number("revision")? + 1;
    let clips: Vec<Uuid> = claim.clips.iter().map(|(id, _)| *id).collect();
    sqlx::query(
        "INSERT INTO home_maps (home_id, revision, lidar_map_revision, clips, info, blob_key, created_at)
        VALUES ($1, $2, $3, $4, $5, $6, $7)",
    )
    .bind(claim.home.as_str())
    .bind(revision)
    .bind(claim.lidar_map_revision)
    .bind(to_json(&clips))
    .bind(to_json(info))
    .bind(blob_key)
    .bind(now.as_millisecond())
    .execute(&mut **transaction)
    .await?;
    changes::record(transaction, &claim.home, Changed::Map { revision }, now).await?;
    let old = sqlx::query("DELETE FROM home_maps WHERE home_id = $1 AND revision <= $2 RETURNING blob_key")
        .bind(claim.home.as_str())
        .bind(revision - KEPT)
        .fetch_all(&mut **transaction)
        .await?;
    old.iter().map(|row| row.text("blob_key")).collect()
}

/// The blobs of one home's maps, or of all.
pub(super) async fn blob_keys(
    connection: &mut Connection,
    home: Option<&HomeId>,
) -> Result<Vec<String>, StorageError> {
    let rows = sqlx::query("SELECT blob_key FROM home_maps WHERE $1 IS NULL OR home_id = $1")
        .bind(home.map(HomeId::as_str))
        .fetch_all(connection)
        .await?;
    rows.iter().map(|row| row.text("blob_key")).collect()
}
