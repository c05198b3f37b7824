//! What all commands that go on running share: a log, an end, and the line that says where they listen.

use super::telemetry::Telemetry;
use anyhow::Result;
use std::future::Future;
use std::io::Write;
use std::net::SocketAddr;
use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

/// Runs a service until it ends, or is asked to by SIGTERM or SIGINT.
pub fn run<E, F>(service: impl FnOnce(CancellationToken) -> F) -> Result<()>
where
    E: Into<anyhow::Error>,
    F: Future<Output = Result<(), E>>,
{
    let _telemetry = Telemetry::start()?;
    let runtime = tokio::runtime::Runtime::new()?;
    let ended = runtime.block_on(async {
        let stop = CancellationToken::new();
        let stopping = stop.clone();
        tokio::spawn(async move {
            stop_asked().await;
            stopping.cancel();
        });
        service(stop).await
    });
    // A method that did not stop in its grace would otherwise hold the process.
    runtime.shutdown_background();
    ended.map_err(Into::into)
}

/// The line that scripts wait for.
pub fn print_address(address: SocketAddr) {
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
