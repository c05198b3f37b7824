//! `viola serve`: serves the HTTP API, with or without workers in the same process.

use super::args::{StoreArguments, WorkerArguments, patience_seconds};
use super::child::child;
use super::service::{self, print_address};
use crate::api::{ConnectionParams, LimitParams, Origin, ServeParams, UploadParams, serve};
use anyhow::Result;
use clap::Args;
use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::time::Duration;
use viola_storage::UploadLimits;

#[derive(Args)]
pub struct ServeArguments {
    /// Address and port; port 0 selects a free port. Other than loopback needs a key: see `viola keys`.
    #[arg(long, value_name = "ADDRESS", env = "VIOLA_LISTEN", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Address that serves /healthz, /readyz and /metrics without a key. Let only the operators' machines
    /// reach it.
    #[arg(long, value_name = "ADDRESS", env = "VIOLA_ADMIN_LISTEN")]
    admin_listen: Option<SocketAddr>,
    #[command(flatten)]
    store: StoreArguments,
    /// Run no jobs in this process; leave them to `viola work`.
    #[arg(long, env = "VIOLA_NO_WORKER")]
    no_worker: bool,
    #[command(flatten)]
    worker: WorkerArguments,
    /// Maximum size of a clip in MiB.
    #[arg(long, value_name = "MIB", env = "VIOLA_MAX_UPLOAD_MB", default_value_t = 2048,
        value_parser = clap::value_parser!(u64).range(1..))]
    max_upload_mb: u64,
    /// Idle time in seconds after which an unfinished resumable upload expires.
    #[arg(long, value_name = "SECONDS", env = "VIOLA_UPLOAD_PATIENCE_SECONDS", default_value = "86400",
        value_parser = patience_seconds)]
    upload_patience_seconds: Duration,
    /// Maximum mean rate of one tenant's requests to this process, per second; default: unlimited.
    #[arg(long, value_name = "N", env = "VIOLA_TENANT_REQUESTS_PER_SECOND")]
    tenant_requests_per_second: Option<NonZeroU32>,
    /// Maximum size of all files of a tenant without a limit of its own, in MiB: recordings, maps, results, unfinished
    /// uploads; default: unlimited.
    #[arg(long, value_name = "MIB", env = "VIOLA_TENANT_STORAGE_MB")]
    tenant_storage_mb: Option<u64>,
    /// Origin whose pages may call the service, for example https://app.example. May be given several times.
    #[arg(long = "cors-origin", value_name = "ORIGIN", env = "VIOLA_CORS_ORIGINS", value_delimiter = ',')]
    cors_origins: Vec<Origin>,
}

impl ServeArguments {
    /// Refuses values that exclude each other.
    pub fn check(&self) -> Result<()> {
        self.worker.check()
    }
}

pub fn run(arguments: &ServeArguments) -> Result<()> {
    service::run(|| params(arguments), |params, stop| serve(params, stop, print_address))
}

fn params(arguments: &ServeArguments) -> Result<ServeParams> {
    Ok(ServeParams {
        admin_listen: arguments.admin_listen,
        workers: if arguments.no_worker { 0 } else { arguments.worker.workers },
        max_upload_bytes: arguments.max_upload_mb.saturating_mul(1 << 20),
        uploads: UploadParams {
            limits: UploadLimits { patience: arguments.upload_patience_seconds, ..UploadLimits::default() },
            opener: Some(child(&["open-clip"])?),
            ..UploadParams::default()
        },
        limits: LimitParams {
            requests_per_s: arguments.tenant_requests_per_second,
            storage_bytes: arguments.tenant_storage_mb.map(|mib| mib.saturating_mul(1 << 20)),
        },
        connections: connections(),
        worker: arguments.worker.params()?,
        webhooks: arguments.worker.webhooks(),
        cors_origins: arguments.cors_origins.clone(),
        ..ServeParams::new(arguments.listen, arguments.store.params())
    })
}

/// Returns the limits of connections, which take at most half of the files that the process may open.
fn connections() -> ConnectionParams {
    let params = ConnectionParams::default();
    let half = usize::try_from(service::raise_open_files() / 2).unwrap_or(usize::MAX);
    ConnectionParams { most: params.most.min(half), ..params }
}
