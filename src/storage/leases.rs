//! Who works on a job. A claim gives a worker the job for as long as its lease lasts; a heartbeat renews
//! it. Every claim raises the job's fence, and a write counts only while the fence is the claim's own, so a
//! worker that was thought dead and comes back changes nothing.

use super::clips::{self, Outcome};
use super::columns::{Columns, to_json};
use super::database::{Connection, Transaction, query};
use super::{ClipState, Job, JobState, Storage, StorageError, homes, jobs};
use crate::align::{Alignment, Reason};
use crate::progress::Stage;
use jiff::Timestamp;
use std::time::Duration;
use uuid::Uuid;

/// A job that this worker holds.
#[derive(Debug, Clone)]
pub struct Claim {
    pub job: Job,
    pub lidar_map_id: Uuid,
    fence: i64,
}

impl Claim {
    /// Where this attempt's pictures and clouds are kept.
    fn result_key(&self) -> String {
        clips::result_key(self.job.clip, self.job.id, self.fence)
    }
}

/// How an attempt ended.
#[derive(Debug)]
pub enum Ending {
    /// The method gave an answer; its files have been put under the claim's result key.
    Answered(Box<Alignment>),
    /// The clip or the map cannot be used; another attempt would end alike.
    Refused(Reason),
    /// Something of ours broke; another attempt may go better.
    Broken(Reason),
    /// The worker stops and gives the job back, to be tried again at once.
    GivenUp,
}

/// How long a failed attempt waits for the next.
#[derive(Debug, Clone)]
pub struct RetryPolicy {
    /// After the first failed attempt; doubles with every further one.
    pub first_delay: Duration,
}

impl Default for RetryPolicy {
    fn default() -> RetryPolicy {
        RetryPolicy { first_delay: Duration::from_secs(5) }
    }
}

impl RetryPolicy {
    fn delay(&self, attempts: u32) -> Duration {
        self.first_delay.saturating_mul(1 << attempts.saturating_sub(1).min(6))
    }
}

/// Takes a job whose worker's lease ran out, else the one whose turn it is. Those that another worker is taking at this
/// moment are passed over, so that workers do not wait for each other.
macro_rules! claim {
    ($lock:literal) => {
        concat!(
            "UPDATE jobs SET state = 'running', attempts = attempts + 1, fence = fence + 1, lease_until = $2,
                stage = NULL, progress = 0, version = version + 1, updated_at = $1,
                started_at = COALESCE(started_at, $1)
            WHERE id = COALESCE(
                (SELECT id FROM jobs WHERE state = 'running' AND lease_until <= $1 AND attempts < max_attempts
                    ORDER BY lease_until LIMIT 1 ",
            $lock,
            "),
                (SELECT id FROM jobs WHERE state = 'queued' AND run_after <= $1 ORDER BY order_at, id LIMIT 1 ",
            $lock,
            "))
            RETURNING id, lidar_map_id, fence"
        )
    };
}

impl Storage {
    /// Gives a job that is due to a worker, none when there is none.
    pub async fn claim(&self, lease: Duration, now: Timestamp) -> Result<Option<Claim>, StorageError> {
        let mut transaction = self.database.begin().await?;
        let statement = transaction.either(claim!(""), claim!("FOR UPDATE SKIP LOCKED"));
        let row = query(statement)
            .bind(now.as_millisecond())
            .bind((now + lease).as_millisecond())
            .fetch_optional(&mut transaction)
            .await?;
        let Some(row) = row else {
            drop(transaction);
            self.bury_the_hopeless(now).await?;
            return Ok(None);
        };
        let id = row.id("id")?;
        change_clip(&mut transaction, id, ClipState::Aligning, &[], now).await?;
        let job = jobs::find(&mut transaction, id).await?.ok_or(StorageError::NoSuchClip)?;
        let claim = Claim { job, lidar_map_id: row.id("lidar_map_id")?, fence: row.number("fence")? };
        transaction.commit().await?;
        Ok(Some(claim))
    }

    /// Renews a lease and records the progress; false when the job is no longer this worker's.
    pub async fn heartbeat(
        &self,
        claim: &Claim,
        stage: Option<Stage>,
        progress: f64,
        lease: Duration,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let mut transaction = self.database.begin().await?;
        let updated = query(
            "UPDATE jobs SET lease_until = $3, stage = $4, progress = $5, version = version + 1, updated_at = $6
            WHERE id = $1 AND fence = $2 AND state = 'running'",
        )
        .bind(claim.job.id.to_string())
        .bind(claim.fence)
        .bind((now + lease).as_millisecond())
        .bind(stage.map(Stage::name))
        .bind(progress)
        .bind(now.as_millisecond())
        .execute(&mut transaction)
        .await?;
        transaction.commit().await?;
        Ok(updated == 1)
    }

    /// Whether the job is still this worker's.
    pub async fn holds(&self, claim: &Claim) -> Result<bool, StorageError> {
        let row = query("SELECT id FROM jobs WHERE id = $1 AND fence = $2 AND state = 'running'")
            .bind(claim.job.id.to_string())
            .bind(claim.fence);
        Ok(row.fetch_optional(&mut self.database.reader().await?).await?.is_some())
    }

    /// Keeps a file of this attempt's result.
    pub async fn put_result(&self, claim: &Claim, name: &str, bytes: Vec<u8>) -> Result<(), StorageError> {
        self.blobs.put(&format!("{}/{name}", claim.result_key()), bytes).await
    }

    /// Ends an attempt: the job, its clip and the answer change in one transaction. False when the job is no
    /// longer this worker's; then nothing changes and the attempt's files are removed.
    pub async fn finish(
        &self,
        claim: &Claim,
        ending: &Ending,
        retry: &RetryPolicy,
        now: Timestamp,
    ) -> Result<bool, StorageError> {
        let mut transaction = self.database.begin().await?;
        homes::lock(&mut transaction, &claim.job.home).await?;
        let held = end(&mut transaction, claim, ending, retry, now).await?;
        transaction.commit().await?;
        self.discard_unless_kept(&claim.result_key()).await?;
        Ok(held)
    }

    /// Removes the files of an attempt that came to nothing.
    async fn discard_unless_kept(&self, result_key: &str) -> Result<(), StorageError> {
        let kept = query("SELECT id FROM clips WHERE result_key = $1").bind(result_key);
        if kept.fetch_optional(&mut self.database.reader().await?).await?.is_none() {
            self.blobs.discard(&clips::result_blobs(result_key)).await;
        }
        Ok(())
    }

    /// Ends a job that waits or runs; its clip is as if never queued. A job that has ended stays as it is.
    pub async fn cancel_job(&self, id: Uuid, now: Timestamp) -> Result<Option<Job>, StorageError> {
        let mut transaction = self.database.begin().await?;
        let Some(job) = jobs::find(&mut transaction, id).await? else { return Ok(None) };
        homes::lock(&mut transaction, &job.home).await?;
        let cancelled = query(
            "UPDATE jobs SET state = 'cancelled', lease_until = NULL, stage = NULL, version = version + 1,
                updated_at = $2, finished_at = $2
            WHERE id = $1 AND state IN ('queued', 'running')",
        )
        .bind(id.to_string())
        .bind(now.as_millisecond())
        .execute(&mut transaction)
        .await?;
        if cancelled == 1 {
            let reason =
                Reason::new("cancelled", "the job was cancelled; align the clip again to queue it anew");
            change_clip(&mut transaction, id, ClipState::Uploaded, &[reason], now).await?;
        }
        let job = jobs::find(&mut transaction, id).await?;
        transaction.commit().await?;
        Ok(job)
    }

    /// Fails the jobs whose last allowed worker died: a job that kills its worker must not run for ever.
    async fn bury_the_hopeless(&self, now: Timestamp) -> Result<(), StorageError> {
        let rows = query(
            "SELECT jobs.id, clips.home_id, jobs.fence FROM jobs JOIN clips ON clips.id = jobs.clip_id
            WHERE jobs.state = 'running' AND jobs.lease_until <= $1 AND jobs.attempts >= jobs.max_attempts",
        );
        let rows = rows.bind(now.as_millisecond()).fetch_all(&mut self.database.reader().await?).await?;
        for row in &rows {
            let mut transaction = self.database.begin().await?;
            homes::lock(&mut transaction, &row.home("home_id")?).await?;
            // Unless somebody did so, or the worker gave a sign of life, since.
            let buried = query(
                "UPDATE jobs SET fence = fence + 1
                WHERE id = $1 AND fence = $2 AND state = 'running' AND lease_until <= $3",
            );
            let buried = buried.bind(row.text("id")?).bind(row.number("fence")?).bind(now.as_millisecond());
            if buried.execute(&mut transaction).await? == 1 {
                let detail = "every worker that tried this clip died; it may need more memory than there is";
                fail(&mut transaction, row.id("id")?, Reason::new("worker_died", detail), now).await?;
            }
            transaction.commit().await?;
        }
        Ok(())
    }
}

async fn end(
    transaction: &mut Transaction,
    claim: &Claim,
    ending: &Ending,
    retry: &RetryPolicy,
    now: Timestamp,
) -> Result<bool, StorageError> {
    let id = claim.job.id;
    let row = query(
        "UPDATE jobs SET version = version + 1 WHERE id = $1 AND fence = $2 AND state = 'running'
        RETURNING attempts, max_attempts",
    )
    .bind(id.to_string())
    .bind(claim.fence)
    .fetch_optional(transaction)
    .await?;
    let Some(row) = row else { return Ok(false) };
    let (attempts, max_attempts): (u32, u32) = (row.count("attempts")?, row.count("max_attempts")?);
    match ending {
        Ending::Answered(alignment) => {
            close(transaction, id, JobState::Succeeded, None, now).await?;
            let result_key = claim.result_key();
            let answer = Outcome {
                state: alignment.state.into(),
                reasons: &alignment.reasons,
                alignment: Some(alignment),
                result_key: Some(&result_key),
            };
            clips::change(transaction, id, answer, now).await?;
        }
        Ending::Refused(reason) => fail(transaction, id, reason.clone(), now).await?,
        Ending::Broken(reason) if attempts >= max_attempts => {
            fail(transaction, id, reason.clone(), now).await?;
        }
        Ending::Broken(reason) => {
            requeue(transaction, id, attempts, Some(reason), now + retry.delay(attempts), now).await?;
        }
        // The attempt was ours to give up, not the clip's fault: it does not count.
        Ending::GivenUp => requeue(transaction, id, attempts.saturating_sub(1), None, now, now).await?,
    }
    Ok(true)
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
        "UPDATE jobs SET state = $2, error = $3, stage = NULL, lease_until = NULL, version = version + 1,
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

async fn requeue(
    transaction: &mut Transaction,
    id: Uuid,
    attempts: u32,
    error: Option<&Reason>,
    run_after: Timestamp,
    now: Timestamp,
) -> Result<(), StorageError> {
    query(
        "UPDATE jobs SET state = 'queued', attempts = $2, error = $3, run_after = $4, stage = NULL, progress = 0,
            lease_until = NULL, version = version + 1, updated_at = $5
        WHERE id = $1",
    )
    .bind(id.to_string())
    .bind(i64::from(attempts))
    .bind(error.map(to_json))
    .bind(run_after.as_millisecond())
    .bind(now.as_millisecond())
    .execute(transaction)
    .await?;
    let reasons: Vec<Reason> = error.into_iter().cloned().collect();
    change_clip(transaction, id, ClipState::Queued, &reasons, now).await
}

/// The clip of a job goes to a state in which it has no answer.
async fn change_clip(
    connection: &mut Connection,
    job: Uuid,
    state: ClipState,
    reasons: &[Reason],
    now: Timestamp,
) -> Result<(), StorageError> {
    clips::change(connection, job, Outcome { state, reasons, alignment: None, result_key: None }, now).await
}
