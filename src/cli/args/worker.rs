//! Arguments for the workers.

use super::method::MethodArguments;
use super::numbers;
use super::seconds::{job_seconds, seconds};
use crate::cli::child::{child_params, merge_child_params};
use crate::jobs::{JobLimitParams, WorkerParams};
use crate::webhooks::WebhookParams;
use anyhow::Result;
use clap::Args;
use std::sync::Arc;
use std::time::Duration;
use viola_storage::RetryPolicy;

/// Default memory limits of a job, without and with networks that see pictures.
const MEMORY_MB: u64 = 1024;
const MEMORY_WITH_MODELS_MB: u64 = 4096;
/// Every clip would be refused with less, for good: 0 does not mean that there is no limit.
const MIN_MEMORY_MB: u64 = 64;

#[derive(Args)]
pub struct WorkerArguments {
    /// Number of parallel jobs; each job uses all cores if it can.
    #[arg(long, value_name = "N", env = "VIOLA_WORKERS", default_value_t = 1, value_parser = numbers::workers)]
    pub workers: usize,
    #[command(flatten)]
    method: MethodArguments,
    /// Allow webhooks to private networks and to this machine, and over plain http. Use it only if all
    /// tenants are trusted: they can then send messages to every address that this process can reach.
    #[arg(long, env = "VIOLA_WEBHOOKS_TO_PRIVATE_ADDRESSES")]
    webhooks_to_private_addresses: bool,
    /// Time limit of a job in seconds, in addition to 6 s for each uploaded MiB.
    #[arg(long, value_name = "SECONDS", env = "VIOLA_JOB_SECONDS", default_value = "600", value_parser = job_seconds)]
    job_seconds: Duration,
    /// Memory limit of a job in MiB, in addition to its networks and to four times its files; default: 1024,
    /// or 4096 with a models folder. At least 64.
    #[arg(long, value_name = "MIB", env = "VIOLA_JOB_MEMORY_MB",
        value_parser = clap::value_parser!(u64).range(MIN_MEMORY_MB..))]
    job_memory_mb: Option<u64>,
    /// Lease of a job in seconds; its worker must renew the lease to keep the job.
    #[arg(long, value_name = "SECONDS", hide = true, default_value = "30", value_parser = seconds)]
    lease_seconds: Duration,
    /// Delay before the first retry of a job in seconds.
    #[arg(long, value_name = "SECONDS", hide = true, default_value = "5", value_parser = seconds)]
    retry_seconds: Duration,
}

impl WorkerArguments {
    pub fn webhooks(&self) -> WebhookParams {
        WebhookParams { private_addresses: self.webhooks_to_private_addresses }
    }

    fn limits(&self) -> JobLimitParams {
        let default = if self.method.has_models_folder() { MEMORY_WITH_MODELS_MB } else { MEMORY_MB };
        let memory_mb = self.job_memory_mb.unwrap_or(default);
        let memory_bytes = memory_mb.saturating_mul(1 << 20);
        JobLimitParams { time: self.job_seconds, memory_bytes, ..JobLimitParams::default() }
    }

    /// Refuses values that exclude each other.
    pub fn check(&self) -> Result<()> {
        self.method.check()
    }

    pub fn params(&self) -> Result<WorkerParams> {
        let align = self.method.params()?;
        // A network that cannot be used now is left out until the next start; one that can be is in every merge.
        let of_merges = align.align.label.surface.as_ref().map(|_| &self.method);
        Ok(WorkerParams {
            lease: self.lease_seconds,
            retry: RetryPolicy { first_delay: self.retry_seconds, ..RetryPolicy::default() },
            child: Some(child_params(&self.method)?),
            merge_child: Some(merge_child_params(of_merges)?),
            align: Arc::new(align),
            limits: self.limits(),
            ..WorkerParams::default()
        })
    }
}
