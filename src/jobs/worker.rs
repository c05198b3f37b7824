//! A worker: claims and runs one job after the other.

use super::align_clip::{Finished, JobParams, LevelFile, align_clip};
use super::child::{ChildParams, run_in_child};
use super::limits::{JobLimitParams, JobLimits};
use super::merge::merge;
use super::mesh::make_meshes;
use super::report::{Heard, Report};
use super::run::{Inputs, Method, Working, run_here};
use super::trouble::{Ended, Trouble};
use super::{POLL, Queue, metrics};
use crate::storage::{Claim, Ending, Reached, RetryPolicy, StorageError};
use jiff::Timestamp;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;
use tracing::field::Empty;
use tracing::{Instrument, Span, error, info, info_span, warn};
use viola_reconstruct::Reason;

/// Interval at which a worker checks its claim and reads the method's progress.
const TICK: Duration = Duration::from_millis(250);
/// Interval at which progress within a stage is recorded.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

/// Options of a worker.
#[derive(Debug, Clone)]
pub struct WorkerParams {
    /// Lease of a job without a heartbeat. A heartbeat is due after a third of it.
    pub lease: Duration,
    /// Time that the method may take to stop when the server stops.
    pub grace: Duration,
    pub retry: RetryPolicy,
    /// The function that does a job.
    pub method: Method,
    /// The same for every job, with its seed, so that the same clip and map always give the same answer.
    pub align: Arc<JobParams>,
    /// Child process of each job. Without it jobs run in this process, without a limit of memory.
    pub child: Option<ChildParams>,
    pub limits: JobLimitParams,
}

impl Default for WorkerParams {
    fn default() -> WorkerParams {
        WorkerParams {
            lease: Duration::from_secs(30),
            grace: Duration::from_secs(10),
            retry: RetryPolicy::default(),
            method: align_clip,
            align: Arc::default(),
            child: None,
            limits: JobLimitParams::default(),
        }
    }
}

/// Works until `stop`; then gives up the current job.
pub async fn work(queue: Arc<Queue>, params: WorkerParams, stop: CancellationToken) {
    let mut worker = Worker { queue, params, stop, merged: String::new() };
    while !worker.stop.is_cancelled() {
        worker.queue_lost().await;
        // Jobs and merges take turns, so that neither waits until the other queue is empty. A home with queued clips is
        // not due, so it is merged once.
        let worked = worker.work().await;
        let merged = !worker.stop.is_cancelled() && worker.merge().await;
        if !worked && !merged {
            worker.rest().await;
        }
    }
}

struct Worker {
    queue: Arc<Queue>,
    params: WorkerParams,
    stop: CancellationToken,
    /// Tenant of the last merge.
    merged: String,
}

impl Worker {
    /// Queues the jobs of lost workers again.
    async fn queue_lost(&self) {
        match self.queue.storage.release_lost(&self.params.retry, Timestamp::now()).await {
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
        let claim = match self.queue.storage.claim(self.params.lease, Timestamp::now()).await {
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
        Attempt { queue: &self.queue, params: &self.params, claim }.run(&self.stop).instrument(span).await;
        self.queue.wake();
        true
    }

    /// Merges a home; returns false if none is due.
    async fn merge(&mut self) -> bool {
        let Worker { queue, params, stop, merged } = self;
        let claim = match queue.storage.claim_merge(merged, params.lease, Timestamp::now()).await {
            Ok(Some(claim)) => claim,
            Ok(None) => return false,
            Err(error) => {
                error!(%error, "no map could be claimed");
                return false;
            }
        };
        claim.home.tenant().clone_into(merged);
        let span = info_span!("merge", home = %claim.home, tenant = claim.home.tenant());
        let surface = params.align.align.label.surface.clone();
        if merge(queue, &claim, surface, params.lease, stop).instrument(span).await {
            tokio::spawn(make_meshes(queue.storage.clone(), claim.home));
        }
        true
    }

    /// Waits until something may be due.
    async fn rest(&self) {
        tokio::select! {
            () = self.stop.cancelled() => {}
            () = self.queue.due.notified() => {}
            () = tokio::time::sleep(POLL) => {}
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
    async fn run(&self, stop: &CancellationToken) {
        let job = &self.claim.job;
        let begun = Instant::now();
        // The due time of a further attempt is unknown.
        if self.claim.is_first() {
            metrics::started(Timestamp::now().duration_since(job.created_at).unsigned_abs());
        }
        info!(job = %job.id, clip = %job.clip, home = %job.home, attempt = job.attempts, "job begins");
        let ending = self.work(stop).await;
        let outcome = outcome_name(&ending);
        Span::current().record("outcome", outcome);
        let kept = match &ending {
            Some(ending) => self.record(ending, stop).await,
            None => Ok(false),
        };
        let took = begun.elapsed();
        let is_kept = matches!(kept, Ok(true));
        metrics::ended(outcome, ending.as_ref().filter(|_| is_kept), took);
        let seconds = took.as_secs_f64();
        match kept {
            Ok(true) => info!(job = %job.id, clip = %job.clip, outcome, seconds, "job ends"),
            Ok(false) => info!(job = %job.id, clip = %job.clip, seconds, "job is no longer this worker's"),
            // The lease expires, and the job runs again.
            Err(error) => error!(job = %job.id, outcome, %error, "the end of a job could not be recorded"),
        }
    }

    /// Records the end of the attempt. Retries failed writes while no other worker can take the job: the
    /// answer may have been expensive.
    async fn record(&self, ending: &Ending, stop: &CancellationToken) -> Result<bool, StorageError> {
        let (begun, storage) = (Instant::now(), &self.queue.storage);
        loop {
            let recorded = storage.finish(&self.claim, ending, &self.params.retry, Timestamp::now()).await;
            match recorded {
                Err(error) if !stop.is_cancelled() && begun.elapsed() < self.params.lease / 2 => {
                    warn!(job = %self.claim.job.id, %error, "the end of a job is recorded once more");
                    tokio::time::sleep(TICK).await;
                }
                recorded => return recorded,
            }
        }
    }

    /// Runs the job; returns `None` if it is no longer this worker's.
    async fn work(&self, stop: &CancellationToken) -> Option<Ending> {
        let report = Arc::new(Report::here());
        let (mut method, limits) = match self.begin_alive(&report, stop).await {
            Begun::Working(method, limits) => (method, limits),
            Begun::Failed(trouble) => return Some(ending_of(trouble)),
            Begun::Lost => return None,
            Begun::Stopped => return Some(Ending::GivenUp),
        };
        match self.attend(&mut method, limits, &report, stop).await {
            Watched::Ended(ended) => Some(self.conclude(*ended, report.heard()).await),
            Watched::TooSlowToStop => Some(Ending::GivenUp),
            Watched::Lost => None,
        }
    }

    async fn conclude(&self, ended: Ended, heard: Heard) -> Ending {
        match ended {
            Ok(finished) => self.keep_alive(finished, heard).await,
            Err(trouble) => ending_of(trouble),
        }
    }

    /// Stores the results and renews the lease meanwhile: a slow store would otherwise give the job away.
    async fn keep_alive(&self, finished: Finished, heard: Heard) -> Ending {
        let mut keeping = std::pin::pin!(self.keep(finished));
        let mut tick = tokio::time::interval(TICK);
        let mut said = Said { heard, at: Instant::now() };
        loop {
            tokio::select! {
                ending = &mut keeping => return ending,
                // A lost job is noticed when its end is recorded.
                _ = tick.tick() => if let Err(error) = self.beat(heard, &mut said).await {
                    warn!(job = %self.claim.job.id, %error, "a sign of life could not be recorded");
                },
            }
        }
    }

    /// Starts the method and renews the lease meanwhile: a remote clip must be fetched first.
    async fn begin_alive(&self, report: &Arc<Report>, stop: &CancellationToken) -> Begun {
        let mut begin = std::pin::pin!(self.begin(report));
        let mut tick = tokio::time::interval(TICK);
        let mut said = Said { heard: Heard::default(), at: Instant::now() };
        loop {
            tokio::select! {
                begun = &mut begin => return begun.unwrap_or_else(Begun::Failed),
                () = stop.cancelled() => return Begun::Stopped,
                _ = tick.tick() => match self.beat(report.heard(), &mut said).await {
                    Ok(true) => {}
                    Ok(false) => return Begun::Lost,
                    Err(error) => warn!(job = %self.claim.job.id, %error, "a sign of life could not be recorded"),
                },
            }
        }
    }

    async fn begin(&self, report: &Arc<Report>) -> Result<Begun, Trouble> {
        let storage = &self.queue.storage;
        let job = &self.claim.job;
        let clip = storage.clip_file(job.clip).await?;
        let metric = storage.clip(&job.home, job.clip).await?.info.metric;
        let mut levels = Vec::new();
        for map in &self.claim.lidar_maps {
            levels.push(LevelFile { level: map.level, bytes: storage.lidar_map_file(map.id()).await? });
        }
        let (inputs, report) = (Inputs { clip, metric, levels }, report.clone());
        let uploaded_bytes = inputs.bytes().map_err(Trouble::system)?;
        let limits = JobLimits::new(&self.params.limits, uploaded_bytes);
        let working = match &self.params.child {
            Some(child) => run_in_child(child, inputs, limits, storage.work_folder()?, report),
            None => {
                let scratch = storage.scratch(self.claim.job.home.tenant());
                let unknown_scale = !inputs.metric;
                let params = JobParams { scratch, unknown_scale, ..JobParams::clone(&self.params.align) };
                run_here(self.params.method, params.into(), inputs, report)
            }
        };
        Ok(Begun::Working(working, limits))
    }

    /// Renews the lease and records progress while the method runs, and forwards the order to stop. Ends a
    /// method that takes too long.
    async fn attend(
        &self,
        method: &mut Working,
        limits: JobLimits,
        report: &Report,
        stop: &CancellationToken,
    ) -> Watched {
        let mut tick = tokio::time::interval(TICK);
        let mut said = Said { heard: Heard::default(), at: Instant::now() };
        let (mut lost, mut is_late) = (false, false);
        let mut late = std::pin::pin!(tokio::time::sleep(limits.time));
        let grace_over = async {
            stop.cancelled().await;
            report.cancel();
            tokio::time::sleep(self.params.grace).await;
        };
        let mut grace_over = std::pin::pin!(grace_over);
        loop {
            tokio::select! {
                ended = &mut *method => return match ended {
                    _ if lost => Watched::Lost,
                    Err(Trouble::Cancelled) if is_late => {
                        Watched::Ended(Box::new(Err(Trouble::Refused(limits.took_too_long()))))
                    }
                    ended => Watched::Ended(Box::new(ended)),
                },
                () = &mut late, if !is_late => {
                    is_late = true;
                    report.cancel();
                }
                () = &mut grace_over => return if lost { Watched::Lost } else { Watched::TooSlowToStop },
                _ = tick.tick(), if !lost => match self.beat(report.heard(), &mut said).await {
                    Ok(true) => {}
                    Ok(false) => {
                        lost = true;
                        report.cancel();
                    }
                    Err(error) => warn!(job = %self.claim.job.id, %error, "a sign of life could not be recorded"),
                },
            }
        }
    }

    /// Sends a heartbeat if one is due; returns false if the job is no longer this worker's.
    async fn beat(&self, heard: Heard, said: &mut Said) -> Result<bool, StorageError> {
        let quiet = said.at.elapsed();
        let Heard { stage, progress, early_pose } = heard;
        let news = (stage, early_pose) != (said.heard.stage, said.heard.early_pose)
            || (heard != said.heard && quiet >= PROGRESS_EVERY);
        if !news && quiet < self.params.lease / 3 {
            return self.queue.storage.holds(&self.claim).await;
        }
        let (lease, now) = (self.params.lease, Timestamp::now());
        let reached = Reached { stage, progress, early_pose };
        let held = self.queue.storage.heartbeat(&self.claim, &reached, lease, now).await?;
        *said = Said { heard, at: Instant::now() };
        self.queue.tell_of_change();
        Ok(held)
    }

    async fn keep(&self, finished: Finished) -> Ending {
        let storage = &self.queue.storage;
        for (name, bytes) in finished.files {
            if let Err(error) = storage.put_result(&self.claim, name, bytes).await {
                return ending_of(error.into());
            }
        }
        Ending::Answered(Box::new(finished.alignment))
    }
}

/// Result of starting a job.
enum Begun {
    Working(Working, JobLimits),
    Failed(Trouble),
    /// As in [`Watched`].
    Lost,
    Stopped,
}

/// Result of watching the method.
enum Watched {
    Ended(Box<Ended>),
    /// The job was cancelled, removed, or given to another worker.
    Lost,
    TooSlowToStop,
}

/// Last recorded progress and its time.
struct Said {
    heard: Heard,
    at: Instant,
}

/// Converts a trouble into an ending. The cause is only logged: a client cannot act on it.
fn ending_of(trouble: Trouble) -> Ending {
    match trouble {
        Trouble::Cancelled => Ending::GivenUp,
        Trouble::Refused(reason) => Ending::Refused(reason),
        Trouble::Broken { code, cause } => {
            error!(code, cause, "an attempt broke");
            let detail = match code.as_str() {
                "worker_died" => {
                    "the process that worked on this clip alone died; it may need more memory than there is"
                }
                _ => "the service failed while it worked on this clip; its log has the cause",
            };
            Ending::Broken(Reason::new(&code, detail))
        }
        Trouble::Fault { fault, cause } => {
            warn!(code = fault.code(), cause, "a fault ended an attempt, which does not count");
            Ending::Fault(fault)
        }
    }
}

fn outcome_name(ending: &Option<Ending>) -> &str {
    match ending {
        Some(Ending::Answered(alignment)) => crate::storage::ClipState::from(alignment.state).name(),
        Some(Ending::Refused(reason) | Ending::Broken(reason)) => &reason.code,
        Some(Ending::Fault(fault)) => fault.code(),
        Some(Ending::GivenUp) => "given_up",
        None => "lost",
    }
}
