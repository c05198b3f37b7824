//! Clips.

mod edit;
mod file;
mod insert;
mod last_answer;
mod outcome;
mod remove;

pub use edit::ClipEdit;
pub(super) use insert::{NewRow, insert};
pub use last_answer::LastAnswer;
pub(super) use outcome::{Outcome, begin_job, change};

use super::damage::check_removed;
use super::database::{Connection, Row, Transaction, query};
use super::incoming::Arrived;
use super::jobs::{self, Priority};
use super::quota::QuotaCheck;
use super::{
    BlobReader, Choice, ClipState, HomeId, Job, Placement, Storage, StorageError, homes, lidar_maps,
    pending_deletes, result_file,
};
use jiff::Timestamp;
use uuid::Uuid;
use viola_align::Alignment;
use viola_formats::clip::ClipInfo;
use viola_geometry::Pose2;
use viola_reconstruct::Reason;

/// An uploaded clip.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    pub id: Uuid,
    pub home: HomeId,
    pub state: ClipState,
    /// Why the clip is in its state.
    pub reasons: Vec<Reason>,
    pub size_bytes: u64,
    /// SHA-256 of the file, in lower-case hexadecimal.
    pub sha256: String,
    /// Name of the file, from its sender.
    pub file_name: Option<String>,
    /// Name that a person gave the clip.
    pub title: Option<String>,
    /// The oldest clip of the home with the same file or content, if this is not it.
    pub duplicate_of: Option<Uuid>,
    /// Summary of the file.
    pub info: ClipInfo,
    /// Time of the recording, from the sender or the file; null if neither gives it.
    pub recorded_at: Option<Timestamp>,
    /// The method's own answer from the newest job; null if that job has none. Its pose, level and probability are
    /// those of the placement if the clips around it decided, and the answer is not newer than the placement.
    pub alignment: Option<Alignment>,
    /// The answer of an earlier job, while the newest one has none.
    pub last_answer: Option<LastAnswer>,
    /// The pose that a person chose; it overrides the method's own until it is withdrawn.
    pub choice: Option<Choice>,
    /// Placement in the newest revision of the home's map; null if the clip is not in it.
    pub placement: Option<Placement>,
    /// The newest job of the clip, null before the first one.
    pub job: Option<Job>,
    pub created_at: Timestamp,
    pub updated_at: Timestamp,
    pub(super) result_key: Option<String>,
    pub(super) result_bytes: u64,
}

impl Clip {
    /// Returns the clip's pose from the home's map, else from a person's choice, else from its newest answer, and the height of
    /// its frame's origin above the floor there.
    pub fn pose(&self) -> Option<(Pose2, f64)> {
        let last = self.last_answer.as_ref().map(|last| &last.alignment);
        let answer = self.alignment.as_ref().or(last);
        let placed = self.placement.as_ref().map(|placement| (placement.map_from_clip, placement.rise_m));
        let chosen = self.choice.as_ref().map(|choice| (choice.map_from_clip, choice.rise_m(answer)));
        placed.or(chosen).or_else(|| Some((answer?.map_from_clip?, 0.0)))
    }

    /// Returns the key of the files of the clip's newest answer; every attempt at a job has its own. `None` without an
    /// answer.
    pub fn result_key(&self) -> Option<&str> {
        let last = self.last_answer.as_ref().map(|last| last.result_key.as_str());
        self.result_key.as_deref().or(last)
    }

    /// Returns the bytes of its recording and of the files of its answers.
    fn stored_bytes(&self) -> u64 {
        let last = self.last_answer.as_ref().map_or(0, |last| last.result_bytes);
        self.size_bytes + self.result_bytes + last
    }

    /// Returns the keys of its blobs.
    fn blobs(&self) -> Vec<String> {
        let last = self.last_answer.as_ref().map(|last| last.result_key.as_str());
        blobs_of(self.id, [self.result_key.as_deref(), last])
    }
}

/// A clip whose file was opened and validated.
pub struct NewClip {
    pub file: Arrived,
    pub info: ClipInfo,
    /// SHA-256 of the files in an archive, which other archives of the same files have, too; `None` for a single file.
    pub content_sha256: Option<String>,
    pub idempotency_key: Option<String>,
    pub recorded_at: Option<Timestamp>,
    pub title: Option<String>,
    pub file_name: Option<String>,
}

/// Result of adding a clip.
#[derive(Debug)]
pub enum Added {
    New(Clip),
    /// The idempotency key was used before with the same file, or with another archive of its content; this is the earlier
    /// clip.
    Replayed(Clip),
    /// The idempotency key was used before with another recording.
    KeyReused,
}

/// The columns that [`from_row`] reads.
macro_rules! clip_columns {
    () => {
        concat!("clips.*, ", $crate::copies::duplicate_of!())
    };
}
pub(super) use clip_columns;

pub(super) fn from_row(row: &Row, job: Option<Job>) -> Result<Clip, StorageError> {
    let placement: Option<Placement> = row.maybe_json("placement")?;
    let mut alignment: Option<Alignment> = row.maybe_json("alignment")?;
    let mut last_answer = last_answer::from_row(row)?;
    let result_key = row.maybe_text("result_key")?;
    if let Some(placement) = &placement {
        let own = alignment.as_mut().filter(|_| placement.is_of(result_key.as_deref()));
        let last = last_answer.as_mut().filter(|last| placement.is_of(Some(last.result_key.as_str())));
        let last = last.map(|last| &mut last.alignment);
        own.into_iter().chain(last).for_each(|answer| placement.apply(answer));
    }
    Ok(Clip {
        id: row.id("id")?,
        home: row.home("home_id")?,
        state: row.name("state")?,
        reasons: row.json("reasons")?,
        size_bytes: row.count("size_bytes")?,
        sha256: row.text("sha256")?,
        file_name: row.maybe_text("file_name")?,
        title: row.maybe_text("title")?,
        duplicate_of: row.maybe_id("duplicate_of")?,
        info: row.json("info")?,
        recorded_at: row.maybe_time("recorded_at")?,
        alignment,
        last_answer,
        choice: row.maybe_json("choice")?,
        placement,
        job,
        created_at: row.time("created_at")?,
        updated_at: row.time("updated_at")?,
        result_key,
        result_bytes: row.count("result_bytes")?,
    })
}

/// Returns the name under which the pending deletes of a clip are recorded.
pub(super) fn owner(home: &HomeId, id: Uuid) -> String {
    format!("clip:{}:{id}", home.key())
}

pub(super) fn file_key(id: Uuid) -> String {
    format!("clips/{id}/file")
}

/// Returns the key prefix of the files that a job made. Every attempt has its own, so that a worker that lost
/// its lease cannot overwrite its successor's files.
pub(super) fn result_key(clip: Uuid, job: Uuid, fencing_token: i64) -> String {
    format!("clips/{clip}/results/{job}-{fencing_token}")
}

pub(super) fn result_blobs(result_key: &str) -> [String; result_file::ALL.len()] {
    result_file::ALL.map(|name| format!("{result_key}/{name}"))
}

impl Storage {
    /// Stores a clip, and queues its job if the home has a LiDAR map. `max_bytes` limits the files of a tenant without a
    /// limit of its own; `None` means unlimited.
    pub async fn add_clip(
        &self,
        home: &HomeId,
        new: NewClip,
        max_bytes: Option<u64>,
        now: Timestamp,
    ) -> Result<Added, StorageError> {
        let id = Uuid::now_v7();
        let (file, row) = NewRow::of(id, new);
        self.blobs.keep_or_discard(file, &file_key(id)).await?;
        let added = self.insert_clip(home, row, QuotaCheck::Enforce { max_bytes }, now).await;
        self.discard_unless(&[file_key(id)], &added, |added| matches!(added, Added::New(_))).await;
        added
    }

    async fn insert_clip(
        &self,
        home: &HomeId,
        new: NewRow,
        quota: QuotaCheck,
        now: Timestamp,
    ) -> Result<Added, StorageError> {
        let mut transaction = self.database.begin().await?;
        let added = insert(&mut transaction, home, new, quota, now).await?;
        transaction.commit().await?;
        Ok(added)
    }

    pub async fn clip(&self, home: &HomeId, id: Uuid) -> Result<Clip, StorageError> {
        find(&mut *self.database.snapshot().await?, home, id).await
    }

    /// Queues a clip again for the current LiDAR map, unless its job is already queued or running.
    pub async fn align_clip(&self, home: &HomeId, id: Uuid, now: Timestamp) -> Result<Clip, StorageError> {
        let mut transaction = self.database.begin().await?;
        let clip = find_locked(&mut transaction, home, id).await?;
        if clip.state.is_under_way() {
            return Ok(clip);
        }
        let map = lidar_maps::newest(&mut transaction, home).await?.ok_or(StorageError::NoLidarMap)?;
        let stale_blobs = jobs::enqueue(&mut transaction, home, id, map.id(), Priority::Asked, now).await?;
        let clip = find(&mut transaction, home, id).await?;
        let owner = owner(home, id);
        pending_deletes::add(&mut transaction, &owner, &stale_blobs, now).await?;
        transaction.commit().await?;
        self.discard_pending(&owner, &stale_blobs).await;
        Ok(clip)
    }

    /// Returns a file of the clip's newest answer by its name; `None` if there is none.
    pub async fn clip_result(&self, clip: &Clip, name: &str) -> Result<Option<BlobReader>, StorageError> {
        match clip.result_key() {
            Some(key) => self.blobs.read(&format!("{key}/{name}")).await,
            None => Ok(None),
        }
    }

    /// Returns a file of the clip's newest answer in one piece.
    pub async fn clip_result_bytes(
        &self,
        clip: &Clip,
        name: &str,
    ) -> Result<Option<bytes::Bytes>, StorageError> {
        let Some(key) = clip.result_key() else { return Ok(None) };
        self.blobs.read_if_there(&format!("{key}/{name}")).await
    }

    /// Returns an error if a file that every answer has is missing in the clip's newest answer, and no later job or deletion has
    /// removed it: the store lost it.
    pub async fn check_result_removed(&self, clip: &Clip, name: &str) -> Result<(), StorageError> {
        let Some(key) = clip.result_key().filter(|_| result_file::OF_EVERY_ANSWER.contains(&name)) else {
            return Ok(());
        };
        let row = query("SELECT id FROM clips WHERE id = $1 AND (result_key = $2 OR last_result_key = $2)");
        let row = row.bind(clip.id.to_string()).bind(key);
        let row = row.fetch_optional(&mut self.database.reader().await?).await?;
        check_removed(row.as_ref(), format!("{key}/{name}"))
    }
}

/// [`find`] for callers that change the clip: locks the home first, and then the clip's jobs, since a claim, which does not
/// lock the home, changes the clip's state.
pub(super) async fn find_locked(
    transaction: &mut Transaction,
    home: &HomeId,
    id: Uuid,
) -> Result<Clip, StorageError> {
    homes::lock_existing(transaction, home).await?;
    jobs::lock_of_clip(transaction, id).await?;
    find(transaction, home, id).await
}

pub(super) async fn find(connection: &mut Connection, home: &HomeId, id: Uuid) -> Result<Clip, StorageError> {
    let row = query(concat!("SELECT ", clip_columns!(), " FROM clips WHERE id = $1 AND home_id = $2"))
        .bind(id.to_string())
        .bind(home.key())
        .fetch_optional(&mut *connection)
        .await?;
    let Some(row) = row else {
        homes::require(connection, home).await?;
        return Err(StorageError::NoSuchClip);
    };
    let job = match row.maybe_id("job_id")? {
        Some(id) => jobs::find(connection, id).await?,
        None => None,
    };
    from_row(&row, job)
}

/// Returns the keys of a clip's recording, and of the files of its present and its last answer.
fn blobs_of(id: Uuid, result_keys: [Option<&str>; 2]) -> Vec<String> {
    let mut keys = vec![file_key(id)];
    keys.extend(result_keys.into_iter().flatten().flat_map(result_blobs));
    keys
}

/// Selects the blobs of a home's clips.
pub(super) const BLOBS_OF_HOME: &str = "SELECT id, result_key, last_result_key FROM clips WHERE home_id = $1";

/// Returns the blob keys of a home's clips.
pub(super) async fn blob_keys(
    connection: &mut Connection,
    home: &HomeId,
) -> Result<Vec<String>, StorageError> {
    let mut keys = Vec::new();
    for row in &query(BLOBS_OF_HOME).bind(home.key()).fetch_all(connection).await? {
        let (result, last) = (row.maybe_text("result_key")?, row.maybe_text("last_result_key")?);
        keys.extend(blobs_of(row.id("id")?, [result.as_deref(), last.as_deref()]));
    }
    Ok(keys)
}
