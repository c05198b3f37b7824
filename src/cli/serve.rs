//! `viola serve`

use super::fail;
use crate::api::{ServeParams, serve};
use crate::jobs::WorkerParams;
use std::io::{IsTerminal, Write};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;
use tracing_subscriber::EnvFilter;

/// Serve the HTTP API, with workers in the same process.
#[derive(clap::Args)]
pub(super) struct Serve {
    /// Address and port; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// The data folder; it is made when it is not there.
    #[arg(long, value_name = "DIR", default_value = "viola-data")]
    data: PathBuf,
    /// Jobs at a time.
    #[arg(long, value_name = "N", default_value_t = 1)]
    workers: usize,
    /// Largest clip.
    #[arg(long, value_name = "MIB", default_value_t = 2048)]
    max_upload_mb: u64,
    /// How long a job stays with a worker that gives no sign of life.
    #[arg(long, hide = true, default_value_t = 30.0)]
    lease_seconds: f64,
}

impl Serve {
    pub fn run(&self) -> ExitCode {
        start_log();
        let Ok(lease) = Duration::try_from_secs_f64(self.lease_seconds) else {
            return fail(&std::io::Error::other("--lease-seconds is not a length of time"));
        };
        let params = ServeParams {
            listen: self.listen,
            data: self.data.clone(),
            workers: self.workers,
            max_upload_bytes: self.max_upload_mb.saturating_mul(1 << 20),
            worker: WorkerParams { lease, ..WorkerParams::default() },
        };
        let runtime = match tokio::runtime::Runtime::new() {
            Ok(runtime) => runtime,
            Err(error) => return fail(&error),
        };
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
        match served {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => fail(&error),
        }
    }
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
