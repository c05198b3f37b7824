//! The queue in one process: it wakes workers and listeners; what is true is in storage.

mod align_clip;
mod merge;
mod report;
mod worker;

pub use align_clip::{Failure, Finished, JobParams, align_clip};
pub use worker::{Method, WorkerParams, work};

use crate::storage::{Changes, ChangesCursor, Job, Storage, StorageError};
use futures::Stream;
use jiff::Timestamp;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use uuid::Uuid;

/// How long a listener or an idle worker sleeps when nobody wakes it: another process may have written.
const POLL: Duration = Duration::from_secs(1);

pub struct Queue {
    storage: Arc<Storage>,
    due: Notify,
    changed: Notify,
}

impl Queue {
    pub fn new(storage: Arc<Storage>) -> Queue {
        Queue { storage, due: Notify::new(), changed: Notify::new() }
    }

    /// To be called after jobs were queued or changed.
    pub fn wake(&self) {
        self.due.notify_one();
        self.changed.notify_waiters();
    }

    /// Ends a job that waits or runs; none when there is no such job.
    pub async fn cancel(&self, id: Uuid) -> Result<Option<Job>, StorageError> {
        let job = self.storage.cancel_job(id, Timestamp::now()).await?;
        self.changed.notify_waiters();
        Ok(job)
    }

    /// At most `limit` changes after a cursor; when there is none, waits up to `wait` for one.
    pub async fn changes(
        &self,
        after: Option<ChangesCursor>,
        limit: u32,
        wait: Duration,
    ) -> Result<Changes, StorageError> {
        let begun = Instant::now();
        loop {
            let mut changed = std::pin::pin!(self.changed.notified());
            // As in `next_change`.
            changed.as_mut().enable();
            let changes = self.storage.changes(after, limit, Timestamp::now()).await?;
            let left = wait.saturating_sub(begun.elapsed());
            if !changes.items.is_empty() || left.is_zero() {
                return Ok(changes);
            }
            let _ = tokio::time::timeout(left.min(POLL), changed).await;
        }
    }

    /// The job now, unless the listener has `seen` this version of it, and again after every change, up to
    /// its final state. `None` in the stream: the job has been removed with its clip.
    pub fn watch(
        self: Arc<Queue>,
        id: Uuid,
        seen: i64,
    ) -> impl Stream<Item = Result<Option<Job>, StorageError>> {
        futures::stream::unfold(Some(seen), move |seen| {
            let queue = self.clone();
            async move {
                let job = queue.next_change(id, seen?).await;
                let goes_on = matches!(&job, Ok(Some(job)) if !job.state.is_final());
                let seen = job.as_ref().ok().and_then(|job| job.as_ref()).map(|job| job.version);
                Some((job, seen.filter(|_| goes_on)))
            }
        })
    }

    /// Waits until the job has another version than `seen`.
    async fn next_change(&self, id: Uuid, seen: i64) -> Result<Option<Job>, StorageError> {
        loop {
            let mut changed = std::pin::pin!(self.changed.notified());
            // Listening begins before looking, so that no change falls between the two.
            changed.as_mut().enable();
            match self.storage.job(id).await? {
                Some(job) if job.version == seen => {}
                other => return Ok(other),
            }
            let _ = tokio::time::timeout(POLL, changed).await;
        }
    }
}
