//! A worker: claims and runs one job after the other.

use super::align_clip::{Finished, JobParams, LevelFile};
use super::attempt_error::{AttemptError, MethodResult};
use super::child::run_in_child;
use super::limits::JobLimits;
use super::merge::merge;
use super::mesh::{WaitingHomes, begin_meshes};
use super::outcome::detail;
use super::pace::Pace;
use super::params::WorkerParams;
use super::run::{Inputs, Working, run_here};
use super::shared_progress::SharedProgress;
use super::{POLL, Queue, metrics};
use std::pin::pin;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;
use tracing::field::Empty;
use tracing::{Instrument, Span, error, info, info_span, warn};
use viola_storage::{AttemptEnd, Claim, Fault, HomeId, JobProgress, JobState, StorageError};

/// Interval at which a worker checks its claim and reads the method's progress.
const TICK: Duration = Duration::from_millis(250);
/// Interval at which progress within a stage is recorded.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

/// Works until `stop`; then gives up the current job.
pub async fn work(queue: Arc<Queue>, params: WorkerParams, stop: CancellationToken) {
    let (merged, merge_pace, meshes) = Default::default();
    let mut worker = Worker { queue, params, stop, merged, merge_pace, meshes };
    while !worker.stop.is_cancelled() {
        worker.queue_lost().await;
        // They take turns. A merge waits for the queued clips of its home for a time, so that they are merged together.
        let worked = worker.work().await;
        let pause = worker.merge_pace.pause(Instant::now());
        let merged = pause.is_none() && !worker.stop.is_cancelled() && worker.merge().await;
        if !worked && !merged {
            worker.rest(pause.unwrap_or(POLL).min(POLL)).await;
        }
    }
}

struct Worker {
    queue: Arc<Queue>,
    params: WorkerParams,
    stop: CancellationToken,
    /// Tenant of the last merge.
    merged: String,
    merge_pace: Pace,
    meshes: Arc<WaitingHomes>,
}

impl Worker {
    /// Queues the jobs of lost workers again.
    async fn queue_lost(&self) {
        let storage = &self.queue.storage;
        if let Err(error) = storage.follow_clock().await {
            // Without it, a lease may seem to have expired.
            return error!(%error, "the database's clock could not be read; jobs of lost workers wait");
        }
        match storage.release_lost(&self.params.retry, storage.now()).await {
            Ok(0) => {}
            Ok(jobs) => {
                warn!(jobs, "jobs of lost workers are queued again");
                self.queue.wake();
            }
            Err(error) => error!(%error, "jobs of lost workers could not be queued again"),
        }
    }

    /// Does a job; returns false if none is due.
    async fn work(&self) -> bool {
        let claim = match self.queue.storage.claim(self.params.lease, self.queue.storage.now()).await {
            Ok(Some(claim)) => claim,
            Ok(None) => return false,
            Err(error) => {
                error!(%error, "no job could be claimed");
                return false;
            }
        };
        // There may be more jobs: wake the next worker, and this job's listeners.
        self.queue.wake();
        let job = &claim.job;
        let span = info_span!("job", job = %job.id, clip = %job.clip, home = %job.home, tenant = job.home.tenant(), attempt = job.attempts, outcome = Empty);
        let (home, attempt) = (job.home.clone(), Attempt { queue: &self.queue, params: &self.params, claim });
        let has_fault = attempt.run(&self.stop).instrument(span).await;
        self.queue.wake();
        // A job without a result makes no merge due, but the meshes may have waited for its end.
        self.begin_meshes(home);
        if has_fault {
            // With a full disk it would take job after job, faster than others do them, and each job would pause.
            let _ = tokio::time::timeout(self.params.retry.first_delay, self.stop.cancelled()).await;
        }
        true
    }

    /// Merges a home; returns false if none is due.
    async fn merge(&mut self) -> bool {
        let Worker { queue, params, stop, merged, merge_pace, .. } = self;
        let begun = Instant::now();
        let claim = match queue.storage.claim_merge(merged, params.lease, queue.storage.now()).await {
            Ok(Some(claim)) => claim,
            Ok(None) => {
                merge_pace.found_none(begun, Instant::now());
                return false;
            }
            Err(error) => {
                error!(%error, "no map could be claimed");
                return false;
            }
        };
        claim.home.tenant().clone_into(merged);
        let span = info_span!("merge", home = %claim.home, tenant = &*merged);
        merge(queue, &claim, params, stop).instrument(span).await;
        self.begin_meshes(claim.home);
        true
    }

    /// Makes the missing meshes of a home beside the next job.
    fn begin_meshes(&self, home: HomeId) {
        if !self.stop.is_cancelled() {
            begin_meshes(self.meshes.clone(), self.queue.storage.clone(), home);
        }
    }

    /// Waits until something may be due, at most `longest`.
    async fn rest(&self, longest: Duration) {
        tokio::select! {
            () = self.stop.cancelled() => {}
            () = self.queue.due.notified() => {}
            () = tokio::time::sleep(longest) => {}
        }
    }
}

/// An attempt at a job under one claim.
struct Attempt<'a> {
    queue: &'a Queue,
    params: &'a WorkerParams,
    claim: Claim,
}

impl Attempt<'_> {
    /// Returns whether a fault of this machine ended the attempt.
    async fn run(&self, stop: &CancellationToken) -> bool {
        let (job, begun) = (&self.claim.job, Instant::now());
        // The due time of a further attempt is unknown.
        if self.claim.is_first() {
            metrics::started(self.queue.storage.now().duration_since(job.created_at).unsigned_abs());
        }
        info!(job = %job.id, clip = %job.clip, home = %job.home, attempt = job.attempts, "job begins");
        let ending = self.work(stop).await.ok();
        let kept = match &ending {
            Some(ending) => self.record(ending, stop).await,
            None => Ok(false),
        };
        let outcome = match (&ending, &kept) {
            (None, _) | (_, Ok(false)) => self.why_lost().await,
            (Some(ending), Ok(true)) => metrics::outcome(ending).to_owned(),
            // The lease expires, and the job runs again.
            (Some(_), Err(_)) => Fault::Storage.code().to_owned(),
        };
        Span::current().record("outcome", &*outcome);
        let took = begun.elapsed();
        metrics::ended(&outcome, ending.as_ref(), kept.as_ref().ok().copied(), took);
        let seconds = took.as_secs_f64();
        // A clip that was removed meanwhile has no file: that is no fault of this machine.
        let is_lost = matches!(kept, Ok(false));
        match kept {
            Ok(true) => {
                let detail = ending.as_ref().and_then(detail);
                info!(job = %job.id, clip = %job.clip, outcome, detail, seconds, "job ends");
            }
            Ok(false) => info!(job = %job.id, clip = %job.clip, seconds, "job is no longer this worker's"),
            Err(error) => error!(job = %job.id, outcome, %error, "the end of a job could not be recorded"),
        }
        !is_lost && matches!(ending, Some(AttemptEnd::Fault(Fault::System)))
    }

    /// Returns the code of the end of a job that was taken from this worker; `lost` if it runs on elsewhere, or is removed.
    async fn why_lost(&self) -> String {
        let job = self.queue.storage.job(self.claim.job.id).await.ok().flatten();
        let error = job.filter(|job| job.state == JobState::Cancelled).and_then(|job| job.error);
        error.map_or_else(|| "lost".to_owned(), |reason| reason.code)
    }

    /// Records the end of the attempt. Retries failed writes while no other worker can take the job: the
    /// answer may have been expensive.
    async fn record(&self, ending: &AttemptEnd, stop: &CancellationToken) -> Result<bool, StorageError> {
        let (begun, storage) = (Instant::now(), &self.queue.storage);
        loop {
            let recorded = storage.finish(&self.claim, ending, &self.params.retry, storage.now()).await;
            match recorded {
                Err(error) if !stop.is_cancelled() && begun.elapsed() < self.params.lease / 2 => {
                    warn!(job = %self.claim.job.id, %error, "the end of a job is recorded once more");
                    tokio::time::sleep(TICK).await;
                }
                recorded => return recorded,
            }
        }
    }

    /// Runs the job.
    async fn work(&self, stop: &CancellationToken) -> Result<AttemptEnd, Lost> {
        let progress = Arc::new(SharedProgress::here());
        let begin = async {
            tokio::select! {
                begun = self.begin(&progress) => Some(begun),
                () = stop.cancelled() => None,
            }
        };
        // A remote clip must be fetched first.
        let begun = self.with_heartbeat(&progress, JobProgress::default(), begin).await?;
        let (mut method, limits) = match begun {
            Some(Ok(begun)) => begun,
            Some(Err(error)) => return Ok(error.into_end()),
            None => return Ok(AttemptEnd::GivenUp),
        };
        Ok(match self.attend(&mut method, limits, &progress, stop).await? {
            Some(Ok(finished)) => self.store(finished, &progress).await,
            Some(Err(error)) => error.into_end(),
            None => AttemptEnd::GivenUp,
        })
    }

    /// Starts the method.
    async fn begin(&self, progress: &Arc<SharedProgress>) -> Result<(Working, JobLimits), AttemptError> {
        let storage = &self.queue.storage;
        let job = &self.claim.job;
        let clip = storage.clip_file(job.clip).await?;
        let unknown_scale = !storage.clip(&job.home, job.clip).await?.info.metric;
        let mut levels = Vec::new();
        for map in &self.claim.lidar_maps {
            levels.push(LevelFile { level: map.level, bytes: storage.lidar_map_file(map.id()).await? });
        }
        let (inputs, progress) = (Inputs { clip, unknown_scale, levels }, progress.clone());
        let uploaded_bytes = inputs.bytes().map_err(AttemptError::system)?;
        let limits = JobLimits::new(&self.params.limits, uploaded_bytes);
        let working = match &self.params.child {
            Some(child) => run_in_child(child, inputs, limits, storage.work_folder()?, progress),
            None => {
                let scratch = storage.scratch(self.claim.job.home.tenant());
                let params = JobParams { scratch, unknown_scale, ..JobParams::clone(&self.params.align) };
                run_here(self.params.method, params.into(), inputs, progress)
            }
        };
        Ok((working, limits))
    }

    /// Waits for the method's end, forwards the order to stop, and ends a method that takes too long. Returns `None` if the
    /// method has not stopped within the grace period.
    async fn attend(
        &self,
        method: &mut Working,
        limits: JobLimits,
        progress: &SharedProgress,
        stop: &CancellationToken,
    ) -> Result<Option<MethodResult>, Lost> {
        let grace_over = async {
            stop.cancelled().await;
            progress.cancel();
            tokio::time::sleep(self.params.grace).await;
        };
        let mut grace_over = pin!(grace_over);
        let end_in_time = async {
            tokio::select! {
                result = method.as_mut() => return result,
                () = tokio::time::sleep(limits.time) => progress.cancel(),
            }
            match method.as_mut().await {
                Err(AttemptError::Cancelled) => Err(AttemptError::Refused(limits.took_too_long())),
                result => result,
            }
        };
        let end = async {
            tokio::select! {
                result = end_in_time => Some(result),
                () = &mut grace_over => None,
            }
        };
        let end = self.with_heartbeat(progress, JobProgress::default(), end).await;
        if end.is_err() {
            progress.cancel();
            tokio::select! {
                _ = method => {}
                () = grace_over => {}
            }
        }
        end
    }

    /// Stores the results.
    async fn store(&self, finished: Finished, progress: &SharedProgress) -> AttemptEnd {
        let mut stored = pin!(self.put_results(finished));
        // A slow store would otherwise give the job away.
        let end = self.with_heartbeat(progress, progress.current(), stored.as_mut()).await;
        match end {
            Ok(end) => end,
            // The record of the end notices it too, and removes the files.
            Err(Lost) => stored.await,
        }
    }

    async fn put_results(&self, finished: Finished) -> AttemptEnd {
        let storage = &self.queue.storage;
        for (name, bytes) in finished.files {
            if let Err(error) = storage.put_result(&self.claim, name, bytes).await {
                return AttemptError::from(error).into_end();
            }
        }
        AttemptEnd::Answered(Box::new(finished.alignment))
    }

    /// Returns the result of `work`, and renews the lease and records the progress meanwhile. `recorded` is the progress that
    /// needs no record.
    async fn with_heartbeat<T>(
        &self,
        progress: &SharedProgress,
        recorded: JobProgress,
        work: impl Future<Output = T>,
    ) -> Result<T, Lost> {
        let heartbeats = async {
            let mut tick = tokio::time::interval(TICK);
            let mut last = LastHeartbeat { progress: recorded, at: Instant::now() };
            loop {
                tick.tick().await;
                match self.heartbeat(progress.current(), &mut last).await {
                    Ok(true) => {}
                    Ok(false) => return Lost,
                    Err(error) => {
                        warn!(job = %self.claim.job.id, %error, "a heartbeat could not be recorded")
                    }
                }
            }
        };
        // The work continues while a heartbeat waits for the database: it may hold the connection for which the heartbeat waits.
        tokio::select! {
            result = work => Ok(result),
            lost = heartbeats => Err(lost),
        }
    }

    /// Sends a heartbeat if one is due; returns false if the job is no longer this worker's.
    async fn heartbeat(&self, current: JobProgress, last: &mut LastHeartbeat) -> Result<bool, StorageError> {
        let quiet = last.at.elapsed();
        let is_news = (current.stage, current.early_pose) != (last.progress.stage, last.progress.early_pose)
            || (current != last.progress && quiet >= PROGRESS_EVERY);
        if !is_news && quiet < self.params.lease / 3 {
            return self.queue.storage.holds(&self.claim).await;
        }
        let (lease, now) = (self.params.lease, self.queue.storage.now());
        let held = self.queue.storage.heartbeat(&self.claim, &current, lease, now).await?;
        *last = LastHeartbeat { progress: current, at: Instant::now() };
        self.queue.notify_listeners();
        Ok(held)
    }
}

/// The job was cancelled, removed, or given to another worker.
struct Lost;

/// Last recorded progress and its time.
struct LastHeartbeat {
    progress: JobProgress,
    at: Instant,
}
