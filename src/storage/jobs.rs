//! Jobs as records: what is to be done, and what became of it. Who may work on one is in `leases`.

use super::columns::Columns;
use super::database::{Connection, Row, Transaction};
use super::{HomeId, Storage, StorageError, clips};
use crate::align::Reason;
use crate::progress::Stage;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use uuid::Uuid;

/// How often a job is tried before it fails for good. A try whose worker died counts.
const MAX_ATTEMPTS: i64 = 3;

/// Where a job is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    Queued,
    Running,
    /// The method ran to an answer, which may be that the clip cannot be aligned.
    Succeeded,
    /// There is no answer; `error` says why.
    Failed,
    Cancelled,
}

impl JobState {
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

/// The alignment of one clip to one revision of its home's LiDAR map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
pub struct Job {
    #[schema(example = "01a1f766-7abd-71fb-b5b7-3d59df71839d")]
    pub id: Uuid,
    pub home: HomeId,
    pub clip: Uuid,
    pub lidar_map_revision: i64,
    pub state: JobState,
    /// What the method is doing, while the job runs.
    pub stage: Option<Stage>,
    /// Of the whole job, 0..1.
    #[schema(minimum = 0, maximum = 1, example = 0.43)]
    pub progress: f64,
    /// How often a worker has begun.
    #[schema(example = 1)]
    pub attempts: u32,
    #[schema(example = 3)]
    pub max_attempts: u32,
    /// Why the last attempt, or the job, failed.
    pub error: Option<Reason>,
    /// Grows with every change.
    #[schema(example = 5)]
    pub version: i64,
    pub created_at: Timestamp,
    pub updated_at: Timestamp,
    pub started_at: Option<Timestamp>,
    pub finished_at: Option<Timestamp>,
}

fn from_row(row: &Row) -> Result<Job, StorageError> {
    Ok(Job {
        id: row.id("id")?,
        home: row.home("home_id")?,
        clip: row.id("clip_id")?,
        lidar_map_revision: row.number("lidar_map_revision")?,
        state: row.name("state")?,
        stage: row.maybe_name("stage")?,
        progress: row.real("progress")?,
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

impl Storage {
    /// None when there is no such job, or no longer.
    pub async fn job(&self, id: Uuid) -> Result<Option<Job>, StorageError> {
        find(&mut *self.database.snapshot().await?, id).await
    }
}

/// Jobs with what belongs to them; the rest of the statement in pieces.
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
    let row = sqlx::query(select_jobs!("WHERE jobs.id = $1")).bind(id.to_string());
    row.fetch_optional(connection).await?.as_ref().map(from_row).transpose()
}

/// The jobs of rows of [`select_jobs`].
pub(super) fn by_id(rows: &[Row]) -> Result<HashMap<Uuid, Job>, StorageError> {
    rows.iter().map(|row| Ok((row.id("id")?, from_row(row)?))).collect()
}

/// Queues the alignment of a clip to a map in place of whatever was under way for it; gives the blobs that
/// the clip no longer refers to.
pub(super) async fn enqueue(
    transaction: &mut Transaction,
    clip: Uuid,
    lidar_map: Uuid,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    sqlx::query(
        "UPDATE jobs SET state = 'cancelled', lease_until = NULL, stage = NULL, version = version + 1,
            updated_at = $2, finished_at = $2
        WHERE clip_id = $1 AND state IN ('queued', 'running')",
    )
    .bind(clip.to_string())
    .bind(now.as_millisecond())
    .execute(&mut **transaction)
    .await?;
    let id = Uuid::now_v7();
    sqlx::query(
        "INSERT INTO jobs (id, clip_id, lidar_map_id, state, progress, attempts, max_attempts, run_after, fence,
            version, created_at, updated_at)
        VALUES ($1, $2, $3, $4, 0, 0, $5, $6, 0, 1, $6, $6)",
    )
    .bind(id.to_string())
    .bind(clip.to_string())
    .bind(lidar_map.to_string())
    .bind(JobState::Queued.name())
    .bind(MAX_ATTEMPTS)
    .bind(now.as_millisecond())
    .execute(&mut **transaction)
    .await?;
    clips::begin_job(transaction, clip, id, now).await
}

/// [`enqueue`] for every clip of a home.
pub(super) async fn enqueue_home(
    transaction: &mut Transaction,
    home: &HomeId,
    lidar_map: Uuid,
    now: Timestamp,
) -> Result<Vec<String>, StorageError> {
    let rows = sqlx::query("SELECT id FROM clips WHERE home_id = $1 ORDER BY id")
        .bind(home.as_str())
        .fetch_all(&mut **transaction)
        .await?;
    let mut stale_blobs = Vec::new();
    for row in &rows {
        stale_blobs.extend(enqueue(transaction, row.id("id")?, lidar_map, now).await?);
    }
    Ok(stale_blobs)
}
