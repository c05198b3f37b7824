//! Requeueing of jobs.

use super::{Fault, RetryPolicy, change_clip, fail};
use crate::columns::to_json;
use crate::database::{Row, Transaction, query};
use crate::{ClipState, Storage, StorageError, clock, homes};
use jiff::Timestamp;
use std::time::Duration;
use uuid::Uuid;
use viola_reconstruct::Reason;

/// Attempts and faults of a job so far.
pub(super) struct RetryState {
    pub attempts: u32,
    pub max_attempts: u32,
    /// Consecutive faults.
    faults: u32,
    first_fault_at: Option<Timestamp>,
}

impl RetryState {
    pub fn from_row(row: &Row) -> Result<RetryState, StorageError> {
        Ok(RetryState {
            attempts: row.count("attempts")?,
            max_attempts: row.count("max_attempts")?,
            faults: row.count("faults")?,
            first_fault_at: row.maybe_time("first_fault_at")?,
        })
    }

    /// Returns the state after an attempt that counts. It ends a series of faults.
    pub fn with_counted_attempt(self) -> RetryState {
        RetryState { faults: 0, first_fault_at: None, ..self }
    }

    /// Returns the state without the current attempt.
    pub fn without_attempt(self) -> RetryState {
        RetryState { attempts: self.attempts.saturating_sub(1), ..self }
    }

    /// Returns the state after a fault, which costs no attempt.
    fn with_fault(self, now: Timestamp) -> RetryState {
        RetryState {
            faults: self.faults.saturating_add(1),
            first_fault_at: self.first_fault_at.or(Some(now)),
            ..self.without_attempt()
        }
    }
}

impl Storage {
    /// Requeues the jobs whose lease expired, and returns their number. Jobs that were queued while the clock was ahead have
    /// their turns now.
    ///
    /// The end of such a worker is unknown: anything may have killed its process, so the attempt does not
    /// count. A job waits for the next call while another transaction holds its home.
    pub async fn release_lost(&self, retry: &RetryPolicy, now: Timestamp) -> Result<usize, StorageError> {
        self.advance_turns(now).await?;
        let rows = query(
            "SELECT jobs.id, clips.home_id, jobs.fence FROM jobs JOIN clips ON clips.id = jobs.clip_id
            WHERE jobs.state = 'running' AND (jobs.lease_until <= $1 OR jobs.lease_until > $2)
            ORDER BY jobs.lease_until",
        );
        let rows = rows.bind(now.as_millisecond()).bind(clock::no_lease_after(now));
        let rows = rows.fetch_all(&mut self.database.reader().await?).await?;
        let mut released = 0;
        for row in &rows {
            let mut transaction = self.database.begin().await?;
            // A long change of one home must not make the jobs of others wait. It may also be that of this job.
            if !homes::lock_if_free(&mut transaction, &row.home("home_id")?).await? {
                continue;
            }
            // Unless another process did so, or the worker sent a heartbeat, since.
            let lost = query(
                "UPDATE jobs SET fence = fence + 1
                WHERE id = $1 AND fence = $2 AND state = 'running' AND (lease_until <= $3 OR lease_until > $4)
                RETURNING attempts, max_attempts, faults, first_fault_at",
            );
            let lost = lost.bind(row.text("id")?).bind(row.number("fence")?).bind(now.as_millisecond());
            let lost = lost.bind(clock::no_lease_after(now));
            if let Some(lost) = lost.fetch_optional(&mut transaction).await? {
                let retries = RetryState::from_row(&lost)?;
                // The first time, the process was probably restarted, and a client may wait for the clip.
                let pause = match retries.faults {
                    0 => Duration::ZERO,
                    faults => retry.delay(faults),
                };
                let id = row.id("id")?;
                let requeued =
                    requeue_or_fail(&mut transaction, id, retries, Fault::WorkerLost, retry, pause, now)
                        .await;
                if let Err(unreadable @ StorageError::Column { .. }) = &requeued {
                    tracing::error!(job = %id, %unreadable, "the clip of a lost worker's job cannot be read");
                }
                despite_its_clip(&mut transaction, id, requeued, now).await?;
                released += 1;
            }
            transaction.commit().await?;
        }
        Ok(released)
    }

    /// Gives the jobs that were queued while the clock was ahead the turns of jobs that are queued now.
    async fn advance_turns(&self, now: Timestamp) -> Result<(), StorageError> {
        // Two reads of indexes: a new LiDAR map may leave thousands of jobs with late turns.
        let ahead = query(
            "SELECT id FROM jobs WHERE state = 'queued' AND again = 0 AND order_at > $1
            UNION ALL SELECT id FROM jobs WHERE state = 'queued' AND order_at > $2 LIMIT 1",
        );
        let (late, late_again) = (clock::no_turn_after(now), clock::no_turn_again_after(now));
        let ahead = ahead.bind(late).bind(late_again);
        if ahead.fetch_optional(&mut self.database.reader().await?).await?.is_none() {
            return Ok(());
        }
        let advance = query(
            "UPDATE jobs SET order_at = $3 WHERE id IN (SELECT id FROM jobs
                WHERE state = 'queued' AND order_at > $1 AND (again = 0 OR order_at > $2)
                ORDER BY id FOR UPDATE SKIP LOCKED)",
        );
        self.database.execute(advance.bind(late).bind(late_again).bind(now.as_millisecond())).await.map(drop)
    }
}

/// Requeues a job whose rows this version cannot read, after a pause: a process of a later version may read them, and other
/// jobs have their turns. `row` is that of its claim.
pub(super) async fn set_aside(
    transaction: &mut Transaction,
    row: &Row,
    now: Timestamp,
) -> Result<(), StorageError> {
    let (id, retries, retry) = (row.id("id")?, RetryState::from_row(row)?, RetryPolicy::default());
    let requeued = requeue_after_fault(transaction, id, retries, Fault::Storage, &retry, now).await;
    despite_its_clip(transaction, id, requeued, now).await
}

/// Returns the result of requeueing a job. If the job is changed, and its clip could not be read, the clip waits or fails with
/// the job: otherwise it would be the next one each time, and others would wait.
async fn despite_its_clip(
    transaction: &mut Transaction,
    job: Uuid,
    requeued: Result<(), StorageError>,
    now: Timestamp,
) -> Result<(), StorageError> {
    if !matches!(requeued, Err(StorageError::Column { .. })) {
        return requeued;
    }
    let clip = query(concat!(
        "UPDATE clips SET state = (SELECT CASE state WHEN 'failed' THEN 'failed' ELSE 'queued' END FROM jobs
            WHERE jobs.id = $1), ",
        clock::change_at!("$2"),
        " WHERE job_id = $1"
    ));
    clip.bind(job.to_string()).bind(now.as_millisecond()).execute(transaction).await?;
    Ok(())
}

/// Requeues a job after a fault, with the pause of `retry`.
pub(super) async fn requeue_after_fault(
    transaction: &mut Transaction,
    id: Uuid,
    retries: RetryState,
    fault: Fault,
    retry: &RetryPolicy,
    now: Timestamp,
) -> Result<(), StorageError> {
    let pause = retry.delay(retries.faults.saturating_add(1));
    requeue_or_fail(transaction, id, retries, fault, retry, pause, now).await
}

/// Requeues a job after a fault; fails it if the faults have lasted too long.
async fn requeue_or_fail(
    transaction: &mut Transaction,
    id: Uuid,
    retries: RetryState,
    fault: Fault,
    retry: &RetryPolicy,
    pause: Duration,
    now: Timestamp,
) -> Result<(), StorageError> {
    let retries = retries.with_fault(now);
    if retry.is_over(retries.faults, retries.first_fault_at.unwrap_or(now), now) {
        return fail(transaction, id, fault.lasting(retry), now).await;
    }
    requeue(transaction, id, retries, Some(&fault.passing()), now + pause, now).await
}

/// Requeues a job, due at `run_after`.
pub(super) async fn requeue(
    transaction: &mut Transaction,
    id: Uuid,
    retries: RetryState,
    error: Option<&Reason>,
    run_after: Timestamp,
    now: Timestamp,
) -> Result<(), StorageError> {
    query(
        "UPDATE jobs SET state = 'queued', attempts = $2, faults = $3, first_fault_at = $4, error = $5,
            run_after = $6, stage = NULL, early_pose = NULL, progress = 0, lease_until = NULL, version = version + 1, updated_at = $7
        WHERE id = $1",
    )
    .bind(id.to_string())
    .bind(i64::from(retries.attempts))
    .bind(i64::from(retries.faults))
    .bind(retries.first_fault_at.map(Timestamp::as_millisecond))
    .bind(error.map(to_json))
    .bind(run_after.as_millisecond())
    .bind(now.as_millisecond())
    .execute(transaction)
    .await?;
    let reasons: Vec<Reason> = error.into_iter().cloned().collect();
    change_clip(transaction, id, ClipState::Queued, &reasons, now).await
}
