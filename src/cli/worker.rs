//! How jobs are done, as the command line says it.

use super::completion::CompletionArguments;
use super::networks::NetworkArguments;
use super::video_tools::video_tools;
use crate::align::AlignParams;
use crate::jobs::{JobParams, WorkerParams};
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
    networks: NetworkArguments,
    #[command(flatten)]
    completion: CompletionArguments,
    /// Let webhooks go to addresses of private networks and of this machine, and by plain http. Only where all tenants
    /// are trusted: whatever this process can reach, they can then send messages to.
    #[arg(long, env = "VIOLA_WEBHOOKS_TO_PRIVATE_ADDRESSES")]
    webhooks_to_private_addresses: bool,
    /// How long a job stays with a worker that gives no sign of life.
    #[arg(long, value_name = "SECONDS", hide = true, default_value = "30", value_parser = seconds)]
    lease_seconds: Duration,
}

impl WorkerArguments {
    pub fn webhooks(&self) -> WebhookParams {
        WebhookParams { private_addresses: self.webhooks_to_private_addresses }
    }

    pub fn params(&self) -> Result<WorkerParams> {
        let align = AlignParams {
            label: self.networks.labels_or_geometry(),
            complete: self.completion.params(&self.networks)?,
            ..AlignParams::default()
        };
        Ok(WorkerParams {
            lease: self.lease_seconds,
            align: Arc::new(JobParams { align, video: video_tools() }),
            ..WorkerParams::default()
        })
    }
}

pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().map_err(|error| error.to_string())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}
