//! The queue of one process: it wakes workers and listeners; its state is in storage.

mod align_clip;
mod attempt_error;
mod child;
mod limits;
mod merge;
mod mesh;
mod metrics;
mod outcome;
mod pace;
mod params;
mod priority;
mod run;
mod shared_progress;
mod watch;
mod worker;

pub use align_clip::{AlignJobError, Finished, JobParams, LevelFile, align_clip, align_opened, level_maps};
pub use child::{ChildOrder, ChildParams, PANICKED, serve_child};
pub use limits::JobLimitParams;
pub use merge::{Described, Earlier, SurfaceLabels, describe, serve_merge};
pub use metrics::describe_metrics;
pub use params::WorkerParams;
pub use priority::give_way;
pub use run::Method;
pub use worker::work;

use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;
use tracing::warn;
use uuid::Uuid;
use viola_storage::{Changes, ChangesCursor, HomeId, Job, Signal, Storage, StorageError, Tenant};
use watch::Watched;

/// Polling interval of listeners and idle workers: another process may have written.
const POLL: Duration = Duration::from_secs(1);

/// Minimum time between two signals of a kind to other processes.
const MIN_SIGNAL_INTERVAL: Duration = Duration::from_millis(5);

pub struct Queue {
    storage: Arc<Storage>,
    due: Notify,
    changed: Arc<Notify>,
    watched_homes: Watched<HomeId>,
    /// The tenants, by their names, whose feed somebody waits for.
    watched_tenants: Watched<String>,
    watched_jobs: Watched<Uuid>,
    /// Signals that were not sent to the other processes yet.
    unsent_due: Notify,
    unsent_change: Notify,
}

impl Queue {
    pub fn new(storage: Arc<Storage>) -> Queue {
        Queue {
            storage,
            due: Notify::new(),
            changed: Arc::default(),
            watched_homes: Watched::default(),
            watched_tenants: Watched::default(),
            watched_jobs: Watched::default(),
            unsent_due: Notify::new(),
            unsent_change: Notify::new(),
        }
    }

    /// Wakes workers and listeners. To be called after jobs were queued or changed.
    pub fn wake(&self) {
        self.due.notify_one();
        self.unsent_due.notify_one();
        self.notify_listeners();
    }

    /// Returns the notification of every change, by this process and by others.
    pub fn changed(&self) -> Arc<Notify> {
        self.changed.clone()
    }

    /// Wakes listeners only. To be called after a change that does not concern workers.
    fn notify_listeners(&self) {
        self.changed.notify_waiters();
        self.unsent_change.notify_one();
    }

    /// Exchanges signals with the other processes until `stop`. Many of one kind become one.
    pub async fn exchange_signals(self: Arc<Queue>, stop: CancellationToken) {
        let send = async |unsent: &Notify, signal: Signal| {
            loop {
                unsent.notified().await;
                if let Err(error) = self.storage.notify_processes(signal).await {
                    warn!(%error, "other processes could not be notified; they poll");
                }
                tokio::time::sleep(MIN_SIGNAL_INTERVAL).await;
            }
        };
        tokio::select! {
            () = stop.cancelled() => {}
            () = send(&self.unsent_due, Signal::Due) => {}
            () = send(&self.unsent_change, Signal::Changed) => {}
            () = self.receive_signals() => {}
        }
    }

    async fn receive_signals(&self) {
        loop {
            match self.storage.signals().await {
                Ok(Some(mut signals)) => loop {
                    match signals.next().await {
                        Ok(Signal::Due) => self.due.notify_one(),
                        Ok(Signal::Changed) => self.changed.notify_waiters(),
                        Err(error) => {
                            warn!(%error, "signals of other processes cannot be received for now");
                            break;
                        }
                    }
                },
                // There is no other process.
                Ok(None) => return std::future::pending().await,
                Err(error) => warn!(%error, "signals of other processes cannot be received for now"),
            }
            tokio::time::sleep(POLL).await;
        }
    }

    /// Cancels a queued or running job; returns `None` if there is no such job.
    pub async fn cancel(&self, id: Uuid) -> Result<Option<Job>, StorageError> {
        let job = self.storage.cancel_job(id, self.storage.now()).await?;
        self.notify_listeners();
        Ok(job)
    }

    /// Returns at most `limit` changes after a cursor; if there is none, waits up to `wait` for one.
    pub async fn changes(
        &self,
        tenant: &Tenant,
        after: Option<ChangesCursor>,
        limit: u32,
        wait: Duration,
    ) -> Result<Changes, StorageError> {
        let begun = Instant::now();
        let of_tenant = self.watched_tenants.watch(&tenant.name().to_owned());
        loop {
            let mut changed = std::pin::pin!(of_tenant.notified());
            // Listening begins before reading, so that no change is missed.
            changed.as_mut().enable();
            let changes = self.storage.changes(tenant, after, limit, self.storage.now()).await?;
            let left = wait.saturating_sub(begun.elapsed());
            if !changes.items.is_empty() || left.is_zero() {
                return Ok(changes);
            }
            let _ = tokio::time::timeout(left, changed).await;
        }
    }
}
