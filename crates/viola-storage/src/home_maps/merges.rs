//! Merges of homes' maps: their claims, leases and results.

mod claims;
mod damage;
mod faults;
mod files;
mod members;
mod rows;
mod scenes;

use super::{HomeMap, MapFile, MapLevel, MapObject, map_file, objects, places};
use crate::columns::{parse_json, to_json};
use crate::database::{Connection, Row, query};
use crate::{
    Corrections, HomeId, LevelCoverage, LidarMapRevision, Storage, StorageError, corrections, lidar_maps,
    pending_deletes,
};
#[cfg(test)]
pub(crate) use claims::CLAIM_LATER;
use jiff::Timestamp;
use members::members;
use rows::insert;
use std::time::Duration;
use uuid::Uuid;
use viola_geometry::LevelName;
use viola_home::{Manifest, Member, TileKey};

/// Number of revisions of a home's map that are kept.
pub const KEPT_REVISIONS: i64 = 5;

/// Claim on a home whose map this worker merges.
#[derive(Debug, Clone)]
pub struct MergeClaim {
    pub home: HomeId,
    pub home_name: Option<String>,
    /// The clips that may be in the map.
    pub members: Vec<Member>,
    /// Clips that the merge left out, since the files of their answers are missing or damaged.
    left_out: Vec<Member>,
    /// The current LiDAR map of each level, by the levels' names.
    pub lidar_maps: Vec<LidarMapRevision>,
    /// The revision that the new one starts from; 0 before the first.
    pub last_revision: i64,
    /// The corrections of people.
    pub corrections: Corrections,
    /// The levels of the last revision; none before the first.
    pub last_levels: Vec<MapLevel>,
    lidar_map_revision: i64,
    wanted: i64,
    fencing_token: i64,
    /// Merges without a result since the last one with a result.
    faults: u32,
    /// Of the home: one that was removed and made again counts its claims from 0.
    home_created_at: Timestamp,
}

impl MergeClaim {
    /// Leaves out a clip whose files are missing or damaged. The end of the merge gives the clip a reason.
    pub fn leave_out(&mut self, clip: Uuid) {
        let members = std::mem::take(&mut self.members);
        let (damaged, members): (Vec<_>, Vec<_>) =
            members.into_iter().partition(|member| member.clip == clip);
        self.members = members;
        self.left_out.extend(damaged);
    }

    /// Returns whether a LiDAR map is not that of the last revision, or a level was removed.
    pub fn has_new_lidar_map(&self) -> bool {
        let now = self.lidar_maps.iter().map(|map| (map.level, map.revision));
        !now.eq(self.last_levels.iter().map(|level| (level.level, level.lidar_map_revision)))
    }

    /// Returns the revision of a level's LiDAR map in the last revision, if the level has another one now.
    pub fn left_lidar_map(&self, now: &LidarMapRevision) -> Option<i64> {
        let last = self.last_levels.iter().find(|last| last.level == now.level)?.lidar_map_revision;
        (last != now.revision).then_some(last)
    }
}

/// Result of a merge. Files and tiles that are not listed stay as they were.
#[derive(Debug, Clone, Default)]
pub struct NewRevision {
    pub manifest: Manifest,
    /// Tiles that changed; `None` for those that are empty now.
    pub tiles: Vec<(TileKey, Option<Vec<u8>>)>,
    /// Sums of tiles that the next merge begins with.
    pub sums: Vec<(TileKey, Option<Vec<u8>>)>,
    pub files: Vec<(LevelName, &'static str, Vec<u8>)>,
    /// Levels whose new scene has the `mesh_parts` of the last one. They keep their meshes if no tile changed.
    pub same_mesh_parts: Vec<LevelName>,
    pub objects: Vec<MapObject>,
    /// The seen part of each level.
    pub coverage: Vec<LevelCoverage>,
    /// True if objects were added, moved or are gone.
    pub has_object_changes: bool,
}

impl Storage {
    /// Claims a home whose map is due; returns `None` if there is none. Tenants take turns: the first one with a due home
    /// after the tenant named `after` comes first. A home whose rows cannot be read is an error, and rests.
    pub async fn claim_merge(
        &self,
        after: &str,
        lease: Duration,
        now: Timestamp,
    ) -> Result<Option<MergeClaim>, StorageError> {
        self.require_store().await?;
        let mut transaction = self.database.begin().await?;
        faults::release_lost(&mut transaction, now).await?;
        let Some(row) = claims::take(&mut transaction, after, lease, now).await? else {
            transaction.commit().await?;
            return Ok(None);
        };
        let home = row.home("id")?;
        let claimed = read_claim(&mut transaction, &home, &row).await;
        if let Err(unreadable @ StorageError::Column { .. }) = &claimed {
            tracing::error!(%home, %unreadable, "a home's map rests: its rows cannot be read");
            // Otherwise it would be the next one at every claim.
            faults::set_aside(&mut transaction, &row, now).await?;
        } else if claimed.is_err() {
            return claimed.map(Some);
        }
        transaction.commit().await?;
        claimed.map(Some)
    }

    /// Returns whether no work is ahead that may replace a home's newest map; false if the home was removed.
    pub async fn has_settled_map(&self, home: &HomeId, now: Timestamp) -> Result<bool, StorageError> {
        let settled = query(claims::SETTLED);
        let settled = settled.bind(home.key()).bind((now + claims::LONG_REST).as_millisecond());
        Ok(settled.fetch_optional(&mut self.database.reader().await?).await?.is_some())
    }

    /// Renews a lease; returns false if the home is no longer this worker's.
    pub async fn renew_merge(
        &self,
        claim: &MergeClaim,
        lease: Duration,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let renew = query(
            // A merge that has just ended has no lease any more, and is not lost.
            "UPDATE homes SET map_lease_until = CASE WHEN map_lease_until IS NULL THEN NULL ELSE $3 END
            WHERE id = $1 AND map_fence = $2 AND created_at = $4",
        )
        .bind(claim.home.key())
        .bind(claim.fencing_token)
        .bind((now + lease).as_millisecond())
        .bind(claim.home_created_at.as_millisecond());
        Ok(self.database.execute(renew).await? == 1)
    }

    /// Returns a file of one of a claim's clips; `None` if the clip was removed or realigned since. The home
    /// is then due again anyway.
    pub async fn member_file(
        &self,
        member: &Member,
        name: &str,
    ) -> Result<Option<bytes::Bytes>, StorageError> {
        self.blobs.read_if_there(&format!("{}/{name}", member.contribution)).await
    }

    /// Returns the tiles of the revision that a claim starts from.
    pub async fn last_tiles(&self, claim: &MergeClaim) -> Result<Vec<MapFile>, StorageError> {
        self.last_files(claim, map_file::TILE).await
    }

    /// Returns the sums of tiles of the revision that a claim starts from.
    pub async fn last_sums(&self, claim: &MergeClaim) -> Result<Vec<MapFile>, StorageError> {
        self.last_files(claim, map_file::SUMS).await
    }

    /// Returns the files of one name of all levels.
    async fn last_files(&self, claim: &MergeClaim, name: &str) -> Result<Vec<MapFile>, StorageError> {
        let mut connection = self.database.reader().await?;
        super::files(&mut connection, &claim.home, claim.last_revision, None, name).await
    }

    /// Returns the manifest of the revision that a claim starts from; empty before the first.
    pub async fn last_manifest(&self, claim: &MergeClaim) -> Result<Manifest, StorageError> {
        let (home, revision) = (&claim.home, claim.last_revision);
        let files = self.home_map_files(home, revision, LevelName::MAIN, map_file::MANIFEST).await?;
        let Some(file) = files.first() else { return Ok(Manifest::default()) };
        let bytes = self.map_file_bytes(file).await?.unwrap_or_default();
        parse_json("manifest.json", &bytes)
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
        self.discard_unless(&keys, &kept, Option::is_some).await;
        let Some(stale) = kept? else { return Ok(false) };
        self.discard_pending(&super::owner(&claim.home), &stale).await;
        Ok(true)
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
        let written = match new {
            Some(new) => self.write_files(new, keys).await?,
            None => Vec::new(),
        };
        let mut transaction = self.database.begin().await?;
        let held = query(
            // A change during the merge waits for the next one from now on. Without one there is no time, since a process of an
            // earlier version, which writes none, may make the next change.
            "UPDATE homes SET map_made = $3, map_lease_until = NULL, map_faults = 0, map_due_at = 0,
                map_due_since = CASE WHEN map_wanted > $3 THEN CAST($5 AS BIGINT) END
            WHERE id = $1 AND map_fence = $2 AND created_at = $4",
        )
        .bind(claim.home.key())
        .bind(claim.fencing_token)
        .bind(claim.wanted)
        .bind(claim.home_created_at.as_millisecond())
        .bind(now.as_millisecond());
        if held.execute(&mut transaction).await? == 0 {
            return Ok(None);
        }
        let stale = match new {
            Some(new) => {
                let revision = claim.last_revision + 1;
                objects::replace(&mut transaction, &claim.home, &new.objects).await?;
                let clips = &new.manifest.clips;
                places::update_placements(
                    &mut transaction,
                    &claim.home,
                    &claim.members,
                    clips,
                    revision,
                    now,
                )
                .await?;
                query("UPDATE homes SET coverage = $2 WHERE id = $1")
                    .bind(claim.home.key())
                    .bind(to_json(&new.coverage))
                    .execute(&mut transaction)
                    .await?;
                insert(&mut transaction, claim, new, &written, now).await?
            }
            None => Vec::new(),
        };
        damage::update_reasons(&mut transaction, &claim.home, &claim.left_out, &claim.members, now).await?;
        pending_deletes::add(&mut transaction, &super::owner(&claim.home), &stale, now).await?;
        transaction.commit().await?;
        Ok(Some(stale))
    }

    /// Gives a claim back without a fault; the merge is due again at `due`.
    pub async fn give_back_merge(&self, claim: &MergeClaim, due: Timestamp) -> Result<(), StorageError> {
        let give_back = query(
            "UPDATE homes SET map_lease_until = NULL, map_due_at = $3
            WHERE id = $1 AND map_fence = $2 AND created_at = $4",
        )
        .bind(claim.home.key())
        .bind(claim.fencing_token)
        .bind(due.as_millisecond())
        .bind(claim.home_created_at.as_millisecond());
        self.database.execute(give_back).await.map(drop)
    }
}

/// Returns the claim on a home that was just taken.
async fn read_claim(
    connection: &mut Connection,
    home: &HomeId,
    row: &Row,
) -> Result<MergeClaim, StorageError> {
    let lidar_maps = lidar_maps::levels(connection, home).await?;
    let last = newest(connection, home).await?;
    Ok(MergeClaim {
        members: members(connection, home).await?,
        left_out: Vec::new(),
        lidar_map_revision: lidar_maps.iter().map(|map| map.revision).max().unwrap_or(0),
        lidar_maps,
        corrections: corrections::of_home(connection, home).await?,
        last_revision: last.as_ref().map_or(0, |map| map.revision),
        last_levels: last.map(|map| map.levels).unwrap_or_default(),
        wanted: row.number("map_wanted")?,
        fencing_token: row.number("map_fence")?,
        faults: row.count("map_faults")?,
        home_created_at: row.time("created_at")?,
        home_name: row.maybe_text("name")?,
        home: home.clone(),
    })
}

async fn newest(connection: &mut Connection, home: &HomeId) -> Result<Option<HomeMap>, StorageError> {
    let row = query("SELECT * FROM home_maps WHERE home_id = $1 ORDER BY revision DESC LIMIT 1");
    let row = row.bind(home.key()).fetch_optional(connection).await?;
    row.as_ref().map(super::from_row).transpose()
}
