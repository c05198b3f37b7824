//! Records of jobs: their state and result. Their order is in `turns`, the claims of workers are in `leases`.

mod turns;

pub(super) use turns::Priority;

use super::columns::to_json;
use super::database::{Connection, Row, Transaction, listed, query};
use super::{ClipState, HomeId, Storage, StorageError, clips, clock};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::time::Duration;
use turns::{TURN, Turn, Turns};
use uuid::Uuid;
use viola_geometry::progress::{EarlyPose, Stage};
use viola_reconstruct::Reason;

/// Attempts before a job fails. An attempt that a fault of the service ended does not count.
const MAX_ATTEMPTS: i64 = 3;

/// State of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    Queued,
    Running,
    /// The method gave an answer, which may be that the clip cannot be aligned.
    Succeeded,
    /// There is no answer; `error` says why.
    Failed,
    /// A person or a newer job of the clip ended it; `error` says which.
    Cancelled,
}

impl JobState {
    pub const ALL: [JobState; 5] =
        [JobState::Queued, JobState::Running, JobState::Succeeded, JobState::Failed, JobState::Cancelled];

    pub fn name(self) -> &'static str {
        match self {
            JobState::Queued => "queued",
            JobState::Running => "running",
            JobState::Succeeded => "succeeded",
            JobState::Failed => "failed",
            JobState::Cancelled => "cancelled",
        }
    }

    pub fn is_final(self) -> bool {
        !matches!(self, JobState::Queued | JobState::Running)
    }
}

/// The alignment of one clip to the LiDAR maps of its home.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    pub id: Uuid,
    pub home: HomeId,
    pub clip: Uuid,
    /// The newest revision of the home's LiDAR maps when the job was queued.
    pub lidar_map_revision: i64,
    pub state: JobState,
    /// Stage of the method, while the job runs.
    pub stage: Option<Stage>,
    /// Progress of the whole job, 0..1.
    pub progress: f64,
    /// Pose before the labels of pictures, while the job runs.
    pub early_pose: Option<EarlyPose>,
    /// Attempts so far, with the current one; one that a fault of the service ended does not count.
    pub attempts: u32,
    pub max_attempts: u32,
    /// Reason why the last attempt, or the job, failed, or why the job was cancelled.
    pub error: Option<Reason>,
    /// Grows with every change.
    pub version: i64,
    pub created_at: Timestamp,
    pub updated_at: Timestamp,
    pub started_at: Option<Timestamp>,
    pub finished_at: Option<Timestamp>,
}

pub(super) fn from_row(row: &Row) -> Result<Job, StorageError> {
    Ok(Job {
        id: row.id("id")?,
        home: row.home("home_id")?,
        clip: row.id("clip_id")?,
        lidar_map_revision: row.number("lidar_map_revision")?,
        state: row.name("state")?,
        stage: row.maybe_name("stage")?,
        progress: row.real("progress")?,
        early_pose: row.maybe_json("early_pose")?,
        attempts: row.count("attempts")?,
        max_attempts: row.count("max_attempts")?,
        error: row.maybe_json("error")?,
        version: row.number("version")?,
        created_at: row.time("created_at")?,
        updated_at: row.time("updated_at")?,
        started_at: row.maybe_time("started_at")?,
        finished_at: row.maybe_time("finished_at")?,
    })
}

/// Load of the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueState {
    /// Jobs that wait, with those that pause.
    pub queued: u64,
    /// Queued jobs that are due later, after a fault or a failed attempt.
    pub paused: u64,
    pub running: u64,
    /// Waiting time of the job that has been due longest; zero if none is due. Pauses do not count.
    pub age: Duration,
    /// Homes whose map is due for a merge.
    pub merges_due: u64,
}

/// Selects the load of the queue, in one read of it: probes of all processes ask for it, and it may have millions of jobs.
pub(super) const QUEUE_STATE: &str = "SELECT COUNT(*) AS queued,
        COUNT(CASE WHEN run_after > $1 AND run_after <= $2 THEN 1 END) AS paused,
        MIN(CASE WHEN run_after <= $1 THEN run_after END) AS due_since,
        (SELECT COUNT(*) FROM jobs WHERE state = 'running') AS running,
        (SELECT COUNT(*) FROM homes WHERE map_made < map_wanted) AS merges_due
    FROM jobs WHERE state = 'queued'";

impl Storage {
    /// Returns the load of the queue.
    pub async fn queue_state(&self, now: Timestamp) -> Result<QueueState, StorageError> {
        let row = query(QUEUE_STATE).bind(now.as_millisecond()).bind(clock::no_pause_after(now));
        let row = row.fetch_one(&mut self.database.reader().await?).await?;
        let due_since = row.maybe_time("due_since")?;
        Ok(QueueState {
            queued: row.count("queued")?,
            paused: row.count("paused")?,
            running: row.count("running")?,
            age: due_since.map_or(Duration::ZERO, |since| now.duration_since(since).unsigned_abs()),
            merges_due: row.count("merges_due")?,
        })
    }

    /// Returns the home of a job; `None` if there is no such job.
    pub async fn job_home(&self, id: Uuid) -> Result<Option<HomeId>, StorageError> {
        let row =
            query("SELECT clips.home_id FROM jobs JOIN clips ON clips.id = jobs.clip_id WHERE jobs.id = $1");
        let row = row.bind(id.to_string()).fetch_optional(&mut self.database.reader().await?).await?;
        row.map(|row| row.home("home_id")).transpose()
    }

    /// Returns a job; `None` if it does not exist or was removed.
    pub async fn job(&self, id: Uuid) -> Result<Option<Job>, StorageError> {
        find(&mut self.database.reader().await?, id).await
    }

    /// Returns the versions of those jobs that are there.
    pub async fn job_versions(&self, ids: &[Uuid]) -> Result<HashMap<Uuid, i64>, StorageError> {
        let rows = query(concat!("SELECT id, version FROM jobs WHERE id IN ", listed!("$1")));
        let rows = rows.bind(to_json(&ids)).fetch_all(&mut self.database.reader().await?).await?;
        rows.iter().map(|row| Ok((row.id("id")?, row.number("version")?))).collect()
    }
}

/// Selects jobs with their home and LiDAR map revision; takes the rest of the statement in pieces.
macro_rules! select_jobs {
    ($($rest:expr),+) => {
        concat!(
            "SELECT jobs.*, clips.home_id AS home_id, lidar_maps.revision AS lidar_map_revision
            FROM jobs JOIN clips ON clips.id = jobs.clip_id JOIN lidar_maps ON lidar_maps.id = jobs.lidar_map_id
            ",
            $($rest),+
        )
    };
}
pub(super) use select_jobs;

pub(super) async fn find(connection: &mut Connection, id: Uuid) -> Result<Option<Job>, StorageError> {
    let row = query(select_jobs!("WHERE jobs.id = $1")).bind(id.to_string());
    row.fetch_optional(connection).await?.as_ref().map(from_row).transpose()
}

/// Returns the jobs of rows of [`select_jobs`].
pub(super) fn by_id(rows: &[Row]) -> Result<HashMap<Uuid, Job>, StorageError> {
    rows.iter().map(|row| Ok((row.id("id")?, from_row(row)?))).collect()
}

/// Ended jobs of a clip that are kept.
const KEPT: i64 = 10;

/// Queues the alignment of a clip to a map and cancels the clip's earlier jobs. Returns the blobs that the
/// clip no longer refers to.
pub(super) async fn enqueue(
    transaction: &mut Transaction,
    home: &HomeId,
    clip: Uuid,
    lidar_map: Uuid,
    priority: Priority,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    end_earlier(transaction, clip, now).await?;
    let turn = Turns::of(transaction, home, priority, 1).await?.turn(0);
    let new = NewJob { clip, lidar_map, turn, priority };
    insert(transaction, home, new, now).await
}

/// Cancels the jobs of a clip, and removes the oldest ended ones.
async fn end_earlier(transaction: &mut Transaction, clip: Uuid, now: Timestamp) -> Result<(), StorageError> {
    let reason = Reason::new("superseded", "a newer job of the clip replaced this one");
    query(
        "UPDATE jobs SET state = 'cancelled', error = $3, lease_until = NULL, stage = NULL, early_pose = NULL,
            version = version + 1, updated_at = $2, finished_at = $2
        WHERE clip_id = $1 AND state IN ('queued', 'running')",
    )
    .bind(clip.to_string())
    .bind(now.as_millisecond())
    .bind(to_json(&reason))
    .execute(transaction)
    .await?;
    // A robot's map may change every day, and queues all clips again.
    query(
        "DELETE FROM jobs WHERE clip_id = $1 AND state NOT IN ('queued', 'running')
            AND id NOT IN (SELECT id FROM jobs WHERE clip_id = $1 ORDER BY id DESC LIMIT $2)",
    )
    .bind(clip.to_string())
    .bind(KEPT)
    .execute(transaction)
    .await?;
    Ok(())
}

struct NewJob {
    clip: Uuid,
    lidar_map: Uuid,
    turn: Turn,
    priority: Priority,
}

/// Inserts a job and makes it the newest of its clip. Returns the blobs that the clip no longer refers to.
async fn insert(
    transaction: &mut Transaction,
    home: &HomeId,
    new: NewJob,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let id = Uuid::now_v7();
    let order_at = now + TURN * new.turn.of_tenant - new.priority.lead();
    query(
        "INSERT INTO jobs (id, clip_id, lidar_map_id, state, progress, attempts, max_attempts, run_after, fence,
            version, created_at, updated_at, tenant, position, order_at, again)
        VALUES ($1, $2, $3, $4, 0, 0, $5, $6, 0, 1, $6, $6, $7, $8, $9, $10)",
    )
    .bind(id.to_string())
    .bind(new.clip.to_string())
    .bind(new.lidar_map.to_string())
    .bind(JobState::Queued.name())
    .bind(MAX_ATTEMPTS)
    .bind(now.as_millisecond())
    .bind(home.tenant())
    .bind(i64::from(new.turn.in_home))
    .bind(order_at.as_millisecond())
    .bind(i64::from(new.priority == Priority::Again))
    .execute(transaction)
    .await?;
    clips::begin_job(transaction, new.clip, id, now).await
}

/// Locks a clip's jobs until the transaction ends. A change of a clip locks the jobs first, as workers do, which prevents
/// deadlocks.
pub(super) async fn lock_of_clip(transaction: &mut Transaction, clip: Uuid) -> Result<(), StorageError> {
    let lock = query("SELECT id FROM jobs WHERE clip_id = $1 ORDER BY id FOR UPDATE");
    lock.bind(clip.to_string()).fetch_all(transaction).await?;
    Ok(())
}

/// [`lock_of_clip`] for every clip of a home.
pub(super) async fn lock_of_home(transaction: &mut Transaction, home: &HomeId) -> Result<(), StorageError> {
    let lock = query(
        "SELECT id FROM jobs WHERE clip_id IN (SELECT id FROM clips WHERE home_id = $1) ORDER BY id FOR UPDATE",
    );
    lock.bind(home.key()).fetch_all(transaction).await?;
    Ok(())
}

/// [`enqueue`] for every clip of a home, in the order of their ids. Clips without an answer come first.
pub(super) async fn enqueue_home(
    transaction: &mut Transaction,
    home: &HomeId,
    lidar_map: Uuid,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let rows = query(
        "SELECT id, state, result_key, last_result_key, \
            (SELECT again FROM jobs WHERE jobs.id = clips.job_id) AS again \
         FROM clips WHERE home_id = $1 ORDER BY id",
    )
    .bind(home.key())
    .fetch_all(transaction)
    .await?;
    let (mut without_answer, mut answered) = (Vec::new(), Vec::new());
    for row in &rows {
        let id: Uuid = row.id("id")?;
        end_earlier(transaction, id, now).await?;
        let has_result =
            row.maybe_text("result_key")?.is_some() || row.maybe_text("last_result_key")?.is_some();
        // A file that no job could use is the clip's answer, too, and one
        // that already waits to be aligned again stays so.
        let failed = row.text("state")? == ClipState::Failed.name();
        if has_result || failed || row.maybe_number("again")? == Some(1) {
            answered.push(id);
        } else {
            without_answer.push(id);
        }
    }
    let mut stale_blobs = Vec::new();
    for (ids, priority) in [(without_answer, Priority::Uploaded), (answered, Priority::Again)] {
        let turns = Turns::of(transaction, home, priority, ids.len()).await?;
        for (earlier, clip) in ids.into_iter().enumerate() {
            let new = NewJob { clip, lidar_map, turn: turns.turn(earlier), priority };
            stale_blobs.extend(insert(transaction, home, new, now).await?);
        }
    }
    Ok(stale_blobs)
}

/// Gives the queued jobs that align the clips of a home again the turns of new clips: a person waits for the next map of the home.
pub(super) async fn advance_home(transaction: &mut Transaction, home: &HomeId) -> Result<(), StorageError> {
    let delay_ms = -1000 * Priority::Again.lead().as_secs();
    query(
        "UPDATE jobs SET order_at = order_at - $2
        WHERE state = 'queued' AND again = 1 AND order_at >= created_at + $2
            AND clip_id IN (SELECT id FROM clips WHERE home_id = $1)",
    )
    .bind(home.key())
    .bind(delay_ms)
    .execute(transaction)
    .await?;
    Ok(())
}
