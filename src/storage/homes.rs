//! Homes.

use super::changes::{self, Changed};
use super::columns::Columns;
use super::database::{Connection, Row};
use super::{Page, Storage, StorageError};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The id of a home, chosen by the client: 1 to 64 characters of `A-Z a-z 0-9 . _ -`, not `.` or `..`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(try_from = "String")]
#[schema(value_type = String, min_length = 1, max_length = 64, pattern = "^[A-Za-z0-9._-]{1,64}$", example = "home-42")]
pub struct HomeId(String);

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a home's id is 1 to 64 characters of A-Z a-z 0-9 . _ - and not . or ..")]
pub struct InvalidHomeId;

impl TryFrom<String> for HomeId {
    type Error = InvalidHomeId;

    fn try_from(text: String) -> Result<HomeId, InvalidHomeId> {
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
        if text.is_empty() || text.len() > 64 || !text.bytes().all(allowed) || text == "." || text == ".." {
            return Err(InvalidHomeId);
        }
        Ok(HomeId(text))
    }
}

impl FromStr for HomeId {
    type Err = InvalidHomeId;

    fn from_str(text: &str) -> Result<HomeId, InvalidHomeId> {
        HomeId::try_from(text.to_owned())
    }
}

impl fmt::Display for HomeId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl HomeId {
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// A home: what a LiDAR map and clips belong to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Home {
    pub id: HomeId,
    /// For people.
    #[schema(example = "Flat 3, Elm Street")]
    pub name: Option<String>,
    /// Revision of the current LiDAR map, null before the first one.
    #[schema(example = 2)]
    pub lidar_map_revision: Option<i64>,
    #[schema(example = 3)]
    pub clips: i64,
    #[schema(example = "2026-03-14T15:09:26.535Z")]
    pub created_at: Timestamp,
    /// Of the newest change of the home or of anything in it: its LiDAR map, its clips, its fused map.
    pub updated_at: Timestamp,
}

fn from_row(row: &Row) -> Result<Home, StorageError> {
    Ok(Home {
        id: row.home("id")?,
        name: row.maybe_text("name")?,
        lidar_map_revision: row.maybe_number("lidar_map_revision")?,
        clips: row.number("clips")?,
        created_at: row.time("created_at")?,
        updated_at: row.time("updated_at")?,
    })
}

macro_rules! select_homes {
    ($rest:literal) => {
        concat!(
            "SELECT homes.*,
                (SELECT MAX(revision) FROM lidar_maps WHERE home_id = homes.id) AS lidar_map_revision,
                (SELECT COUNT(*) FROM clips WHERE home_id = homes.id) AS clips
            FROM homes ",
            $rest
        )
    };
}

impl Storage {
    /// Makes a home or renames it; tells whether it is new. The same name again changes nothing.
    pub async fn put_home(
        &self,
        id: &HomeId,
        name: Option<&str>,
        now: Timestamp,
    ) -> Result<(Home, bool), StorageError> {
        let mut transaction = self.database.begin().await?;
        let is_new = !exists(&mut transaction, id).await?;
        let put = sqlx::query(
            "INSERT INTO homes (id, name, created_at, updated_at) VALUES ($1, $2, $3, $3)
            ON CONFLICT (id) DO UPDATE SET name = excluded.name WHERE homes.name IS DISTINCT FROM excluded.name",
        )
        .bind(id.as_str())
        .bind(name)
        .bind(now.as_millisecond())
        .execute(&mut *transaction)
        .await?;
        if put.rows_affected() > 0 {
            changes::record(&mut transaction, id, Changed::Home, now).await?;
        }
        let row = sqlx::query(select_homes!("WHERE id = $1")).bind(id.as_str());
        let home = from_row(&row.fetch_one(&mut *transaction).await?)?;
        transaction.commit().await?;
        Ok((home, is_new))
    }

    pub async fn home(&self, id: &HomeId) -> Result<Home, StorageError> {
        let row = sqlx::query(select_homes!("WHERE id = $1")).bind(id.as_str());
        let row = row.fetch_optional(self.database.reader()).await?;
        from_row(&row.ok_or(StorageError::NoSuchHome)?)
    }

    /// By id; only those that changed later than `updated_after`, when it is given.
    pub async fn homes(
        &self,
        updated_after: Option<Timestamp>,
        page: &Page<HomeId>,
    ) -> Result<Vec<Home>, StorageError> {
        // Who asks for what changed expects little of it, so that is found by the index of changes and then sorted: an
        // expression keeps planners from going through all homes by id instead.
        let statement = match updated_after {
            Some(_) => {
                select_homes!("WHERE updated_at > $3 AND id || '' > $1 ORDER BY id || '' LIMIT $2")
            }
            None => select_homes!("WHERE id > $1 ORDER BY id LIMIT $2"),
        };
        let mut query = sqlx::query(statement)
            .bind(page.after.as_ref().map_or("", HomeId::as_str))
            .bind(i64::from(page.limit));
        if let Some(time) = updated_after {
            query = query.bind(time.as_millisecond());
        }
        let rows = query.fetch_all(self.database.reader()).await?;
        rows.iter().map(from_row).collect()
    }

    /// Removes a home with everything in it. A worker that is busy with one of its clips loses its lease.
    pub async fn delete_home(&self, id: &HomeId, now: Timestamp) -> Result<(), StorageError> {
        let mut transaction = self.database.begin().await?;
        let blobs: Vec<String> = [
            super::clips::blob_keys(&mut transaction, Some(id)).await?,
            super::lidar_maps::blob_keys(&mut transaction, Some(id)).await?,
            super::home_maps::blob_keys(&mut transaction, Some(id)).await?,
            super::uploads::blob_keys_of_home(&mut transaction, id).await?,
        ]
        .concat();
        let deleted = sqlx::query("DELETE FROM homes WHERE id = $1").bind(id.as_str());
        if deleted.execute(&mut *transaction).await?.rows_affected() == 0 {
            return Err(StorageError::NoSuchHome);
        }
        changes::record_home_removed(&mut transaction, id, now).await?;
        transaction.commit().await?;
        self.blobs.discard(&blobs).await;
        Ok(())
    }
}

pub(super) async fn exists(connection: &mut Connection, id: &HomeId) -> Result<bool, StorageError> {
    let row = sqlx::query("SELECT id FROM homes WHERE id = $1").bind(id.as_str());
    Ok(row.fetch_optional(connection).await?.is_some())
}
