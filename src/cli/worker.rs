//! How jobs are done, as the command line says it.

use super::align_job::child_params;
use super::method::MethodArguments;
use crate::jobs::WorkerParams;
use crate::storage::RetryPolicy;
use crate::webhooks::WebhookParams;
use anyhow::Result;
use clap::Args;
use std::sync::Arc;
use std::time::Duration;

#[derive(Args)]
pub struct WorkerArguments {
    /// Jobs at a time; each uses all cores where it can.
    #[arg(long, value_name = "N", env = "VIOLA_WORKERS", default_value_t = 1)]
    pub workers: usize,
    #[command(flatten)]
    method: MethodArguments,
    /// Let webhooks go to addresses of private networks and of this machine, and by plain http. Only where all tenants
    /// are trusted: whatever this process can reach, they can then send messages to.
    #[arg(long, env = "VIOLA_WEBHOOKS_TO_PRIVATE_ADDRESSES")]
    webhooks_to_private_addresses: bool,
    /// How long a job stays with a worker that gives no sign of life.
    #[arg(long, value_name = "SECONDS", hide = true, default_value = "30", value_parser = seconds)]
    lease_seconds: Duration,
    /// First pause between two tries of a job.
    #[arg(long, value_name = "SECONDS", hide = true, default_value = "5", value_parser = seconds)]
    retry_seconds: Duration,
}

impl WorkerArguments {
    pub fn webhooks(&self) -> WebhookParams {
        WebhookParams { private_addresses: self.webhooks_to_private_addresses }
    }

    pub fn params(&self) -> Result<WorkerParams> {
        Ok(WorkerParams {
            lease: self.lease_seconds,
            retry: RetryPolicy { first_delay: self.retry_seconds, ..RetryPolicy::default() },
            align: Arc::new(self.method.params()?),
            child: Some(child_params(&self.method)?),
            ..WorkerParams::default()
        })
    }
}

pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().map_err(|error| error.to_string())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}
