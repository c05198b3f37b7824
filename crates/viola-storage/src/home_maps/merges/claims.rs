//! Claims of homes whose map is due, and what a merge waits for: for the clips of its home that are queued or running. A new
//! LiDAR map, which queues all clips again, then makes one new revision, and the old one stays until then. The waiting has limits,
//! since a home may never stop uploading: then the merge leaves out the clips that wait, and their answers make the next one due.

use crate::database::{Query, Row, Transaction, query};
use crate::{Storage, StorageError, clock};
use jiff::{SignedDuration, Timestamp};
use std::time::Duration;

/// A merge does not wait for a job whose next attempt is later than this.
pub(super) const LONG_REST: Duration = Duration::from_mins(1);

/// The same for a clip of the newest map, which the merge would take out of it. The pauses before this one take 10 minutes, too.
const LONG_REST_IN_MAP: Duration = Duration::from_mins(10);

/// Faults of a clip of the newest map that have lasted for less are those of an outage, and the merge waits for the clip however
/// long it rests.
const LONGEST_OUTAGE: SignedDuration = SignedDuration::from_hours(2);

/// A map that has been due for this long does not wait for clips that it does not have. Clips that were sent together are
/// aligned within minutes, and one merge has them all; a person who waits for a correction or a removal waits no longer.
const LONGEST_WAIT: SignedDuration = SignedDuration::from_mins(10);

/// A map that has been due for this long waits for no clip. Longer than the half day for which clips of the map may wait for
/// their turn after a new LiDAR map: until then their old map is better than one without them.
const LONGEST_WAIT_FOR_MAP: SignedDuration = SignedDuration::from_hours(15);

/// Pause before the next look at a home whose merge waits.
const LOOK_AGAIN: Duration = Duration::from_mins(1);

/// Most homes that one claim looks at: each look writes.
const MAX_LOOKS: usize = 16;

/// Holds for a home without a clip that is queued or running, of those that the first argument selects. The second one selects
/// jobs that do not count while they are queued: those that rest.
macro_rules! none_waits {
    ($which:literal, $rests:literal) => {
        concat!(
            "NOT EXISTS (SELECT 1 FROM clips WHERE home_id = homes.id AND state IN ('queued', 'aligning')",
            $which,
            " AND NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.id = clips.job_id AND jobs.state = 'queued' AND ",
            $rests,
            "))"
        )
    };
}

/// Holds for a home that is due and need not wait for its clips. [`with_limits`] binds the times of the limits.
macro_rules! need_not_wait {
    () => {
        concat!(
            "(map_due_since <= $5 OR (",
            none_waits!(" AND placement IS NOT NULL", "jobs.run_after > $2 AND jobs.first_fault_at <= $3"),
            " AND (",
            none_waits!("", "jobs.run_after > $1"),
            " OR map_due_since <= $4 OR map_due_since > $6)))"
        )
    };
}

/// Returns a statement with [`need_not_wait`] and its first six values: the times of [`LONG_REST`], [`LONG_REST_IN_MAP`],
/// [`LONGEST_OUTAGE`], [`LONGEST_WAIT`] and [`LONGEST_WAIT_FOR_MAP`], and that after which a time is of a clock that was ahead.
fn with_limits(statement: &'static str, now: Timestamp) -> Query {
    query(statement)
        .bind((now + LONG_REST).as_millisecond())
        .bind((now + LONG_REST_IN_MAP).as_millisecond())
        .bind((now - LONGEST_OUTAGE).as_millisecond())
        .bind((now - LONGEST_WAIT).as_millisecond())
        .bind((now - LONGEST_WAIT_FOR_MAP).as_millisecond())
        .bind(clock::no_pause_after(now))
}

/// Takes a home whose map is due, that no worker merges, that has no pause after a fault, and that need not wait for clips.
macro_rules! claim {
    ($tenants:literal) => {
        concat!(
            "UPDATE homes SET map_fence = map_fence + 1, map_lease_until = $8, map_claimed_at = $7
    WHERE id = (
        SELECT id FROM homes
        WHERE map_made < map_wanted AND tenant ",
            $tenants,
            " $9
            AND map_lease_until IS NULL AND (map_due_at <= $7 OR map_due_at > $6)
            AND ",
            need_not_wait!(),
            " ORDER BY tenant, map_claimed_at, id LIMIT 1 FOR NO KEY UPDATE SKIP LOCKED)
    RETURNING id, name, map_wanted, map_fence, map_faults, created_at"
        )
    };
}

/// The claim of a home whose tenant comes later.
pub(crate) const CLAIM_LATER: &str = claim!(">");

/// Selects a home without work ahead that may replace its newest map.
pub(super) const SETTLED: &str = concat!(
    "SELECT 1 FROM homes WHERE id = $1 AND map_made >= map_wanted AND ",
    none_waits!("", "jobs.run_after > $2")
);

/// Selects a claimed home if it still need not wait for clips. It waits, too, if no clip has a place and one of the map may get
/// one again after its rest: the merge would empty the map.
const STILL_NEED_NOT_WAIT: &str = concat!(
    "SELECT 1 FROM homes WHERE id = $7 AND ",
    need_not_wait!(),
    " AND (map_due_since <= $5
        OR NOT EXISTS (SELECT 1 FROM clips
            WHERE home_id = homes.id AND state IN ('queued', 'aligning') AND placement IS NOT NULL)
        OR EXISTS (SELECT 1 FROM clips
            WHERE home_id = homes.id AND state = 'aligned' AND result_key IS NOT NULL))"
);

impl Storage {
    /// Lets the waits of all homes begin again at a start of the only process: no clip was aligned while it did not run, and a map
    /// must not lose those that still wait.
    pub(crate) async fn begin_waits_again(&self, now: Timestamp) -> Result<(), StorageError> {
        let begin =
            query("UPDATE homes SET map_due_since = $1 WHERE map_made < map_wanted AND map_due_since < $1");
        self.database.execute(begin.bind(now.as_millisecond())).await.map(drop)
    }
}

/// Claims a home and returns its row; `None` if no merge is due.
pub(super) async fn take(
    transaction: &mut Transaction,
    after: &str,
    lease: Duration,
    now: Timestamp,
) -> Result<Option<Row>, StorageError> {
    let mut after = after.to_owned();
    for _ in 0..MAX_LOOKS {
        let Some(row) = take_next(transaction, &after, lease, now).await? else { return Ok(None) };
        // On PostgreSQL the claim saw the clips as they were when it began. A new LiDAR map may have queued them before it locked
        // the home.
        if still_need_not_wait(transaction, &row, now).await? {
            return Ok(Some(row));
        }
        query("UPDATE homes SET map_lease_until = NULL, map_due_at = $2 WHERE id = $1")
            .bind(row.text("id")?)
            .bind((now + LOOK_AGAIN).as_millisecond())
            .execute(transaction)
            .await?;
        // More homes of this tenant may wait than one claim looks at.
        row.home("id")?.tenant().clone_into(&mut after);
    }
    Ok(None)
}

/// Claims the next home of a later tenant than `after`, else of any other.
async fn take_next(
    transaction: &mut Transaction,
    after: &str,
    lease: Duration,
    now: Timestamp,
) -> Result<Option<Row>, StorageError> {
    for statement in [CLAIM_LATER, claim!("<=")] {
        let row = with_limits(statement, now)
            .bind(now.as_millisecond())
            .bind((now + lease).as_millisecond())
            .bind(after)
            .fetch_optional(transaction)
            .await?;
        if row.is_some() {
            return Ok(row);
        }
    }
    Ok(None)
}

async fn still_need_not_wait(
    transaction: &mut Transaction,
    row: &Row,
    now: Timestamp,
) -> Result<bool, StorageError> {
    let found = with_limits(STILL_NEED_NOT_WAIT, now).bind(row.text("id")?);
    Ok(found.fetch_optional(transaction).await?.is_some())
}
