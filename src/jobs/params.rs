//! Options of a worker.

use super::align_clip::{JobParams, align_clip};
use super::child::ChildParams;
use super::limits::JobLimitParams;
use super::run::Method;
use std::sync::Arc;
use std::time::Duration;
use viola_storage::RetryPolicy;

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
    /// Child process of each merge; without it merges run in this process, too.
    pub merge_child: Option<ChildParams>,
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
            merge_child: None,
            limits: JobLimitParams::default(),
        }
    }
}
