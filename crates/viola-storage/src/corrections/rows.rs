//! The table of corrections.

use crate::columns::to_json;
use crate::database::{Connection, Row, Transaction, query};
use crate::{HomeId, StorageError, home_maps};
use jiff::Timestamp;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use viola_geometry::LevelName;
use viola_home::{ObjectCorrection, RoomCorrection, level_of_id};

/// A correction as it is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Kept<T> {
    /// Id of the object, or of the room when it was first corrected.
    pub target: String,
    /// The LiDAR map in whose frame the correction's places are.
    pub lidar_map_revision: i64,
    pub correction: T,
    pub corrected_at: Timestamp,
}

/// All corrections of a home, by target.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Corrections {
    /// Grows with every correction.
    pub version: i64,
    pub objects: Vec<Kept<ObjectCorrection>>,
    pub rooms: Vec<Kept<RoomCorrection>>,
}

impl Corrections {
    /// Returns those of the objects and rooms of a level.
    pub fn on_level(&self, level: LevelName) -> Corrections {
        let mut of_level = self.clone();
        of_level.objects.retain(|kept| level_of_id(&kept.target) == level);
        of_level.rooms.retain(|kept| level_of_id(&kept.target) == level);
        of_level
    }
}

/// Removes the corrections of the objects and rooms of a level.
pub(crate) async fn forget_level(
    transaction: &mut Transaction,
    home: &HomeId,
    level: LevelName,
    now: Timestamp,
) -> Result<(), StorageError> {
    let gone = of_home(transaction, home).await?.on_level(level);
    let objects = gone.objects.iter().map(|kept| ("object", &kept.target));
    let rooms = gone.rooms.iter().map(|kept| ("room", &kept.target));
    for (kind, target) in objects.chain(rooms) {
        keep::<ObjectCorrection>(transaction, home, (kind, target), None, now).await?;
    }
    Ok(())
}

/// Writes the correction of a kind and a target, or removes it, and makes the home due for a merge. Returns
/// the number of the home's corrections.
pub(super) async fn keep<T: Serialize>(
    transaction: &mut Transaction,
    home: &HomeId,
    (kind, target): (&'static str, &str),
    kept: Option<&Kept<T>>,
    now: Timestamp,
) -> Result<i64, StorageError> {
    query("DELETE FROM map_corrections WHERE home_id = $1 AND kind = $2 AND target = $3")
        .bind(home.key())
        .bind(kind)
        .bind(target)
        .execute(transaction)
        .await?;
    if let Some(kept) = kept {
        query(
            "INSERT INTO map_corrections (home_id, kind, target, lidar_map_revision, document, corrected_at)
            VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(home.key())
        .bind(kind)
        .bind(target)
        .bind(kept.lidar_map_revision)
        .bind(to_json(&kept.correction))
        .bind(kept.corrected_at.as_millisecond())
        .execute(transaction)
        .await?;
    }
    query("UPDATE homes SET corrections = corrections + 1 WHERE id = $1")
        .bind(home.key())
        .execute(transaction)
        .await?;
    home_maps::changed(transaction, home, now).await?;
    let count = query("SELECT COUNT(*) AS n FROM map_corrections WHERE home_id = $1").bind(home.key());
    count.fetch_one(transaction).await?.number("n")
}

fn from_row<T: DeserializeOwned>(row: &Row) -> Result<Kept<T>, StorageError> {
    Ok(Kept {
        target: row.text("target")?,
        lidar_map_revision: row.number("lidar_map_revision")?,
        correction: row.json("document")?,
        corrected_at: row.time("corrected_at")?,
    })
}

pub(super) async fn find<T: DeserializeOwned>(
    connection: &mut Connection,
    home: &HomeId,
    kind: &'static str,
    target: &str,
) -> Result<Option<Kept<T>>, StorageError> {
    let row = query("SELECT * FROM map_corrections WHERE home_id = $1 AND kind = $2 AND target = $3")
        .bind(home.key())
        .bind(kind)
        .bind(target)
        .fetch_optional(connection)
        .await?;
    row.as_ref().map(from_row).transpose()
}

pub(super) async fn version(connection: &mut Connection, home: &HomeId) -> Result<i64, StorageError> {
    let row = query("SELECT corrections FROM homes WHERE id = $1").bind(home.key());
    row.fetch_one(connection).await?.number("corrections")
}

/// Returns all corrections of a home.
pub(crate) async fn of_home(connection: &mut Connection, home: &HomeId) -> Result<Corrections, StorageError> {
    let rows = query("SELECT * FROM map_corrections WHERE home_id = $1 ORDER BY kind, target")
        .bind(home.key())
        .fetch_all(connection)
        .await?;
    let mut all = Corrections { version: version(connection, home).await?, ..Corrections::default() };
    for row in &rows {
        match row.text("kind")?.as_str() {
            "object" => all.objects.push(from_row(row)?),
            _ => all.rooms.push(from_row(row)?),
        }
    }
    Ok(all)
}
