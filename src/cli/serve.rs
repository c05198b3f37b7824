//! `viola serve`: the HTTP API, with workers in the same process or without.

use super::service::{self, print_address};
use super::store::StoreArguments;
use super::worker::{WorkerArguments, seconds};
use crate::api::{ConnectionParams, LimitParams, ServeParams, UploadParams, serve};
use crate::storage::UploadLimits;
use anyhow::Result;
use clap::Args;
use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::time::Duration;

#[derive(Args)]
pub struct ServeArguments {
    /// Address and port; port 0 takes a free one. Other machines are served only once there is a key: see `viola keys`.
    #[arg(long, value_name = "ADDRESS", env = "VIOLA_LISTEN", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    #[command(flatten)]
    store: StoreArguments,
    /// Leave jobs to `viola work`.
    #[arg(long, env = "VIOLA_NO_WORKER")]
    no_worker: bool,
    #[command(flatten)]
    worker: WorkerArguments,
    /// Largest clip.
    #[arg(long, value_name = "MIB", env = "VIOLA_MAX_UPLOAD_MB", default_value_t = 2048)]
    max_upload_mb: u64,
    /// How long an unfinished resumable upload waits for its next byte.
    #[arg(long, value_name = "SECONDS", env = "VIOLA_UPLOAD_PATIENCE_SECONDS", default_value = "86400",
        value_parser = seconds)]
    upload_patience_seconds: Duration,
    /// Requests a second of one tenant to this process, in the long run; without bound when not given.
    #[arg(long, value_name = "N", env = "VIOLA_TENANT_REQUESTS_PER_SECOND")]
    tenant_requests_per_second: Option<NonZeroU32>,
    /// What one tenant may keep as uploaded files; without bound when not given.
    #[arg(long, value_name = "MIB", env = "VIOLA_TENANT_STORAGE_MB")]
    tenant_storage_mb: Option<u64>,
}

pub fn run(arguments: &ServeArguments) -> Result<()> {
    let params = ServeParams {
        listen: arguments.listen,
        storage: arguments.store.params(),
        workers: if arguments.no_worker { 0 } else { arguments.worker.workers },
        max_upload_bytes: arguments.max_upload_mb.saturating_mul(1 << 20),
        uploads: UploadParams {
            limits: UploadLimits { patience: arguments.upload_patience_seconds, ..UploadLimits::default() },
            ..UploadParams::default()
        },
        limits: LimitParams {
            requests_per_s: arguments.tenant_requests_per_second,
            storage_bytes: arguments.tenant_storage_mb.map(|mib| mib.saturating_mul(1 << 20)),
        },
        connections: ConnectionParams::default(),
        worker: arguments.worker.params()?,
        webhooks: arguments.worker.webhooks(),
    };
    service::run(|stop| serve(params, stop, print_address))
}
