//! The changes feed: changes of homes and of their contents, in the order of commit.
//!
//! The feed keeps the newest change of each item, under a number that grows with every change. A reader
//! without a cursor gets every item once; a reader with a cursor gets the changes since. A row is written in
//! the transaction of its change, so the feed never differs from the committed state.
//!
//! Writers assign no numbers: the numbers must follow the order of commit, so every writer would wait for
//! every other. A change has a null number until a reader of the feed numbers all committed changes, one
//! reader at a time. A number is therefore higher than all that were assigned before, and lower than all
//! later ones.

mod position;

pub use position::FeedPosition;

use super::database::{Connection, Row, Transaction, query};
use super::{ClipState, HomeId, Storage, StorageError, Tenant};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt;
use std::str::FromStr;
use uuid::Uuid;

/// Lifetime of a cursor since its reader last reached the end: the feed keeps deletions this long.
pub const CURSOR_LIFE: SignedDuration = SignedDuration::from_hours(30 * 24);
/// Time that deletions stay in the feed. The extra day covers clock differences and slow requests.
const TOLD: SignedDuration = SignedDuration::from_hours(31 * 24);

/// Maximum number of old removals that one removal deletes.
const FORGOTTEN_AT_ONCE: i64 = 1_000;

const HOUR: SignedDuration = SignedDuration::from_hours(1);

/// Most changes that are numbered in one transaction.
const NUMBERED_AT_ONCE: i64 = 10_000;

/// Selects the homes of the changes after a position, with repetitions: for DISTINCT, SQLite scans all changes by home.
pub(super) const CHANGED_HOMES: &str = "SELECT home_id FROM changes WHERE seq > $1";

/// Kind of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// The home was made, renamed, or removed with everything in it.
    Home,
    /// The home's LiDAR map has a new revision, or a level was removed.
    LidarMap,
    /// The clip is new, or its state, placement, choice or title changed, or it was removed.
    Clip,
    /// The home's fused map has a new revision.
    Map,
    /// Objects of the home's fused map were added, moved or are gone.
    Objects,
}

impl ChangeKind {
    pub const ALL: [ChangeKind; 5] =
        [ChangeKind::Home, ChangeKind::LidarMap, ChangeKind::Clip, ChangeKind::Map, ChangeKind::Objects];
}

/// The newest change of a home, of its LiDAR map, of a clip, of a fused map, or of its objects.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// Grows with every change, not always by 1.
    pub seq: i64,
    pub at: Timestamp,
    pub home: HomeId,
    pub kind: ChangeKind,
    /// Set for kind `clip`.
    pub clip: Option<Uuid>,
    /// The current revision; set for kinds `lidar_map`, `map` and `objects`.
    pub revision: Option<i64>,
    /// Set for kind `clip`; null if the clip was removed.
    pub state: Option<ClipState>,
    /// True if it was removed.
    pub deleted: bool,
}

/// Position of a reader in the feed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChangesCursor {
    position: FeedPosition,
    /// Whole hour in which the reader last reached the end of the feed, or started: it knows all earlier deletions.
    knows_until: Timestamp,
}

/// A page of the feed.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    pub items: Vec<Change>,
    /// Cursor of the next page, even at the end of the feed.
    pub next: ChangesCursor,
    /// True if there are further changes now.
    pub more: bool,
}

impl fmt::Display for ChangesCursor {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}.{}", self.knows_until.as_millisecond(), self.position)
    }
}

impl FromStr for ChangesCursor {
    type Err = ();

    fn from_str(text: &str) -> Result<ChangesCursor, ()> {
        let (knows_until, position) = match text.split_once('.').ok_or(())? {
            (knows_until, position) if position.contains('.') => (knows_until, position.parse()?),
            // As earlier versions wrote it.
            (seq, knows_until) => (knows_until, seq.parse()?),
        };
        let knows_until =
            Timestamp::from_millisecond(knows_until.parse().map_err(|_| ())?).map_err(|_| ())?;
        Ok(ChangesCursor { position, knows_until })
    }
}

/// Rounds down, so a page without news stays the same for its readers: its cursor has this time.
fn whole_hour(now: Timestamp) -> Timestamp {
    let hour = HOUR.as_secs();
    Timestamp::from_second(now.as_second().div_euclid(hour) * hour).unwrap_or(now)
}

pub(super) fn from_row(row: &Row) -> Result<Change, StorageError> {
    let has_clip = !row.text("clip_id")?.is_empty();
    Ok(Change {
        seq: row.number("seq")?,
        at: row.time("at")?,
        home: row.home("home_id")?,
        kind: row.name("kind")?,
        clip: has_clip.then(|| row.id("clip_id")).transpose()?,
        revision: row.maybe_number("revision")?,
        state: row.maybe_name("state")?,
        deleted: row.number("deleted")? != 0,
    })
}

impl Storage {
    /// Returns at most `limit` changes of a tenant after a cursor, or from the beginning.
    pub async fn changes(
        &self,
        tenant: &Tenant,
        after: Option<ChangesCursor>,
        limit: u32,
        now: Timestamp,
    ) -> Result<Changes, StorageError> {
        self.number_changes().await?;
        let hour = whole_hour(now);
        let mut snapshot = self.database.snapshot().await?;
        let end = position::end(&mut snapshot).await?;
        let begin = || ChangesCursor { position: end.at(0), knows_until: hour };
        let after = after.unwrap_or_else(begin);
        // The last read was somewhere in that hour.
        if now.duration_since(after.knows_until) >= CURSOR_LIFE + HOUR
            || !after.position.is_of_past(&mut snapshot).await?
        {
            return Err(StorageError::CursorExpired);
        }
        let rows = query("SELECT * FROM changes WHERE tenant = $1 AND seq > $2 ORDER BY seq LIMIT $3")
            .bind(tenant.name())
            .bind(after.position.seq)
            .bind(i64::from(limit) + 1)
            .fetch_all(&mut snapshot)
            .await?;
        let more = rows.len() > limit as usize;
        let items = rows.iter().take(limit as usize).map(from_row).collect::<Result<Vec<Change>, _>>()?;
        let seq = items.last().map_or(after.position.seq, |change| change.seq);
        let knows_until = if more { after.knows_until } else { after.knows_until.max(hour) };
        let next = ChangesCursor { position: end.at(seq), knows_until };
        Ok(Changes { items, next, more })
    }

    /// Returns the newest number of the feed, from which [`Storage::home_changes`] continues.
    pub async fn last_change(&self) -> Result<i64, StorageError> {
        self.number_changes().await?;
        let last = query("SELECT last_seq FROM change_counter");
        last.fetch_one(&mut self.database.reader().await?).await?.number("last_seq")
    }

    /// Returns the changes of one home after a position, in commit order.
    pub async fn home_changes(&self, home: &HomeId, after: i64) -> Result<Vec<Change>, StorageError> {
        self.number_changes().await?;
        let rows = query("SELECT * FROM changes WHERE home_id = $1 AND seq > $2 ORDER BY seq")
            .bind(home.key())
            .bind(after)
            .fetch_all(&mut self.database.reader().await?)
            .await?;
        rows.iter().map(from_row).collect()
    }

    /// Returns the homes of all tenants with a numbered change after a position.
    pub async fn changed_homes(&self, after: i64) -> Result<Vec<HomeId>, StorageError> {
        let homes = query(CHANGED_HOMES).bind(after);
        let rows = homes.fetch_all(&mut self.database.reader().await?).await?;
        let mut homes: Vec<HomeId> = rows.iter().map(|row| row.home("home_id")).collect::<Result<_, _>>()?;
        let mut seen = HashSet::new();
        homes.retain(|home| seen.insert(home.clone()));
        Ok(homes)
    }

    /// Numbers the changes that have no number yet, in the order in which they were made.
    pub async fn number_changes(&self) -> Result<(), StorageError> {
        let mut numbered = NUMBERED_AT_ONCE;
        while numbered == NUMBERED_AT_ONCE && fresh_is_there(&mut self.database.reader().await?).await? {
            let mut transaction = self.database.begin().await?;
            numbered = number_some(&mut transaction).await?;
            transaction.commit().await?;
        }
        Ok(())
    }
}

async fn fresh_is_there(connection: &mut Connection) -> Result<bool, StorageError> {
    let fresh = query("SELECT home_id FROM changes WHERE seq IS NULL LIMIT 1");
    Ok(fresh.fetch_optional(connection).await?.is_some())
}

/// Returns the newest number, and locks the numbering until the transaction ends: one process numbers at a time.
async fn lock_counter(transaction: &mut Transaction) -> Result<i64, StorageError> {
    let counter = query("SELECT last_seq FROM change_counter FOR UPDATE");
    counter.fetch_one(transaction).await?.number("last_seq")
}

/// Numbers at most [`NUMBERED_AT_ONCE`] changes and returns how many it numbered. A row that another transaction is changing is
/// numbered later.
async fn number_some(transaction: &mut Transaction) -> Result<i64, StorageError> {
    let last = lock_counter(transaction).await?;
    let update = query(
        "UPDATE changes SET seq = fresh.seq
        FROM (
            SELECT home_id, kind, clip_id, $1 + ROW_NUMBER() OVER (ORDER BY ticket, home_id, kind, clip_id) AS seq
            FROM (SELECT home_id, kind, clip_id, ticket FROM changes WHERE seq IS NULL ORDER BY ticket LIMIT $2
                FOR UPDATE SKIP LOCKED) AS next
        ) AS fresh
        WHERE changes.home_id = fresh.home_id AND changes.kind = fresh.kind AND changes.clip_id = fresh.clip_id",
    );
    let numbered = update.bind(last).bind(NUMBERED_AT_ONCE).execute(transaction).await? as i64;
    query("UPDATE change_counter SET last_seq = $1").bind(last + numbered).execute(transaction).await?;
    Ok(numbered)
}

/// A change that a transaction records.
#[derive(Debug, Clone, Copy)]
pub(super) enum Changed {
    Home,
    LidarMap { revision: i64 },
    Clip { id: Uuid, state: ClipState },
    ClipRemoved { id: Uuid },
    Map { revision: i64 },
    Objects { revision: i64 },
}

/// Records a change in the feed, in the transaction of the change.
pub(super) async fn record(
    connection: &mut Connection,
    home: &HomeId,
    changed: Changed,
    now: Timestamp,
) -> Result<(), StorageError> {
    let (kind, clip, revision, state) = match changed {
        Changed::Home => ("home", None, None, None),
        Changed::LidarMap { revision } => ("lidar_map", None, Some(revision), None),
        Changed::Clip { id, state } => ("clip", Some(id), None, Some(state.name())),
        Changed::ClipRemoved { id } => ("clip", Some(id), None, None),
        Changed::Map { revision } => ("map", None, Some(revision), None),
        Changed::Objects { revision } => ("objects", None, Some(revision), None),
    };
    let is_removed = matches!(changed, Changed::ClipRemoved { .. });
    query(
        "INSERT INTO changes (home_id, kind, clip_id, tenant, at, revision, state, deleted, ticket)
        VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)
        ON CONFLICT (home_id, kind, clip_id) DO UPDATE SET seq = NULL, ticket = excluded.ticket,
            at = CASE WHEN excluded.at > changes.at THEN excluded.at ELSE changes.at END,
            revision = excluded.revision, state = excluded.state, deleted = excluded.deleted",
    )
    .bind(home.key())
    .bind(kind)
    .bind(clip.map(|id| id.to_string()).unwrap_or_default())
    .bind(home.tenant())
    .bind(now.as_millisecond())
    .bind(revision)
    .bind(state)
    .bind(i64::from(is_removed))
    .bind(ticket())
    .execute(connection)
    .await?;
    if is_removed {
        // `forget` deletes this row later; the home's time must not go back then. The caller locked the home.
        query("UPDATE homes SET updated_at = $2 WHERE id = $1 AND updated_at < $2")
            .bind(home.key())
            .bind(now.as_millisecond())
            .execute(connection)
            .await?;
        forget(connection, now).await?;
    }
    Ok(())
}

/// Returns a sort key that grows with time, strictly within one process.
fn ticket() -> String {
    Uuid::now_v7().to_string()
}

/// Records that a home was removed, after all its contents: a new home under the same id would otherwise hide
/// the removal of the old contents.
pub(super) async fn record_home_removed(
    connection: &mut Connection,
    home: &HomeId,
    now: Timestamp,
) -> Result<(), StorageError> {
    query(
        "UPDATE changes SET seq = NULL, at = CASE WHEN at < $2 THEN $2 ELSE at END, state = NULL, deleted = 1,
            ticket = $3 || CASE kind WHEN 'home' THEN '1' ELSE '0' END || substr(ticket, 1, 36)
        WHERE home_id = $1 AND deleted = 0",
    )
    .bind(home.key())
    .bind(now.as_millisecond())
    .bind(ticket())
    .execute(connection)
    .await?;
    forget(connection, now).await
}

/// Deletes removals older than [`TOLD`]. Every removal calls this, so the feed holds the existing items
/// and a month of removals. Of many old removals each call deletes a part: the caller holds its home.
async fn forget(connection: &mut Connection, now: Timestamp) -> Result<(), StorageError> {
    let old = query(
        "DELETE FROM changes WHERE (home_id, kind, clip_id) IN (
            SELECT home_id, kind, clip_id FROM changes WHERE deleted = 1 AND at < $1 LIMIT $2
            FOR UPDATE SKIP LOCKED)",
    );
    old.bind((now - TOLD).as_millisecond()).bind(FORGOTTEN_AT_ONCE).execute(connection).await?;
    Ok(())
}
