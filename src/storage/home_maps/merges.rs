//! Merges of homes' maps: their claims, leases and results.

use super::{HomeMap, MapClip, MapFile, MapObject, MapScene, map_file};
use crate::storage::changes::{self, Changed};
use crate::storage::columns::{Columns, to_json};
use crate::storage::database::{Connection, Row, Transaction, query};
use crate::storage::{
    Choice, ClipState, Corrections, HomeId, Storage, StorageError, corrections, lidar_maps,
};
use jiff::Timestamp;
use std::time::Duration;
use uuid::Uuid;
use viola_align::Alignment;
use viola_home::{HomeMapInfo, Manifest, Member, PlacedClip, TileKey, Verdict};

/// Revisions of a home's map that are kept; a new one removes older ones. Readers of a revision have long
/// ended when it is this old.
pub const KEPT_REVISIONS: i64 = 5;

/// A merge does not wait for a job whose next attempt is later than this.
const LONG_REST: Duration = Duration::from_mins(1);

/// Claim on a home whose map this worker merges.
#[derive(Debug, Clone)]
pub struct MergeClaim {
    pub home: HomeId,
    /// The clips that may be in the map.
    pub members: Vec<Member>,
    /// The home's LiDAR map, if it has one.
    pub lidar_map: Option<Uuid>,
    /// The revision that the new one starts from; 0 before the first.
    pub last_revision: i64,
    /// The corrections of people.
    pub corrections: Corrections,
    /// Revision of the LiDAR map in the last revision; 0 before the first.
    pub last_lidar_map_revision: i64,
    lidar_map_revision: i64,
    wanted: i64,
    fence: i64,
}

impl MergeClaim {
    /// Returns whether the LiDAR map differs from that of the last revision.
    pub fn has_new_lidar_map(&self) -> bool {
        self.lidar_map_revision != self.last_lidar_map_revision
    }
}

/// Result of a merge. Files and tiles that are not listed stay as they were.
#[derive(Debug, Clone, Default)]
pub struct NewRevision {
    pub manifest: Manifest,
    /// Tiles that changed; `None` for those that are empty now.
    pub tiles: Vec<(TileKey, Option<Vec<u8>>)>,
    pub files: Vec<(&'static str, Vec<u8>)>,
    pub objects: Vec<MapObject>,
    /// True if objects were added, moved or are gone.
    pub has_object_changes: bool,
}

/// Takes a home whose map is due, that no worker merges, and that has no clip queued or running: a new LiDAR
/// map, which queues all clips again, makes one new revision, and the old one stays until then. The merge
/// does not wait for a job with a long pause after a fault.
macro_rules! claim {
    ($lock:literal) => {
        concat!(
            "UPDATE homes SET map_fence = map_fence + 1, map_lease_until = $2
    WHERE id = (
        SELECT id FROM homes
        WHERE map_made < map_wanted AND (map_lease_until IS NULL OR map_lease_until <= $1)
            AND NOT EXISTS (SELECT 1 FROM clips WHERE home_id = homes.id AND state IN ('queued', 'aligning')
                AND NOT EXISTS (SELECT 1 FROM jobs
                    WHERE jobs.id = clips.job_id AND jobs.state = 'queued' AND jobs.run_after > $3))
        ORDER BY id LIMIT 1 ",
            $lock,
            ")
    RETURNING id, map_wanted, map_fence"
        )
    };
}

impl Storage {
    /// Claims a home whose map is due; returns `None` if there is none.
    pub async fn claim_merge(
        &self,
        lease: Duration,
        now: Timestamp,
    ) -> Result<Option<MergeClaim>, StorageError> {
        let mut transaction = self.database.begin().await?;
        let statement = transaction.either(claim!(""), claim!("FOR NO KEY UPDATE SKIP LOCKED"));
        let row = query(statement)
            .bind(now.as_millisecond())
            .bind((now + lease).as_millisecond())
            .bind((now + LONG_REST).as_millisecond())
            .fetch_optional(&mut transaction)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let home = row.home("id")?;
        let lidar_map = lidar_maps::current(&mut transaction, &home).await?;
        let last = newest(&mut transaction, &home).await?;
        let claim = MergeClaim {
            members: members(&mut transaction, &home).await?,
            lidar_map_revision: lidar_map.as_ref().map_or(0, |map| map.revision),
            lidar_map: lidar_map.map(|map| map.id()),
            corrections: corrections::of_home(&mut transaction, &home).await?,
            last_revision: last.as_ref().map_or(0, |map| map.revision),
            last_lidar_map_revision: last.map_or(0, |map| map.lidar_map_revision),
            wanted: row.number("map_wanted")?,
            fence: row.number("map_fence")?,
            home,
        };
        transaction.commit().await?;
        Ok(Some(claim))
    }

    /// Renews a lease; returns false if the home is no longer this worker's.
    pub async fn renew_merge(
        &self,
        claim: &MergeClaim,
        lease: Duration,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let mut transaction = self.database.begin().await?;
        let renewed = query(
            "UPDATE homes SET map_lease_until = $3 WHERE id = $1 AND map_fence = $2 AND map_lease_until IS NOT NULL",
        )
        .bind(claim.home.key())
        .bind(claim.fence)
        .bind((now + lease).as_millisecond())
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        Ok(renewed == 1)
    }

    /// Returns a file of one of a claim's clips; `None` if the clip was removed or realigned since. The home
    /// is then due again anyway.
    pub async fn member_file(
        &self,
        member: &Member,
        name: &str,
    ) -> Result<Option<bytes::Bytes>, StorageError> {
        self.blobs.read_if_there(&format!("{}/{name}", member.share)).await
    }

    /// Returns the tiles of the revision that a claim starts from.
    pub async fn last_tiles(&self, claim: &MergeClaim) -> Result<Vec<MapFile>, StorageError> {
        self.home_map_files(&claim.home, claim.last_revision, map_file::TILE).await
    }

    /// Returns the manifest of the revision that a claim starts from; empty before the first.
    pub async fn last_manifest(&self, claim: &MergeClaim) -> Result<Manifest, StorageError> {
        self.manifest(&claim.home, claim.last_revision).await
    }

    /// Returns the clips of a revision; none if it was removed.
    pub async fn placed_clips(&self, home: &HomeId, revision: i64) -> Result<Vec<PlacedClip>, StorageError> {
        Ok(self.manifest(home, revision).await?.clips)
    }

    async fn manifest(&self, home: &HomeId, revision: i64) -> Result<Manifest, StorageError> {
        let files = self.home_map_files(home, revision, map_file::MANIFEST).await?;
        let Some(file) = files.first() else { return Ok(Manifest::default()) };
        let bytes = self.map_file_bytes(file).await?.unwrap_or_default();
        serde_json::from_slice(&bytes)
            .map_err(|error| StorageError::Column { column: "manifest.json", detail: error.to_string() })
    }

    /// Returns the scene of the revision that a claim starts from, if it has one.
    pub async fn last_scene(&self, claim: &MergeClaim) -> Result<Option<MapScene>, StorageError> {
        let files = self.home_map_files(&claim.home, claim.last_revision, map_file::SCENE).await?;
        let Some(file) = files.first() else { return Ok(None) };
        self.map_scene(file).await
    }

    /// Stores the result of a merge as the home's next revision; without one, only marks the merge as done.
    /// Returns false if the claim was lost; then nothing changes.
    pub async fn finish_merge(
        &self,
        claim: &MergeClaim,
        new: Option<&NewRevision>,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let mut keys = Vec::new();
        let kept = self.keep_revision(claim, new, &mut keys, now).await;
        match &kept {
            Ok(Some(stale)) => self.blobs.discard(stale).await,
            // The rows may exist nevertheless; a sweep decides.
            Err(error) if error.is_unsettled() => {}
            Ok(None) | Err(_) => self.blobs.discard(&keys).await,
        }
        Ok(kept?.is_some())
    }

    /// Writes blobs, then rows in one transaction: a reader sees a whole revision or none. Returns the blobs
    /// that no kept revision has any more; `None` if the claim was lost. `keys` receives the written blobs.
    async fn keep_revision(
        &self,
        claim: &MergeClaim,
        new: Option<&NewRevision>,
        keys: &mut Vec<String>,
        now: Timestamp,
    ) -> Result<Option<Vec<String>>, StorageError> {
        let mut written = Vec::new();
        if let Some(new) = new {
            let manifest = to_json(&new.manifest).into_bytes();
            let tiles = new.tiles.iter().map(|(key, bytes)| (map_file::TILE, Some(*key), bytes.clone()));
            let files = new.files.iter().map(|(name, bytes)| (*name, None, Some(bytes.clone())));
            for (name, tile, bytes) in tiles.chain(files).chain([(map_file::MANIFEST, None, Some(manifest))])
            {
                let mut key = None;
                if let Some(bytes) = bytes {
                    // Every attempt has its own keys, as with the results of clips.
                    let fresh = format!("home-maps/{}", Uuid::now_v7());
                    keys.push(fresh.clone());
                    self.blobs.put(&fresh, bytes).await?;
                    key = Some(fresh);
                }
                written.push(Written { name, tile, key });
            }
        }
        let mut transaction = self.database.begin().await?;
        let held =
            query("UPDATE homes SET map_made = $3, map_lease_until = NULL WHERE id = $1 AND map_fence = $2")
                .bind(claim.home.key())
                .bind(claim.fence)
                .bind(claim.wanted);
        if held.execute(&mut transaction).await? == 0 {
            return Ok(None);
        }
        let stale = match new {
            Some(new) => insert(&mut transaction, claim, new, &written, now).await?,
            None => Vec::new(),
        };
        transaction.commit().await?;
        Ok(Some(stale))
    }

    /// Gives a claim back after an error; the merge is due again at `due`.
    pub async fn give_back_merge(&self, claim: &MergeClaim, due: Timestamp) -> Result<(), StorageError> {
        let mut transaction = self.database.begin().await?;
        query("UPDATE homes SET map_lease_until = $3 WHERE id = $1 AND map_fence = $2")
            .bind(claim.home.key())
            .bind(claim.fence)
            .bind(due.as_millisecond())
            .execute(&mut transaction)
            .await?;
        transaction.commit().await?;
        Ok(())
    }
}

/// A file that a new revision replaces; no key if it removes the file.
struct Written {
    name: &'static str,
    tile: Option<TileKey>,
    key: Option<String>,
}

async fn newest(connection: &mut Connection, home: &HomeId) -> Result<Option<HomeMap>, StorageError> {
    let row = query("SELECT * FROM home_maps WHERE home_id = $1 ORDER BY revision DESC LIMIT 1");
    let row = row.bind(home.key()).fetch_optional(connection).await?;
    row.as_ref().map(super::from_row).transpose()
}

/// Returns the clips with an answer that may be in the map.
async fn members(connection: &mut Connection, home: &HomeId) -> Result<Vec<Member>, StorageError> {
    let rows = query(
        "SELECT id, sha256, recorded_at, result_key, alignment, choice, state FROM clips
        WHERE home_id = $1 AND state IN ('aligned', 'ambiguous', 'failed') AND result_key IS NOT NULL ORDER BY id",
    )
    .bind(home.key())
    .fetch_all(connection)
    .await?;
    let member = |row: &Row| {
        let alignment: Option<Alignment> = row.maybe_json("alignment")?;
        let verdict = match row.maybe_json::<Choice>("choice")? {
            Some(choice) => Some(Verdict::Chosen { map_from_clip: choice.map_from_clip }),
            None => alignment.as_ref().and_then(Verdict::of),
        };
        // The state is also `failed` if the last attempt broke; the answer is then an older one.
        let broke =
            row.name::<ClipState>("state")? == ClipState::Failed && verdict != Some(Verdict::Unplaced);
        let Some(verdict) = verdict.filter(|_| !broke) else { return Ok(None) };
        Ok(Some(Member {
            clip: row.id("id")?,
            recorded_at_ms: row.maybe_number("recorded_at")?,
            sha256: row.text("sha256")?,
            share: row.text("result_key")?,
            verdict,
        }))
    };
    rows.iter().map(member).filter_map(Result::transpose).collect()
}

/// Adds a revision and removes the oldest; returns the blobs of those.
async fn insert(
    transaction: &mut Transaction,
    claim: &MergeClaim,
    new: &NewRevision,
    written: &[Written],
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let (home, revision) = (claim.home.key(), claim.last_revision + 1);
    let clips: Result<Vec<MapClip>, _> = new.manifest.clips.iter().map(MapClip::new).collect();
    let info = HomeMapInfo::of(new.manifest.tiles.iter().map(|(_, info)| info));
    query(
        "INSERT INTO home_maps (home_id, revision, lidar_map_revision, clips, info, created_at)
        VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(home)
    .bind(revision)
    .bind(claim.lidar_map_revision)
    .bind(to_json(&clips?))
    .bind(to_json(&info))
    .bind(now.as_millisecond())
    .execute(transaction)
    .await?;
    for file in written {
        let (x, y) = (file.tile.map(|tile| i64::from(tile.x)), file.tile.map(|tile| i64::from(tile.y)));
        query(
            "UPDATE home_map_files SET last_revision = $5
            WHERE home_id = $1 AND name = $2 AND (tile_x = $3 OR $3 IS NULL) AND (tile_y = $4 OR $4 IS NULL)
                AND last_revision IS NULL",
        )
        .bind(home)
        .bind(file.name)
        .bind(x)
        .bind(y)
        .bind(claim.last_revision)
        .execute(transaction)
        .await?;
        let Some(key) = &file.key else { continue };
        query(
            "INSERT INTO home_map_files (blob_key, home_id, name, tile_x, tile_y, first_revision)
            VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(key)
        .bind(home)
        .bind(file.name)
        .bind(x)
        .bind(y)
        .bind(revision)
        .execute(transaction)
        .await?;
    }
    super::objects::replace(transaction, &claim.home, &new.objects).await?;
    super::places::tell(transaction, claim, &new.manifest.clips, revision, now).await?;
    query("DELETE FROM home_maps WHERE home_id = $1 AND revision <= $2")
        .bind(home)
        .bind(revision - KEPT_REVISIONS)
        .execute(transaction)
        .await?;
    changes::record(transaction, &claim.home, Changed::Map { revision }, now).await?;
    if new.has_object_changes {
        changes::record(transaction, &claim.home, Changed::Objects { revision }, now).await?;
    }
    let old =
        query("DELETE FROM home_map_files WHERE home_id = $1 AND last_revision <= $2 RETURNING blob_key")
            .bind(home)
            .bind(revision - KEPT_REVISIONS)
            .fetch_all(transaction)
            .await?;
    old.iter().map(|row| row.text("blob_key")).collect()
}
