//! The rows of a new revision.

use super::{KEPT_REVISIONS, MergeClaim, NewRevision};
use crate::changes::{self, Changed};
use crate::columns::to_json;
use crate::database::{Row, Transaction, query};
use crate::home_maps::{MapClip, MapLevel, map_file};
use crate::{LidarMapRevision, StorageError, homes};
use jiff::Timestamp;
use viola_geometry::LevelName;
use viola_home::{HomeMapInfo, Manifest, TileKey};

/// A file that a new revision replaces; no key if it removes the file.
pub(super) struct Written {
    pub level: LevelName,
    pub name: &'static str,
    pub tile: Option<TileKey>,
    pub key: Option<String>,
    pub size_bytes: u64,
}

/// Returns the levels of a new revision: those of the LiDAR maps.
fn map_levels(claim: &MergeClaim, manifest: &Manifest) -> Vec<MapLevel> {
    let level = |map: &LidarMapRevision| {
        let tiles = manifest.tiles.iter().filter(|(key, _)| key.level == map.level);
        MapLevel {
            level: map.level,
            lidar_map_revision: map.revision,
            info: HomeMapInfo::of(tiles.map(|(_, info)| info)),
        }
    };
    claim.lidar_maps.iter().map(level).collect()
}

/// Ends the files of levels that were removed since the last revision.
async fn close_removed_levels(transaction: &mut Transaction, claim: &MergeClaim) -> Result<(), StorageError> {
    let is_there = |level: &MapLevel| claim.lidar_maps.iter().any(|map| map.level == level.level);
    for level in claim.last_levels.iter().filter(|level| !is_there(level)) {
        query(
            "UPDATE home_map_files SET last_revision = $3
            WHERE home_id = $1 AND level = $2 AND last_revision IS NULL",
        )
        .bind(claim.home.key())
        .bind(level.level.as_str())
        .bind(claim.last_revision)
        .execute(transaction)
        .await?;
    }
    Ok(())
}

/// Removes a revision if there are more than are kept: the oldest one whose clips, poses and points are those of a later one, as
/// before a correction, else the oldest. The last two stay, since clients read them.
async fn remove_revision(transaction: &mut Transaction, claim: &MergeClaim) -> Result<(), StorageError> {
    query(
        "DELETE FROM home_maps WHERE home_id = $1 AND revision = (
            SELECT revision FROM home_maps earlier
            WHERE home_id = $1 AND revision < $2 AND (SELECT COUNT(*) FROM home_maps WHERE home_id = $1) > $3
            ORDER BY CASE WHEN EXISTS (
                SELECT 1 FROM home_maps later
                WHERE later.home_id = $1 AND later.revision > earlier.revision
                    AND later.clips = earlier.clips AND later.levels = earlier.levels
            ) THEN 0 ELSE 1 END, revision
            LIMIT 1
        )",
    )
    .bind(claim.home.key())
    .bind(claim.last_revision)
    .bind(KEPT_REVISIONS)
    .execute(transaction)
    .await?;
    Ok(())
}

/// Removes the files of removed revisions, and the sums and meshes of earlier revisions; returns their rows.
async fn remove_old_files(
    transaction: &mut Transaction,
    claim: &MergeClaim,
) -> Result<Vec<Row>, StorageError> {
    let rows = query(
        "DELETE FROM home_map_files
        WHERE home_id = $1 AND last_revision IS NOT NULL AND (name IN ($2, $3) OR NOT EXISTS (
            SELECT 1 FROM home_maps
            WHERE home_maps.home_id = $1 AND revision BETWEEN first_revision AND last_revision))
        RETURNING blob_key, size_bytes",
    )
    .bind(claim.home.key())
    .bind(map_file::SUMS)
    .bind(map_file::MESH)
    .fetch_all(transaction)
    .await?;
    Ok(rows)
}

/// Adds a revision and removes an earlier one; returns the blobs of that one.
pub(super) async fn insert(
    transaction: &mut Transaction,
    claim: &MergeClaim,
    new: &NewRevision,
    written: &[Written],
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let (home, revision) = (claim.home.key(), claim.last_revision + 1);
    let clips: Result<Vec<MapClip>, _> = new.manifest.clips.iter().map(MapClip::new).collect();
    let levels = map_levels(claim, &new.manifest);
    let info = HomeMapInfo::of_levels(levels.iter().map(|level| &level.info));
    query(
        "INSERT INTO home_maps (home_id, revision, lidar_map_revision, clips, info, created_at, levels)
        VALUES ($1, $2, $3, $4, $5, $6, $7)",
    )
    .bind(home)
    .bind(revision)
    .bind(claim.lidar_map_revision)
    .bind(to_json(&clips?))
    .bind(to_json(&info))
    .bind(now.as_millisecond())
    .bind(to_json(&levels))
    .execute(transaction)
    .await?;
    close_removed_levels(transaction, claim).await?;
    for file in written {
        let (x, y) = (file.tile.map(|tile| i64::from(tile.x)), file.tile.map(|tile| i64::from(tile.y)));
        query(
            "UPDATE home_map_files SET last_revision = $5
            WHERE home_id = $1 AND name = $2 AND (tile_x = $3 OR $3 IS NULL) AND (tile_y = $4 OR $4 IS NULL)
                AND level = $6 AND last_revision IS NULL",
        )
        .bind(home)
        .bind(file.name)
        .bind(x)
        .bind(y)
        .bind(claim.last_revision)
        .bind(file.level.as_str())
        .execute(transaction)
        .await?;
        let Some(key) = &file.key else { continue };
        query(
            "INSERT INTO home_map_files (blob_key, home_id, name, tile_x, tile_y, first_revision, level, size_bytes)
            VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
        )
        .bind(key)
        .bind(home)
        .bind(file.name)
        .bind(x)
        .bind(y)
        .bind(revision)
        .bind(file.level.as_str())
        .bind(file.size_bytes as i64)
        .execute(transaction)
        .await?;
    }
    remove_revision(transaction, claim).await?;
    changes::record(transaction, &claim.home, Changed::Map { revision }, now).await?;
    if new.has_object_changes {
        changes::record(transaction, &claim.home, Changed::Objects { revision }, now).await?;
    }
    let old = remove_old_files(transaction, claim).await?;
    let mut grown: i64 = written.iter().map(|file| file.size_bytes as i64).sum();
    for row in &old {
        grown -= row.number("size_bytes")?;
    }
    homes::grow(transaction, &claim.home, grown).await?;
    old.iter().map(|row| row.text("blob_key")).collect()
}
