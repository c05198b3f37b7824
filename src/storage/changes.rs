//! The changes feed: what happened to homes and to what is in them, in the order of commit.
//!
//! The newest change of each thing is kept, under a number that grows with every change, so that a reader that begins
//! with nothing sees everything once, and one that goes on sees what changed since. A row is written in the
//! transaction of its change: the feed tells nothing that was not committed, and everything that was.
//!
//! The numbers come from one row that every writer updates. SQLite has one writer, so the order of the numbers is the
//! order of commit, and who has seen a number has seen all lower ones. On PostgreSQL the lock on that row, which a
//! transaction holds to its end, gives the same order, which a sequence would not: its numbers are given out before
//! commit, and a reader could pass one that appears later. [`record`] then has to come last in a transaction, so that
//! writers wait for each other for a short time and never in a circle. Should that be the bottleneck, each row takes
//! `pg_current_xact_id()` and readers stop below `pg_snapshot_xmin(pg_current_snapshot())`.

use super::columns::Columns;
use super::database::{Connection, Row};
use super::{ClipState, HomeId, Storage, StorageError};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use uuid::Uuid;

/// How long after its last full reading a reader may go on: for as long, what was deleted is told.
pub const CURSOR_LIFE: SignedDuration = SignedDuration::from_hours(30 * 24);
/// Deleted things are told for a day more, so that clocks and slow requests cannot hide one from a good cursor.
const TOLD: SignedDuration = SignedDuration::from_hours(31 * 24);

/// What changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// The home was made, renamed, or removed with everything in it.
    Home,
    /// The home's LiDAR map has a new revision.
    LidarMap,
    /// The clip is new, or its state, placement or choice changed, or it was removed.
    Clip,
    /// The home's fused map has a new revision.
    Map,
}

/// The newest change of a home, of its LiDAR map, of a clip, or of a fused map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Change {
    /// Grows with every change, not always by 1.
    #[schema(minimum = 1, example = 4711)]
    pub seq: i64,
    pub at: Timestamp,
    pub home: HomeId,
    pub kind: ChangeKind,
    /// Of kind `clip`.
    #[schema(example = "01a1f766-7a97-7747-9dbb-391e0eeccb64")]
    pub clip: Option<Uuid>,
    /// Of kinds `lidar_map` and `map`: the current one.
    pub revision: Option<i64>,
    /// Of kind `clip`; null when it was removed.
    pub state: Option<ClipState>,
    /// Whether it is gone.
    pub deleted: bool,
}

/// How far a reader has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChangesCursor {
    seq: i64,
    /// When the reader last was at the end of the feed, or began with nothing: of what was deleted before, it knows.
    knows_until: Timestamp,
}

/// A part of the feed.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    pub items: Vec<Change>,
    /// Where to go on, also at the end.
    pub next: ChangesCursor,
    /// Whether there are further changes now.
    pub more: bool,
}

impl fmt::Display for ChangesCursor {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}.{}", self.seq, self.knows_until.as_millisecond())
    }
}

impl FromStr for ChangesCursor {
    type Err = ();

    fn from_str(text: &str) -> Result<ChangesCursor, ()> {
        let (seq, knows_until) = text.split_once('.').ok_or(())?;
        let seq = seq.parse().ok().filter(|seq| *seq >= 0).ok_or(())?;
        let knows_until =
            Timestamp::from_millisecond(knows_until.parse().map_err(|_| ())?).map_err(|_| ())?;
        Ok(ChangesCursor { seq, knows_until })
    }
}

fn from_row(row: &Row) -> Result<Change, StorageError> {
    let clip = Some(row.text("clip_id")?).filter(|id| !id.is_empty());
    Ok(Change {
        seq: row.number("seq")?,
        at: row.time("at")?,
        home: row.home("home_id")?,
        kind: row.name("kind")?,
        clip: clip.map(|_| row.id("clip_id")).transpose()?,
        revision: row.maybe_number("revision")?,
        state: row.maybe_name("state")?,
        deleted: row.number("deleted")? != 0,
    })
}

impl Storage {
    /// At most `limit` changes after a cursor, or from the beginning.
    pub async fn changes(
        &self,
        after: Option<ChangesCursor>,
        limit: u32,
        now: Timestamp,
    ) -> Result<Changes, StorageError> {
        let after = after.unwrap_or(ChangesCursor { seq: 0, knows_until: now });
        let mut snapshot = self.database.snapshot().await?;
        let last = sqlx::query("SELECT last_seq FROM change_counter").fetch_one(&mut *snapshot).await?;
        // A number that was not given out yet is from before the database was restored from a copy.
        if now.duration_since(after.knows_until) > CURSOR_LIFE || after.seq > last.number("last_seq")? {
            return Err(StorageError::CursorExpired);
        }
        let rows = sqlx::query("SELECT * FROM changes WHERE seq > $1 ORDER BY seq LIMIT $2")
            .bind(after.seq)
            .bind(i64::from(limit) + 1)
            .fetch_all(&mut *snapshot)
            .await?;
        let more = rows.len() > limit as usize;
        let items = rows.iter().take(limit as usize).map(from_row).collect::<Result<Vec<Change>, _>>()?;
        let seq = items.last().map_or(after.seq, |change| change.seq);
        let knows_until = if more { after.knows_until } else { after.knows_until.max(now) };
        Ok(Changes { items, next: ChangesCursor { seq, knows_until }, more })
    }
}

/// What a transaction changes.
#[derive(Debug, Clone, Copy)]
pub(super) enum Changed {
    Home,
    LidarMap { revision: i64 },
    Clip { id: Uuid, state: ClipState },
    ClipRemoved { id: Uuid },
    Map { revision: i64 },
}

/// Tells the feed of a change, and moves the home's time of change. To be called by every writer, in the transaction of
/// the change and, where there is a choice, late in it.
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
    };
    let is_removed = matches!(changed, Changed::ClipRemoved { .. });
    let seq = take_numbers(connection, 1).await?;
    sqlx::query(
        "INSERT INTO changes (seq, at, home_id, kind, clip_id, revision, state, deleted)
        VALUES ($1, $2, $3, $4, $5, $6, $7, $8)
        ON CONFLICT (home_id, kind, clip_id) DO UPDATE SET seq = excluded.seq, at = excluded.at,
            revision = excluded.revision, state = excluded.state, deleted = excluded.deleted",
    )
    .bind(seq)
    .bind(now.as_millisecond())
    .bind(home.as_str())
    .bind(kind)
    .bind(clip.map(|id| id.to_string()).unwrap_or_default())
    .bind(revision)
    .bind(state)
    .bind(i64::from(is_removed))
    .execute(&mut *connection)
    .await?;
    sqlx::query("UPDATE homes SET updated_at = $2 WHERE id = $1 AND updated_at < $2")
        .bind(home.as_str())
        .bind(now.as_millisecond())
        .execute(&mut *connection)
        .await?;
    if is_removed { forget(connection, now).await } else { Ok(()) }
}

/// Tells the feed that a home is gone, after everything that was in it: a home that is made anew under the same id
/// would otherwise hide that its old contents went.
pub(super) async fn record_home_removed(
    connection: &mut Connection,
    home: &HomeId,
    now: Timestamp,
) -> Result<(), StorageError> {
    let live = sqlx::query("SELECT COUNT(*) AS live FROM changes WHERE home_id = $1 AND deleted = 0");
    let live = live.bind(home.as_str()).fetch_one(&mut *connection).await?.number("live")?;
    let last = take_numbers(connection, live).await?;
    sqlx::query(
        "UPDATE changes SET seq = removed.seq, at = $3, state = NULL, deleted = 1
        FROM (
            SELECT seq AS old_seq,
                $2 + ROW_NUMBER() OVER (ORDER BY CASE kind WHEN 'home' THEN 1 ELSE 0 END, seq) AS seq
            FROM changes WHERE home_id = $1 AND deleted = 0
        ) AS removed
        WHERE changes.seq = removed.old_seq",
    )
    .bind(home.as_str())
    .bind(last - live)
    .bind(now.as_millisecond())
    .execute(&mut *connection)
    .await?;
    forget(connection, now).await
}

/// Gives out this many numbers, of which it returns the last.
async fn take_numbers(connection: &mut Connection, count: i64) -> Result<i64, StorageError> {
    let taken = sqlx::query("UPDATE change_counter SET last_seq = last_seq + $1 RETURNING last_seq");
    taken.bind(count).fetch_one(connection).await?.number("last_seq")
}

/// Removes what has been told for long enough. Every removal clears the way for itself, so the feed stays as large as
/// what there is and a month of removals.
async fn forget(connection: &mut Connection, now: Timestamp) -> Result<(), StorageError> {
    sqlx::query("DELETE FROM changes WHERE deleted = 1 AND at < $1")
        .bind((now - TOLD).as_millisecond())
        .execute(connection)
        .await?;
    Ok(())
}
