//! The fused maps of homes: their revisions and the files of each.

mod merges;
mod mesh;
mod objects;
mod places;
mod scene;
mod state;

#[cfg(test)]
pub(super) use merges::CLAIM_LATER;
pub use merges::{KEPT_REVISIONS, MergeClaim, NewRevision};
pub use mesh::{LevelSurface, MESH_POINTS};
#[cfg(test)]
pub(super) use objects::statement as objects_statement;
pub use objects::{HomeObject, MapObject, ObjectFilter};
pub use scene::{MapHistory, MapRoom, MapScene};
pub(super) use state::FAILING_MERGES;
pub use state::MapState;

use super::columns::parse_time;
use super::damage::{check_bytes, check_removed};
use super::database::{Connection, Row, query};
use super::{BlobReader, ClipState, HomeId, Page, Storage, StorageError, copies, homes};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use viola_geometry::{LevelName, Pose2, angle_between};
use viola_home::{HomeMapInfo, PlacedBy, PlacedClip, TileKey};
use viola_reconstruct::Reason;

/// One revision of a home's fused map. It never changes.
#[derive(Debug, Clone, PartialEq)]
pub struct HomeMap {
    /// Counts from 1; the highest is the current one.
    pub revision: i64,
    /// The newest revision of the LiDAR maps that it is made of.
    pub lidar_map_revision: i64,
    /// By their names.
    pub levels: Vec<MapLevel>,
    /// The clips of the map, in an order independent of their arrival; points name a clip by its index here.
    pub clips: Vec<MapClip>,
    pub info: HomeMapInfo,
    pub created_at: Timestamp,
}

/// One level of a home's map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapLevel {
    pub level: LevelName,
    /// Revision of the LiDAR map whose frame it uses.
    pub lidar_map_revision: i64,
    pub info: HomeMapInfo,
}

/// A clip in a home's map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MapClip {
    pub clip: Uuid,
    /// The level in whose LiDAR map it is.
    #[serde(default)]
    pub level: LevelName,
    /// Refined together with the clips that it overlaps.
    pub map_from_clip: Pose2,
    /// As that of its [`Placement`](super::Placement).
    #[serde(default, skip_serializing_if = "viola_geometry::is_zero")]
    pub rise_m: f64,
    pub by: PlacedBy,
    /// Probability that the pose is right to 10 degrees and 0.3 m, 0..1; null if a person chose it.
    pub probability: Option<f64>,
    pub recorded_at: Option<Timestamp>,
    /// Points that the clip contributed.
    pub points: usize,
    /// Distance by which the refinement moved the clip's origin from its pose without other clips.
    pub moved_m: f64,
    /// Angle by which the refinement turned the clip.
    pub moved_deg: f64,
}

impl MapClip {
    pub fn new(placed: &PlacedClip) -> Result<MapClip, StorageError> {
        let recorded_at_ms = placed.recorded_at_ms;
        Ok(MapClip {
            clip: placed.clip,
            level: placed.level,
            map_from_clip: placed.map_from_clip,
            rise_m: placed.rise_m,
            by: placed.by,
            probability: placed.probability,
            recorded_at: recorded_at_ms.map(|ms| parse_time("recorded_at", ms)).transpose()?,
            points: placed.points,
            moved_m: placed.map_from_clip.distance_m(&placed.alone),
            moved_deg: angle_between(placed.map_from_clip.yaw_rad, placed.alone.yaw_rad).to_degrees(),
        })
    }
}

/// A clip that is not in its home's map, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    pub clip: Uuid,
    pub state: ClipState,
    pub reasons: Vec<Reason>,
    /// The oldest clip of the home with the same file or content, if this is not it.
    pub duplicate_of: Option<Uuid>,
}

/// A file of a revision.
#[derive(Debug, Clone, PartialEq)]
pub struct MapFile {
    pub level: LevelName,
    /// The tile, if the file is one.
    pub tile: Option<TileKey>,
    key: String,
    /// 0 for files of earlier versions.
    size_bytes: u64,
}

impl MapFile {
    /// Returns the key of its blob. No key is written twice, so it stands for the bytes.
    pub fn key(&self) -> &str {
        &self.key
    }
}

/// The names of a map's files. Each level has its own, except for the manifest.
pub mod map_file {
    pub const TILE: &str = "tile";
    /// Sums of a tile's first clips, from which the next merge continues. Only the current revision has them.
    pub const SUMS: &str = "sums";
    /// The mesh as binary glTF, if it is made already. Only the current revision has it, and those before it with the same
    /// surface.
    pub const MESH: &str = "mesh.glb";
    pub const MANIFEST: &str = "manifest.json";
    pub const SCENE: &str = "scene.json";
    pub const PLAN_PNG: &str = "plan.png";
    pub const PLAN_SVG: &str = "plan.svg";
    pub const PLAN_PDF: &str = "plan.pdf";
    pub const PLAN_DXF: &str = "plan.dxf";
    pub const PLAN_GEOJSON: &str = "plan.geojson";
    pub const PLAN_JSON: &str = "plan.json";
    /// The floor plan in all formats.
    pub const PLANS: [&str; 6] = [PLAN_SVG, PLAN_PNG, PLAN_PDF, PLAN_GEOJSON, PLAN_DXF, PLAN_JSON];
}

fn from_row(row: &Row) -> Result<HomeMap, StorageError> {
    let (lidar_map_revision, info): (i64, HomeMapInfo) =
        (row.number("lidar_map_revision")?, row.json("info")?);
    // Revisions of earlier versions have one level.
    let main = || vec![MapLevel { level: LevelName::MAIN, lidar_map_revision, info: info.clone() }];
    Ok(HomeMap {
        revision: row.number("revision")?,
        lidar_map_revision,
        levels: row.maybe_json("levels")?.unwrap_or_else(main),
        clips: row.json("clips")?,
        info,
        created_at: row.time("created_at")?,
    })
}

impl Storage {
    /// Returns a revision of a home's map, by default the current one; `None` before the first merge, or if
    /// the revision was removed.
    pub async fn home_map(
        &self,
        home: &HomeId,
        revision: Option<i64>,
    ) -> Result<Option<HomeMap>, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        let row = query(
            "SELECT * FROM home_maps WHERE home_id = $1 AND ($2 IS NULL OR revision = $2)
            ORDER BY revision DESC LIMIT 1",
        );
        let row = row.bind(home.key()).bind(revision).fetch_optional(&mut snapshot).await?;
        if row.is_none() {
            homes::require(&mut snapshot, home).await?;
        }
        row.as_ref().map(from_row).transpose()
    }

    /// Returns a page of the revisions below `after`, newest first.
    pub async fn home_map_revisions(
        &self,
        home: &HomeId,
        page: &Page<i64>,
    ) -> Result<Vec<HomeMap>, StorageError> {
        let mut snapshot = self.database.snapshot().await?;
        homes::require(&mut snapshot, home).await?;
        let rows = query(
            "SELECT * FROM home_maps WHERE home_id = $1 AND revision < $2 ORDER BY revision DESC LIMIT $3",
        )
        .bind(home.key())
        .bind(page.after.unwrap_or(i64::MAX))
        .bind(i64::from(page.limit))
        .fetch_all(&mut snapshot)
        .await?;
        rows.iter().map(from_row).collect()
    }

    /// Returns the clips of a home that are not in its newest map, oldest first.
    pub async fn clips_left_out(&self, home: &HomeId) -> Result<Vec<LeftOut>, StorageError> {
        let rows = query(concat!(
            "SELECT id, state, reasons, ",
            copies::duplicate_of!(),
            " FROM clips WHERE home_id = $1 AND placement IS NULL ORDER BY id"
        ))
        .bind(home.key())
        .fetch_all(&mut self.database.reader().await?)
        .await?;
        let left_out = |row: &Row| {
            Ok(LeftOut {
                clip: row.id("id")?,
                state: row.name("state")?,
                reasons: row.json("reasons")?,
                duplicate_of: row.maybe_id("duplicate_of")?,
            })
        };
        rows.iter().map(left_out).collect()
    }

    /// Returns a revision's files of one level and name, tiles in the order of their positions.
    pub async fn home_map_files(
        &self,
        home: &HomeId,
        revision: i64,
        level: LevelName,
        name: &str,
    ) -> Result<Vec<MapFile>, StorageError> {
        files(&mut self.database.reader().await?, home, revision, Some(level), name).await
    }

    /// Returns a file of a revision; `None` if the revision was removed since.
    pub async fn read_map_file(&self, file: &MapFile) -> Result<Option<BlobReader>, StorageError> {
        let blob = self.blobs.read(&file.key).await?;
        if let Some(blob) = &blob
            && file.size_bytes > 0
        {
            check_bytes(file.size_bytes, file.key.clone(), blob.size_bytes)?;
        }
        Ok(blob)
    }

    /// Returns a file of a revision in one piece.
    pub async fn map_file_bytes(&self, file: &MapFile) -> Result<Option<bytes::Bytes>, StorageError> {
        self.blobs.read_if_there(&file.key).await
    }

    /// Returns an error if a file that the store does not have is still one of a kept revision.
    pub async fn check_map_file_removed(&self, file: &MapFile) -> Result<(), StorageError> {
        let row = query("SELECT blob_key FROM home_map_files WHERE blob_key = $1").bind(&file.key);
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        check_removed(row.as_ref(), file.key.clone())
    }
}

/// Marks the map of a home as due, since the first change that its newest map lacks.
macro_rules! mark_due {
    ($if:literal) => {
        concat!(
            "UPDATE homes SET map_wanted = map_wanted + 1,
                map_due_since = CASE WHEN map_made < map_wanted THEN COALESCE(map_due_since, $2) ELSE $2 END
            WHERE id = $1",
            $if
        )
    };
}

/// Marks a home's map as due for a merge, in the transaction that changes the map's inputs.
pub(super) async fn changed(
    connection: &mut Connection,
    home: &HomeId,
    now: Timestamp,
) -> Result<(), StorageError> {
    mark(connection, mark_due!(""), home, now).await
}

/// Marks a home's map as due if the home has one, or will have its first: its LiDAR maps are others, whatever its clips are. All
/// clips are queued for them, and the waiting begins again.
pub(super) async fn outdated(
    connection: &mut Connection,
    home: &HomeId,
    now: Timestamp,
) -> Result<(), StorageError> {
    let statement = "UPDATE homes SET map_wanted = map_wanted + 1, map_due_since = $2
        WHERE id = $1 AND (map_made < map_wanted OR EXISTS (SELECT 1 FROM home_maps WHERE home_id = $1))";
    mark(connection, statement, home, now).await
}

/// Marks a home's map as due if it was ever: its plans have the home's name.
pub(super) async fn renamed(
    connection: &mut Connection,
    home: &HomeId,
    now: Timestamp,
) -> Result<(), StorageError> {
    mark(connection, mark_due!(" AND map_wanted > 0"), home, now).await
}

async fn mark(
    connection: &mut Connection,
    statement: &'static str,
    home: &HomeId,
    now: Timestamp,
) -> Result<(), StorageError> {
    query(statement).bind(home.key()).bind(now.as_millisecond()).execute(connection).await?;
    Ok(())
}

async fn files(
    connection: &mut Connection,
    home: &HomeId,
    revision: i64,
    level: Option<LevelName>,
    name: &str,
) -> Result<Vec<MapFile>, StorageError> {
    let rows = query(
        "SELECT blob_key, level, tile_x, tile_y, size_bytes FROM home_map_files
        WHERE home_id = $1 AND name = $2 AND ($4 IS NULL OR level = $4) AND first_revision <= $3
            AND (last_revision IS NULL OR last_revision >= $3)
        ORDER BY level, tile_x, tile_y",
    )
    .bind(home.key())
    .bind(name)
    .bind(revision)
    .bind(level.as_ref().map(LevelName::as_str))
    .fetch_all(connection)
    .await?;
    let file = |row: &Row| {
        let level = row.name("level")?;
        let sides = row.maybe_count("tile_x")?.zip(row.maybe_count("tile_y")?);
        let tile = sides.map(|(x, y)| TileKey { level, x, y });
        Ok(MapFile { level, tile, key: row.text("blob_key")?, size_bytes: row.count("size_bytes")? })
    };
    rows.iter().map(file).collect()
}

/// Returns the name under which the pending deletes of a home's maps are recorded.
fn owner(home: &HomeId) -> String {
    format!("home-map:{}:", home.key())
}

/// Selects the blobs of a home's maps.
pub(super) const BLOBS_OF_HOME: &str = "SELECT blob_key FROM home_map_files WHERE home_id = $1";

/// Returns the blob keys of a home's maps.
pub(super) async fn blob_keys(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Vec<String>, StorageError> {
    let rows = query(BLOBS_OF_HOME).bind(home.key()).fetch_all(connection).await?;
    rows.iter().map(|row| row.text("blob_key")).collect()
}
