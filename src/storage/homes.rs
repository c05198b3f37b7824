//! Homes.

mod id;

pub use id::{HomeId, InvalidHomeId, InvalidTenant, Tenant};

use super::changes::{self, Changed};
use super::columns::Columns;
use super::database::{Connection, Row, Transaction, query};
use super::{Page, Storage, StorageError, pending_deletes};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// Rows over which a tenant's total of bytes is spread.
const TOTAL_PARTS: i64 = 16;

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
    let newest_change = row.maybe_time("changed_at")?;
    let updated_at = row.time("updated_at")?;
    Ok(Home {
        id: row.home("id")?,
        name: row.maybe_text("name")?,
        lidar_map_revision: row.maybe_number("lidar_map_revision")?,
        clips: row.number("clips")?,
        created_at: row.time("created_at")?,
        updated_at: newest_change.map_or(updated_at, |at| at.max(updated_at)),
    })
}

macro_rules! select_homes {
    ($rest:literal) => {
        concat!(
            "SELECT homes.*,
                (SELECT MAX(at) FROM changes WHERE home_id = homes.id) AS changed_at,
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
        let made = query(
            "INSERT INTO homes (id, tenant, name, created_at, updated_at) VALUES ($1, $2, $3, $4, $4)
            ON CONFLICT (id) DO NOTHING",
        );
        let made = made.bind(id.key()).bind(id.tenant()).bind(name).bind(now.as_millisecond());
        let is_new = made.execute(&mut transaction).await? > 0;
        let is_renamed = !is_new && rename(&mut transaction, id, name).await?;
        if is_new || is_renamed {
            changes::record(&mut transaction, id, Changed::Home, now).await?;
        }
        let row = query(select_homes!("WHERE id = $1")).bind(id.key());
        let home = from_row(&row.fetch_one(&mut transaction).await?)?;
        transaction.commit().await?;
        Ok((home, is_new))
    }

    pub async fn home(&self, id: &HomeId) -> Result<Home, StorageError> {
        let row = query(select_homes!("WHERE id = $1")).bind(id.key());
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        from_row(&row.ok_or(StorageError::NoSuchHome)?)
    }

    /// A tenant's, by id; only those that changed later than `updated_after`, when it is given.
    pub async fn homes(
        &self,
        tenant: &Tenant,
        updated_after: Option<Timestamp>,
        page: &Page<HomeId>,
    ) -> Result<Vec<Home>, StorageError> {
        // Who asks for what changed expects little of it, so that is found by the indexes of times and then sorted.
        let statement = match updated_after {
            Some(_) => select_homes!(
                "WHERE id IN (SELECT id FROM homes WHERE tenant = $1 AND updated_at > $4
                        UNION SELECT home_id FROM changes WHERE tenant = $1 AND at > $4)
                    AND id || '' > $2 ORDER BY id || '' LIMIT $3"
            ),
            // That the tenant is no other is said so that planners begin in the index of both where the page does: else
            // they go through the next tenant's homes, or through this one's from the first.
            None => {
                select_homes!("WHERE (tenant, id) > ($1, $2) AND tenant <= $1 ORDER BY tenant, id LIMIT $3")
            }
        };
        let mut query = query(statement)
            .bind(tenant.name())
            .bind(page.after.as_ref().map_or("", HomeId::key))
            .bind(i64::from(page.limit));
        if let Some(time) = updated_after {
            query = query.bind(time.as_millisecond());
        }
        let rows = query.fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(from_row).collect()
    }

    /// How many bytes a tenant has sent as files that are still here.
    pub async fn tenant_bytes(&self, tenant: &Tenant) -> Result<u64, StorageError> {
        let sum = query(
            "SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) AS size_bytes FROM tenant_sizes WHERE tenant = $1",
        );
        let sum = sum.bind(tenant.name()).fetch_one(&mut self.database.reader().await?).await?;
        sum.count("size_bytes")
    }

    /// Removes a home with everything in it. A worker that is busy with one of its clips loses its lease. Where the home
    /// went and a file of it could not, this is an error; again, and it is tried again.
    pub async fn delete_home(&self, id: &HomeId, now: Timestamp) -> Result<(), StorageError> {
        let owner = format!("home:{}", id.key());
        let mut transaction = self.database.begin().await?;
        if !lock(&mut transaction, id).await? {
            drop(transaction);
            let had_left = self.delete_pending(&owner).await?;
            return if had_left { Ok(()) } else { Err(StorageError::NoSuchHome) };
        }
        let blobs: Vec<String> = [
            super::clips::blob_keys(&mut transaction, Some(id)).await?,
            super::lidar_maps::blob_keys(&mut transaction, Some(id)).await?,
            super::home_maps::blob_keys(&mut transaction, Some(id)).await?,
            super::uploads::blob_keys_of_home(&mut transaction, id).await?,
        ]
        .concat();
        super::jobs::lock_of_home(&mut transaction, id).await?;
        let size = query("SELECT size_bytes FROM homes WHERE id = $1").bind(id.key());
        let size_bytes = size.fetch_one(&mut transaction).await?.number("size_bytes")?;
        grow(&mut transaction, id, -size_bytes).await?;
        query("DELETE FROM homes WHERE id = $1").bind(id.key()).execute(&mut transaction).await?;
        changes::record_home_removed(&mut transaction, id, now).await?;
        pending_deletes::add(&mut transaction, &owner, &blobs, now).await?;
        pending_deletes::take_over(&mut transaction, &owner, &format!("clip:{}", id.key())).await?;
        transaction.commit().await?;
        self.delete_pending(&owner).await?;
        Ok(())
    }
}

async fn rename(
    transaction: &mut Transaction,
    id: &HomeId,
    name: Option<&str>,
) -> Result<bool, StorageError> {
    let renamed = query("UPDATE homes SET name = $2 WHERE id = $1 AND name IS DISTINCT FROM $2");
    Ok(renamed.bind(id.key()).bind(name).execute(transaction).await? > 0)
}

pub(super) async fn exists(connection: &mut Connection, id: &HomeId) -> Result<bool, StorageError> {
    let row = query("SELECT id FROM homes WHERE id = $1").bind(id.key());
    Ok(row.fetch_optional(connection).await?.is_some())
}

/// Keeps everyone else from changing the home and what is in it until the transaction ends; false when there is no such
/// home. To be done before anything else of the home is locked.
pub(super) async fn lock(transaction: &mut Transaction, id: &HomeId) -> Result<bool, StorageError> {
    let row = query(transaction.either(
        "SELECT id FROM homes WHERE id = $1",
        "SELECT id FROM homes WHERE id = $1 FOR NO KEY UPDATE",
    ));
    Ok(row.bind(id.key()).fetch_optional(transaction).await?.is_some())
}

/// Counts bytes that a home has more, or less, as files.
pub(super) async fn grow(
    transaction: &mut Transaction,
    home: &HomeId,
    bytes: i64,
) -> Result<(), StorageError> {
    query("UPDATE homes SET size_bytes = size_bytes + $2 WHERE id = $1")
        .bind(home.key())
        .bind(bytes)
        .execute(transaction)
        .await?;
    // Any part will do, as long as homes are spread over all.
    let part = home.key().bytes().map(i64::from).sum::<i64>() % TOTAL_PARTS;
    query(
        "INSERT INTO tenant_sizes (tenant, part, size_bytes) VALUES ($1, $2, $3)
        ON CONFLICT (tenant, part) DO UPDATE SET size_bytes = tenant_sizes.size_bytes + excluded.size_bytes",
    )
    .bind(home.tenant())
    .bind(part)
    .bind(bytes)
    .execute(transaction)
    .await?;
    Ok(())
}
