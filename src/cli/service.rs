//! Common parts of the commands that keep running: telemetry, shutdown and the line with their address.

use super::telemetry::Telemetry;
use crate::jobs::give_way;
use anyhow::Result;
use std::future::Future;
use std::io::Write;
use std::net::SocketAddr;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

/// Makes a service of its parameters and runs it until it ends; SIGTERM or SIGINT asks it to stop. The log begins before
/// the parameters are made: networks are opened for them.
pub fn run<P, E, F>(
    params: impl FnOnce() -> Result<P>,
    service: impl FnOnce(P, CancellationToken) -> F,
) -> Result<()>
where
    E: Into<anyhow::Error>,
    F: Future<Output = Result<(), E>>,
{
    hide_from_children();
    let _telemetry = Telemetry::start()?;
    let params = params()?;
    // The threads of merges, beside those of requests. A network that was loaded may have started them already.
    if let Err(error) = rayon::ThreadPoolBuilder::new().start_handler(|_| give_way()).build_global() {
        tracing::warn!(%error, "the threads of merges keep the priority of requests");
    }
    let runtime = tokio::runtime::Runtime::new()?;
    let ended = runtime.block_on(async {
        let stop = CancellationToken::new();
        let stopping = stop.clone();
        // Signals are heard from here on, so that a start that waits for the database can be stopped.
        let asked = stop_asked();
        tokio::spawn(async move {
            asked.await;
            stopping.cancel();
        });
        service(params, stop).await
    });
    // Otherwise a method that did not stop within its grace period would block the process.
    runtime.shutdown_background();
    ended.map_err(Into::into)
}

/// Keeps the memory and the environment of this process, which hold its secrets, from other processes of its
/// user, such as the decoders of clips' videos.
fn hide_from_children() {
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{DumpableBehavior, set_dumpable_behavior};
        if let Err(error) = set_dumpable_behavior(DumpableBehavior::NotDumpable) {
            tracing::warn!(%error, "other processes of this user may read the environment of this one");
        }
    }
}

/// Raises the limit of open files to the most that the system allows this process, and returns it.
pub fn raise_open_files() -> u64 {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let maximum = getrlimit(Resource::Nofile).maximum;
    if let Err(error) = setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum }) {
        tracing::warn!(%error, "the limit of open files stays as it is");
    }
    getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX)
}

/// Prints the line that scripts wait for.
pub fn print_address(address: SocketAddr) {
    let mut out = std::io::stdout().lock();
    // The service must run even if nobody reads its output.
    let _ = writeln!(out, "listening on http://{address}").and_then(|()| out.flush());
}

/// Hears signals at once; the future ends at the first SIGTERM or SIGINT.
fn stop_asked() -> impl Future<Output = ()> + Send {
    let signals = (signal(SignalKind::terminate()), signal(SignalKind::interrupt()));
    async move {
        let (Ok(mut terminate), Ok(mut interrupt)) = signals else {
            tracing::warn!("signals cannot be heard; the server stops only when it is killed");
            return std::future::pending().await;
        };
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
    }
}
