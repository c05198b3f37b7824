//! Leases of jobs. A claim gives a worker the job until its lease expires; a heartbeat renews the lease.
//! Every claim increments the job's fencing token (column `fence`), and a write counts only if the token is still the
//! claim's own, so a worker that was thought dead and comes back changes nothing.

mod again;
mod retry;

pub use retry::{Fault, RetryPolicy};

use super::clips::{self, Outcome};
use super::clock;
use super::columns::to_json;
use super::database::{Connection, Row, Transaction, query};
use super::{
    ClipState, Job, JobState, LidarMapRevision, Storage, StorageError, homes, jobs, lidar_maps,
    pending_deletes,
};
use again::{RetryState, requeue, requeue_after_fault, set_aside};
use jiff::Timestamp;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use uuid::Uuid;
use viola_align::Alignment;
use viola_geometry::progress::{EarlyPose, Stage};
use viola_reconstruct::Reason;

/// A job that this worker holds.
#[derive(Debug, Clone)]
pub struct Claim {
    pub job: Job,
    /// The current LiDAR map of each level, by the levels' names.
    pub lidar_maps: Vec<LidarMapRevision>,
    fencing_token: i64,
    /// Size of the files that this attempt has stored.
    result_bytes: Arc<AtomicU64>,
}

impl Claim {
    /// Returns whether this is the first claim of the job.
    pub fn is_first(&self) -> bool {
        self.fencing_token == 1
    }

    /// Returns the key prefix of this attempt's files.
    fn result_key(&self) -> String {
        clips::result_key(self.job.clip, self.job.id, self.fencing_token)
    }
}

/// Progress of a running job.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JobProgress {
    pub stage: Option<Stage>,
    /// Progress of the whole job, 0..1. It never decreases, though stages may repeat.
    pub progress: f64,
    pub early_pose: Option<EarlyPose>,
}

impl JobProgress {
    /// Records that a stage has come so far.
    pub fn record(&mut self, stage: Stage, fraction: f64) {
        let progress = self.progress.max(stage.overall(fraction));
        *self = JobProgress { stage: Some(stage), progress, ..*self };
    }
}

/// End of an attempt.
#[derive(Debug)]
pub enum AttemptEnd {
    /// The method gave an answer; its files have been put under the claim's result key.
    Answered(Box<Alignment>),
    /// The clip or the map cannot be used; another attempt would end the same way.
    Refused(Reason),
    /// The method failed on this clip. The attempt counts; a retry may succeed.
    Broken(Reason),
    /// The service had a fault that is not the clip's. The attempt does not count.
    Fault(Fault),
    /// The worker stops and gives the job back for an immediate retry.
    GivenUp,
}

/// Takes the next due job.
macro_rules! claim {
    ($($skip:literal)?) => {
        concat!(
            "UPDATE jobs SET state = 'running', attempts = attempts + 1, fence = fence + 1, lease_until = $2,
                stage = NULL, early_pose = NULL, progress = 0, version = version + 1, updated_at = $1,
                started_at = COALESCE(started_at, $1)
            WHERE id =
                (SELECT id FROM jobs WHERE state = 'queued' AND (run_after <= $1 OR run_after > $3)
                ORDER BY order_at, id LIMIT 1 FOR UPDATE",
            $($skip,)?
            ")
            RETURNING id, fence, attempts, max_attempts, faults, first_fault_at"
        )
    };
}

impl Storage {
    /// Claims a due job for a worker; returns `None` if there is none. Jobs of lost workers are due after
    /// [`Storage::release_lost`]. A job whose rows cannot be read is an error, and rests.
    pub async fn claim(&self, lease: Duration, now: Timestamp) -> Result<Option<Claim>, StorageError> {
        self.require_store().await?;
        let mut transaction = self.database.begin().await?;
        // Jobs that another worker is taking are skipped, so that workers do not wait for each other. If no other one is due,
        // the lock may be that of a change of the clip, and the job would wait for the next poll.
        let mut row = None;
        for statement in [claim!(" SKIP LOCKED"), claim!()] {
            row = query(statement)
                .bind(now.as_millisecond())
                .bind((now + lease).as_millisecond())
                .bind(clock::no_pause_after(now))
                .fetch_optional(&mut transaction)
                .await?;
            if row.is_some() || !transaction.is_shared() {
                break;
            }
        }
        let Some(row) = row else { return Ok(None) };
        let id = row.id("id")?;
        let claimed = claimed(&mut transaction, id, &row, now).await;
        if let Err(unreadable @ StorageError::Column { .. }) = &claimed {
            tracing::error!(job = %id, %unreadable, "a job rests: its rows cannot be read");
            // Otherwise it would be the next one at every claim.
            set_aside(&mut transaction, &row, now).await?;
        } else if claimed.is_err() {
            return claimed.map(Some);
        }
        transaction.commit().await?;
        claimed.map(Some)
    }

    /// Renews a lease and records the progress; returns false if the job is no longer this worker's.
    pub async fn heartbeat(
        &self,
        claim: &Claim,
        progress: &JobProgress,
        lease: Duration,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let renew = query(
            "UPDATE jobs SET lease_until = $3, stage = $4, progress = $5, early_pose = $6, version = version + 1,
                updated_at = $7
            WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(claim.job.id.to_string())
        .bind(claim.fencing_token)
        .bind((now + lease).as_millisecond())
        .bind(progress.stage.map(Stage::name))
        .bind(progress.progress)
        .bind(progress.early_pose.as_ref().map(to_json))
        .bind(now.as_millisecond());
        Ok(self.database.execute(renew).await? == 1)
    }

    /// Returns whether the job is still this worker's.
    pub async fn holds(&self, claim: &Claim) -> Result<bool, StorageError> {
        let row = query("SELECT id FROM jobs WHERE id = $1 AND fence = $2 AND state = 'running'")
            .bind(claim.job.id.to_string())
            .bind(claim.fencing_token);
        Ok(row.fetch_optional(&mut self.database.reader().await?).await?.is_some())
    }

    /// Stores a file of this attempt's result.
    pub async fn put_result(&self, claim: &Claim, name: &str, bytes: Vec<u8>) -> Result<(), StorageError> {
        let size_bytes = bytes.len() as u64;
        self.blobs.put(&format!("{}/{name}", claim.result_key()), bytes).await?;
        claim.result_bytes.fetch_add(size_bytes, Ordering::Relaxed);
        Ok(())
    }

    /// Ends an attempt: the job, its clip and the answer change in one transaction. Returns false if the job
    /// is no longer this worker's; then nothing changes and the attempt's files are removed.
    pub async fn finish(
        &self,
        claim: &Claim,
        ending: &AttemptEnd,
        retry: &RetryPolicy,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let mut transaction = self.database.begin().await?;
        homes::lock(&mut transaction, &claim.job.home).await?;
        let stale_blobs = end_attempt(&mut transaction, claim, ending, retry, now).await?;
        let held = stale_blobs.is_some();
        let (owner, stale_blobs) =
            (clips::owner(&claim.job.home, claim.job.clip), stale_blobs.unwrap_or_default());
        pending_deletes::add(&mut transaction, &owner, &stale_blobs, now).await?;
        transaction.commit().await?;
        self.discard_pending(&owner, &stale_blobs).await;
        // The end is recorded, whatever becomes of files that nobody refers to.
        if let Err(error) = self.discard_unless_kept(&claim.result_key()).await {
            tracing::warn!(job = %claim.job.id, %error, "files of an attempt may be left; a sweep removes them");
        }
        Ok(held)
    }

    /// Removes the files of an attempt unless a clip refers to them.
    pub(super) async fn discard_unless_kept(&self, result_key: &str) -> Result<(), StorageError> {
        let kept =
            query("SELECT id FROM clips WHERE result_key = $1 OR last_result_key = $1").bind(result_key);
        if kept.fetch_optional(&mut self.database.reader().await?).await?.is_none() {
            self.blobs.discard(&clips::result_blobs(result_key)).await;
        }
        Ok(())
    }

    /// Cancels a queued or running job; its clip becomes `uploaded`. A job that has ended stays as it is.
    pub async fn cancel_job(&self, id: Uuid, now: Timestamp) -> Result<Option<Job>, StorageError> {
        let mut transaction = self.database.begin().await?;
        let Some(job) = jobs::find(&mut transaction, id).await? else { return Ok(None) };
        // No job of the home ends meanwhile.
        homes::lock(&mut transaction, &job.home).await?;
        let Some(job) = jobs::find(&mut transaction, id).await? else { return Ok(None) };
        if !job.state.is_final() {
            let reason = Reason::new("cancelled", "the job was cancelled; align the clip to queue it again");
            close(&mut transaction, id, JobState::Cancelled, Some(&reason), now).await?;
            change_clip(&mut transaction, id, ClipState::Uploaded, &[reason], now).await?;
        }
        let job = jobs::find(&mut transaction, id).await?;
        transaction.commit().await?;
        Ok(job)
    }
}

/// Returns the claim on a job that was just taken.
async fn claimed(
    transaction: &mut Transaction,
    id: Uuid,
    row: &Row,
    now: Timestamp,
) -> Result<Claim, StorageError> {
    change_clip(transaction, id, ClipState::Aligning, &[], now).await?;
    let job = jobs::find(transaction, id).await?.ok_or(StorageError::NoSuchClip)?;
    Ok(Claim {
        lidar_maps: lidar_maps::levels(transaction, &job.home).await?,
        job,
        fencing_token: row.number("fence")?,
        result_bytes: Arc::default(),
    })
}

/// Returns the blobs that the clip no longer refers to; `None` if the job is no longer the worker's.
async fn end_attempt(
    transaction: &mut Transaction,
    claim: &Claim,
    ending: &AttemptEnd,
    retry: &RetryPolicy,
    now: Timestamp,
) -> Result<Option<Vec<String>>, StorageError> {
    let id = claim.job.id;
    let row = query(
        "UPDATE jobs SET version = version + 1 WHERE id = $1 AND fence = $2 AND state = 'running'
        RETURNING attempts, max_attempts, faults, first_fault_at",
    )
    .bind(id.to_string())
    .bind(claim.fencing_token)
    .fetch_optional(transaction)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let retries = RetryState::from_row(&row)?;
    let mut stale_blobs = Vec::new();
    match ending {
        AttemptEnd::Answered(alignment) => {
            close(transaction, id, JobState::Succeeded, None, now).await?;
            let result_key = claim.result_key();
            let answer = Outcome {
                state: alignment.state.into(),
                reasons: &alignment.reasons,
                alignment: Some(alignment),
                result: Some((&result_key, claim.result_bytes.load(Ordering::Relaxed))),
            };
            stale_blobs = clips::change(transaction, id, answer, now).await?;
        }
        AttemptEnd::Refused(reason) => fail(transaction, id, reason.clone(), now).await?,
        AttemptEnd::Broken(reason) if retries.attempts >= retries.max_attempts => {
            fail(transaction, id, reason.clone(), now).await?;
        }
        AttemptEnd::Broken(reason) => {
            let run_after = now + retry.delay(retries.attempts);
            let retries = retries.with_counted_attempt();
            requeue(transaction, id, retries, Some(reason), run_after, now).await?;
        }
        AttemptEnd::Fault(fault) => requeue_after_fault(transaction, id, retries, *fault, retry, now).await?,
        // The worker gave up, not because of the clip: the attempt does not count.
        AttemptEnd::GivenUp => {
            requeue(transaction, id, retries.without_attempt(), None, now, now).await?;
        }
    }
    Ok(Some(stale_blobs))
}

async fn fail(
    transaction: &mut Transaction,
    id: Uuid,
    reason: Reason,
    now: Timestamp,
) -> Result<(), StorageError> {
    close(transaction, id, JobState::Failed, Some(&reason), now).await?;
    change_clip(transaction, id, ClipState::Failed, &[reason], now).await
}

/// Brings a job to a final state.
async fn close(
    transaction: &mut Transaction,
    id: Uuid,
    state: JobState,
    error: Option<&Reason>,
    now: Timestamp,
) -> Result<(), StorageError> {
    query(
        "UPDATE jobs SET state = $2, error = $3, stage = NULL, early_pose = NULL, lease_until = NULL, version = version + 1,
            progress = CASE WHEN $2 = 'succeeded' THEN 1 ELSE progress END, updated_at = $4, finished_at = $4
        WHERE id = $1",
    )
    .bind(id.to_string())
    .bind(state.name())
    .bind(error.map(to_json))
    .bind(now.as_millisecond())
    .execute(transaction)
    .await?;
    Ok(())
}

/// Sets the clip of a job to a state without an answer. It keeps its last answer.
async fn change_clip(
    connection: &mut Connection,
    job: Uuid,
    state: ClipState,
    reasons: &[Reason],
    now: Timestamp,
) -> Result<(), StorageError> {
    let outcome = Outcome { state, reasons, alignment: None, result: None };
    clips::change(connection, job, outcome, now).await?;
    Ok(())
}
