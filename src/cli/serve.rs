//! `viola serve`: the whole service in one process.

use super::completion::CompletionArguments;
use super::networks::NetworkArguments;
use super::video_tools::video_tools;
use crate::align::AlignParams;
use crate::api::{ServeParams, UploadParams, serve};
use crate::jobs::{JobParams, WorkerParams};
use crate::storage::UploadLimits;
use anyhow::Result;
use clap::Args;
use std::io::{IsTerminal, Write};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracing_subscriber::EnvFilter;

#[derive(Args)]
pub struct ServeArguments {
    /// Address and port; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// The data folder; it is made when it is not there.
    #[arg(long, value_name = "DIR", default_value = "viola-data")]
    data: PathBuf,
    /// Jobs at a time; each uses all cores where it can. With 0, jobs wait for another server.
    #[arg(long, value_name = "N", default_value_t = 1)]
    workers: usize,
    #[command(flatten)]
    networks: NetworkArguments,
    #[command(flatten)]
    completion: CompletionArguments,
    /// Largest clip.
    #[arg(long, value_name = "MIB", default_value_t = 2048)]
    max_upload_mb: u64,
    /// How long an unfinished resumable upload waits for its next byte.
    #[arg(long, value_name = "SECONDS", default_value = "86400", value_parser = seconds)]
    upload_patience_seconds: Duration,
    /// How long a job stays with a worker that gives no sign of life.
    #[arg(long, value_name = "SECONDS", hide = true, default_value = "30", value_parser = seconds)]
    lease_seconds: Duration,
}

pub fn run(arguments: &ServeArguments) -> Result<()> {
    start_log();
    let align = AlignParams {
        label: arguments.networks.labels_or_geometry(),
        complete: arguments.completion.params(&arguments.networks)?,
        ..AlignParams::default()
    };
    let params = ServeParams {
        listen: arguments.listen,
        data: arguments.data.clone(),
        workers: arguments.workers,
        max_upload_bytes: arguments.max_upload_mb.saturating_mul(1 << 20),
        uploads: UploadParams {
            limits: UploadLimits { patience: arguments.upload_patience_seconds, ..UploadLimits::default() },
            ..UploadParams::default()
        },
        worker: WorkerParams {
            lease: arguments.lease_seconds,
            align: Arc::new(JobParams { align, video: video_tools() }),
            ..WorkerParams::default()
        },
    };
    let runtime = tokio::runtime::Runtime::new()?;
    let served = runtime.block_on(async {
        let stop = CancellationToken::new();
        let stopping = stop.clone();
        tokio::spawn(async move {
            stop_asked().await;
            stopping.cancel();
        });
        serve(params, stop, print_address).await
    });
    // A method that did not stop in its grace would otherwise hold the process.
    runtime.shutdown_background();
    Ok(served?)
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().map_err(|error| error.to_string())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}

/// The line that scripts wait for.
fn print_address(address: SocketAddr) {
    let mut out = std::io::stdout().lock();
    // Nobody may be reading; that is no reason not to serve.
    let _ = writeln!(out, "listening on http://{address}").and_then(|()| out.flush());
}

/// Ends with the first SIGTERM or SIGINT.
async fn stop_asked() {
    let signals = (signal(SignalKind::terminate()), signal(SignalKind::interrupt()));
    let (Ok(mut terminate), Ok(mut interrupt)) = signals else {
        tracing::warn!("signals cannot be heard; the server stops only when it is killed");
        return std::future::pending().await;
    };
    tokio::select! {
        _ = terminate.recv() => {}
        _ = interrupt.recv() => {}
    }
}

/// Logs go to standard error: for people on a terminal, JSON elsewhere. `RUST_LOG` filters them.
fn start_log() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    if std::io::stderr().is_terminal() {
        log.init()
    } else {
        log.json().flatten_event(true).with_span_list(false).init()
    }
}
