//! Homes.

mod id;
mod search;

pub use id::{HomeId, InvalidHomeId, InvalidTenant, Tenant};

use super::changes::{self, Changed};
use super::database::{Connection, Row, Transaction, query};
use super::home_maps::{self, FAILING_MERGES, MapState};
use super::{ClipState, Page, Storage, StorageError, pending_deletes};
use jiff::Timestamp;
use search::search_text;
use serde::{Deserialize, Serialize};
use viola_geometry::LevelName;

/// Rows that share a tenant's total of bytes.
const TOTAL_PARTS: i64 = 16;

/// A home, with its LiDAR map and clips.
#[derive(Debug, Clone, PartialEq)]
pub struct Home {
    pub id: HomeId,
    /// Display name.
    pub name: Option<String>,
    /// Revision of the current LiDAR map, null before the first one.
    pub lidar_map_revision: Option<i64>,
    /// Number of clips in each state, in the order of [`ClipState::ALL`].
    pub clips: [i64; ClipState::ALL.len()],
    /// Number of queued clips whose last attempt met a fault of the service.
    pub clips_after_fault: i64,
    /// The seen part of each level in the newest revision of its map; none before the first.
    pub coverage: Vec<LevelCoverage>,
    pub map_state: MapState,
    pub created_at: Timestamp,
    /// Time of the newest change of the home, its LiDAR map, its clips or its fused map.
    pub updated_at: Timestamp,
}

/// The part of a level's LiDAR map that the clips have seen, as fractions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LevelCoverage {
    pub level: LevelName,
    pub seen: f64,
    pub floor_seen: f64,
}

/// Filter of a list of homes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct HomeFilter {
    /// Only homes that changed later than this.
    pub updated_after: Option<Timestamp>,
    /// Only homes with this text in their id or name, in any case.
    pub text: Option<String>,
    /// Only homes with clips that wait, met a fault of the service, are ambiguous or failed, and those whose map is failing.
    pub needs_attention: bool,
}

fn from_row(row: &Row) -> Result<Home, StorageError> {
    let newest_change = row.maybe_time("changed_at")?;
    let updated_at = row.time("updated_at")?;
    let mut clips = [0; ClipState::ALL.len()];
    for (number, state) in clips.iter_mut().zip(ClipState::ALL) {
        *number = row.number(state.name())?;
    }
    Ok(Home {
        id: row.home("id")?,
        name: row.maybe_text("name")?,
        lidar_map_revision: row.maybe_number("lidar_map_revision")?,
        clips,
        clips_after_fault: row.number("after_fault")?,
        coverage: row.maybe_json("coverage")?.unwrap_or_default(),
        map_state: MapState::of(row)?,
        created_at: row.time("created_at")?,
        updated_at: newest_change.map_or(updated_at, |at| at.max(updated_at)),
    })
}

/// Counts the clips of a home in each of some states.
macro_rules! clips_in {
    ($($state:literal)+) => {
        concat!($(
            "(SELECT COUNT(*) FROM clips WHERE home_id = homes.id AND state = '",
            $state,
            "') AS ",
            $state,
            ", ",
        )+)
    };
}

/// Selects the queued clips of a home whose last attempt met a fault of the service.
macro_rules! after_fault {
    () => {
        "FROM clips JOIN jobs ON jobs.id = clips.job_id
        WHERE clips.home_id = homes.id AND clips.state = 'queued' AND jobs.faults > 0 AND jobs.error IS NOT NULL"
    };
}

/// Selects the homes that a person should look at; $5 is 0 for all homes.
macro_rules! needing_attention {
    () => {
        concat!(
            "($5 = 0 OR (map_made < map_wanted AND map_faults >= $6)
                OR EXISTS (SELECT 1 FROM clips
                    WHERE home_id = homes.id AND state IN ('uploaded', 'ambiguous', 'failed'))
                OR EXISTS (SELECT 1 ",
            after_fault!(),
            "))"
        )
    };
}

macro_rules! select_homes {
    ($($rest:expr),+) => {
        concat!(
            "SELECT homes.*,
                (SELECT MAX(at) FROM changes WHERE home_id = homes.id) AS changed_at,
                (SELECT MAX(revision) FROM lidar_maps WHERE home_id = homes.id AND removed_at IS NULL)
                    AS lidar_map_revision, ",
            clips_in!("uploaded" "queued" "aligning" "aligned" "ambiguous" "failed"),
            "(SELECT COUNT(*) ",
            after_fault!(),
            ") AS after_fault FROM homes ",
            $($rest),+
        )
    };
}

impl Storage {
    /// Creates or renames a home, if it is as `expected`; returns it and whether it is new. The same name again
    /// changes nothing.
    pub async fn put_home(
        &self,
        id: &HomeId,
        name: Option<&str>,
        expected: impl Fn(Option<&Home>) -> bool + Send,
        now: Timestamp,
    ) -> Result<(Home, bool), StorageError> {
        let mut transaction = self.database.begin().await?;
        lock(&mut transaction, id).await?;
        let before = find(&mut transaction, id).await?;
        if !expected(before.as_ref()) {
            return Err(StorageError::Changed { what: "home" });
        }
        let search = search_text(id, name);
        let made = query(
            "INSERT INTO homes (id, tenant, name, search, created_at, updated_at) VALUES ($1, $2, $3, $5, $4, $4)
            ON CONFLICT (id) DO NOTHING",
        );
        let made = made.bind(id.key()).bind(id.tenant()).bind(name).bind(now.as_millisecond()).bind(&search);
        let is_new = made.execute(&mut transaction).await? > 0;
        if !is_new && before.is_none() {
            // Another request made it meanwhile.
            lock(&mut transaction, id).await?;
            if !expected(find(&mut transaction, id).await?.as_ref()) {
                return Err(StorageError::Changed { what: "home" });
            }
        }
        let is_renamed = !is_new && rename(&mut transaction, id, name, &search).await?;
        if is_renamed {
            home_maps::renamed(&mut transaction, id, now).await?;
        }
        if is_new || is_renamed {
            changes::record(&mut transaction, id, Changed::Home, now).await?;
        }
        let home = find(&mut transaction, id).await?.ok_or(StorageError::NoSuchHome)?;
        transaction.commit().await?;
        Ok((home, is_new))
    }

    pub async fn home(&self, id: &HomeId) -> Result<Home, StorageError> {
        find(&mut self.database.reader().await?, id).await?.ok_or(StorageError::NoSuchHome)
    }

    /// Returns a page of a tenant's homes that match a filter, by id.
    pub async fn homes(
        &self,
        tenant: &Tenant,
        filter: &HomeFilter,
        page: &Page<HomeId>,
    ) -> Result<Vec<Home>, StorageError> {
        // $4 is the text, $5 whether attention matters, $7 the time.
        let statement = match filter {
            // Few homes are expected to have changed: the indexes of times find them, then they are sorted.
            HomeFilter { updated_after: Some(_), .. } => select_homes!(
                "WHERE id IN (SELECT id FROM homes WHERE tenant = $1 AND updated_at > $7
                        UNION SELECT home_id FROM changes WHERE tenant = $1 AND at > $7)
                    AND id || '' > $2 AND search LIKE $4 ESCAPE '!' AND ",
                needing_attention!(),
                " ORDER BY id || '' LIMIT $3"
            ),
            // With both conditions on the tenant, planners start in the index of both at the page's first
            // row. Otherwise they scan the next tenant's homes, or this one's from the first.
            _ => select_homes!(
                "WHERE (tenant, id) > ($1, $2) AND tenant <= $1 AND search LIKE $4 ESCAPE '!' AND ",
                needing_attention!(),
                " ORDER BY tenant, id LIMIT $3"
            ),
        };
        let text = filter.text.as_deref().unwrap_or_default().to_lowercase();
        let text = text.replace('!', "!!").replace('%', "!%").replace('_', "!_");
        let mut query = query(statement)
            .bind(tenant.name())
            .bind(page.after.as_ref().map_or("", HomeId::key))
            .bind(i64::from(page.limit))
            .bind(format!("%{text}%"))
            .bind(i64::from(filter.needs_attention))
            .bind(i64::from(FAILING_MERGES));
        if let Some(time) = filter.updated_after {
            query = query.bind(time.as_millisecond());
        }
        let rows = query.fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(from_row).collect()
    }

    /// Removes a home with everything in it, if the home is as `expected`. A worker on one of its clips loses its lease.
    /// Returns an error if the home is removed but one of its files is not; another call retries that.
    pub async fn delete_home(
        &self,
        id: &HomeId,
        expected: impl Fn(&Home) -> bool + Send,
        now: Timestamp,
    ) -> Result<(), StorageError> {
        let owner = format!("home:{}", id.key());
        let mut transaction = self.database.begin().await?;
        if !lock(&mut transaction, id).await? {
            drop(transaction);
            let had_left = self.delete_pending(&owner).await?;
            return if had_left { Ok(()) } else { Err(StorageError::NoSuchHome) };
        }
        super::jobs::lock_of_home(&mut transaction, id).await?;
        let row = query(select_homes!("WHERE id = $1")).bind(id.key()).fetch_one(&mut transaction).await?;
        if !expected(&from_row(&row)?) {
            return Err(StorageError::Changed { what: "home" });
        }
        let blobs: Vec<String> = [
            super::clips::blob_keys(&mut transaction, id).await?,
            super::lidar_maps::blob_keys(&mut transaction, id).await?,
            super::home_maps::blob_keys(&mut transaction, id).await?,
            super::uploads::blob_keys_of_home(&mut transaction, id).await?,
        ]
        .concat();
        grow(&mut transaction, id, -row.number("size_bytes")?).await?;
        query("DELETE FROM homes WHERE id = $1").bind(id.key()).execute(&mut transaction).await?;
        changes::record_home_removed(&mut transaction, id, now).await?;
        pending_deletes::add(&mut transaction, &owner, &blobs, now).await?;
        for of_home in ["clip", "lidar-map", "home-map"] {
            pending_deletes::take_over(&mut transaction, &owner, &format!("{of_home}:{}", id.key())).await?;
        }
        transaction.commit().await?;
        self.delete_pending(&owner).await?;
        Ok(())
    }
}

async fn rename(
    transaction: &mut Transaction,
    id: &HomeId,
    name: Option<&str>,
    search: &str,
) -> Result<bool, StorageError> {
    let renamed = query(
        "UPDATE homes SET name = $2, search = $3 WHERE id = $1 AND (name IS DISTINCT FROM $2 OR search <> $3)",
    );
    Ok(renamed.bind(id.key()).bind(name).bind(search).execute(transaction).await? > 0)
}

/// Returns an error if there is no such home.
pub(super) async fn require(connection: &mut Connection, id: &HomeId) -> Result<(), StorageError> {
    let row = query("SELECT id FROM homes WHERE id = $1").bind(id.key());
    row.fetch_optional(connection).await?.map(drop).ok_or(StorageError::NoSuchHome)
}

async fn find(connection: &mut Connection, id: &HomeId) -> Result<Option<Home>, StorageError> {
    let row = query(select_homes!("WHERE id = $1")).bind(id.key());
    row.fetch_optional(connection).await?.as_ref().map(from_row).transpose()
}

/// Locks the home and its contents against changes until the transaction ends; returns false if there is no
/// such home. Must come before any other lock in the home.
pub(super) async fn lock(transaction: &mut Transaction, id: &HomeId) -> Result<bool, StorageError> {
    let row = query("SELECT id FROM homes WHERE id = $1 FOR NO KEY UPDATE");
    Ok(row.bind(id.key()).fetch_optional(transaction).await?.is_some())
}

/// [`lock`] that returns an error if there is no such home.
pub(super) async fn lock_existing(transaction: &mut Transaction, id: &HomeId) -> Result<(), StorageError> {
    if lock(transaction, id).await? { Ok(()) } else { Err(StorageError::NoSuchHome) }
}

/// [`lock`] that does not wait: it returns false, too, if another transaction holds the home.
pub(super) async fn lock_if_free(transaction: &mut Transaction, id: &HomeId) -> Result<bool, StorageError> {
    let row = query("SELECT id FROM homes WHERE id = $1 FOR NO KEY UPDATE SKIP LOCKED");
    Ok(row.bind(id.key()).fetch_optional(transaction).await?.is_some())
}

/// Adds `bytes`, negative for a removal, to the file sizes of the home and its tenant. The home is locked.
pub(super) async fn grow(connection: &mut Connection, home: &HomeId, bytes: i64) -> Result<(), StorageError> {
    if bytes == 0 {
        return Ok(());
    }
    query("UPDATE homes SET size_bytes = size_bytes + $2 WHERE id = $1")
        .bind(home.key())
        .bind(bytes)
        .execute(&mut *connection)
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
    .execute(connection)
    .await?;
    Ok(())
}
