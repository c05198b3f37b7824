//! Connections: their maximum number, their timeouts and their graceful shutdown.

mod crowd;
mod watched;
mod whole;

use super::peer::Peer;
use super::server::ServeError;
use axum::Router;
use axum::body::Body;
use crowd::{Asked, Crowd, Place};
use futures::poll;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutWriter;
use tokio_util::sync::CancellationToken;
use tower::ServiceExt;
use tracing::{debug, info, warn};
use watched::Watched;
use whole::Whole;

/// Timeout for requests under way when the server stops.
const DRAIN: Duration = Duration::from_secs(10);

/// Maximum size of a request's head.
const MAX_HEAD_BYTES: usize = 64 << 10;

/// Limits of connections.
#[derive(Debug, Clone)]
pub struct ConnectionParams {
    /// Timeout for the complete head of a request; then the connection is closed.
    pub head: Duration,
    /// Timeout for a client that reads no byte of a waiting answer; then the connection is closed. Slow
    /// readers and event streams without news are not affected.
    pub write: Duration,
    /// Maximum number of connections. A further one displaces the one of the largest network that has waited longest for
    /// its client.
    pub most: usize,
    /// Maximum number of connections of one address (IPv6: of one network of 64 bits). A further one displaces the one of
    /// this address that has waited longest for its client.
    pub most_of_network: usize,
}

impl Default for ConnectionParams {
    fn default() -> ConnectionParams {
        ConnectionParams {
            head: Duration::from_secs(30),
            write: Duration::from_secs(60),
            most: 4096,
            most_of_network: 2048,
        }
    }
}

/// Maximum of unsent bytes in the kernel. By default it queues megabytes and takes more only after a third is
/// sent: a write to a client that reads 200 kB/s then waits up to 7.5 s, with this limit up to 0.65 s.
#[cfg(target_os = "linux")]
const UNSENT_BYTES: u32 = 128 << 10;

/// Maximum number of accepted connections from which nothing was read yet. If many come at once, the others wait to be
/// accepted, and displace none that was not looked at.
const MAX_UNREAD: usize = 64;

/// Delay after the system failed to accept a connection.
const PAUSE: Duration = Duration::from_millis(500);

/// Answers requests until `stop`, then gives those under way a grace period.
pub(super) async fn answer(
    listener: TcpListener,
    router: Router,
    params: &ConnectionParams,
    stop: &CancellationToken,
    listening: impl FnOnce(SocketAddr),
) -> Result<(), ServeError> {
    let address = listener.local_addr()?;
    info!(%address, "listening");
    listening(address);
    let crowd = Crowd::new(params.most, params.most_of_network);
    let unread = Arc::new(Semaphore::new(MAX_UNREAD));
    let open = GracefulShutdown::new();
    let accept = async {
        loop {
            // The semaphore is never closed.
            let turn = unread.clone().acquire_owned().await;
            let (stream, peer) = match listener.accept().await {
                Ok(accepted) => accepted,
                Err(error) if is_of_one(&error) => continue,
                Err(error) => {
                    warn!(%error, "no connection can be accepted for now");
                    tokio::time::sleep(PAUSE).await;
                    continue;
                }
            };
            if let Err(error) = prepare(&stream) {
                warn!(%error, "a connection keeps the system's defaults");
            }
            let place = crowd.enter(peer.ip());
            let stream = Watched::new(stream, place.clone());
            let connection =
                open.watch(connection(stream, place.clone(), Peer(peer.ip()), router.clone(), params));
            tokio::spawn(async move {
                let mut connection = pin!(connection);
                // Reads what the client has sent.
                let ended = poll!(connection.as_mut());
                drop(turn);
                if ended.is_ready() {
                    return;
                }
                tokio::select! {
                    ended = connection => {
                        if let Err(error) = ended {
                            debug!(%error, "a connection broke");
                        }
                    }
                    () = place.displaced() => debug!("a connection was displaced by a newer one"),
                }
            });
        }
    };
    tokio::select! {
        () = accept => {}
        () = stop.cancelled() => {}
    }
    // Frees the address for the next process.
    drop(listener);
    info!("stopping");
    tokio::select! {
        () = open.shutdown() => {}
        () = tokio::time::sleep(DRAIN) => warn!("requests were still under way and are cut off"),
    }
    Ok(())
}

/// Returns whether an error concerns only the connection that was to be accepted.
fn is_of_one(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    [ConnectionAborted, ConnectionRefused, ConnectionReset].contains(&error.kind())
}

fn connection(
    stream: Watched,
    place: Arc<Place>,
    peer: Peer,
    router: Router,
    params: &ConnectionParams,
) -> impl hyper_util::server::graceful::GracefulConnection<Error = hyper::Error> + use<> {
    let mut stream = TimeoutWriter::new(stream);
    stream.set_timeout(Some(params.write));
    let service = service_fn(move |mut request: hyper::Request<Incoming>| {
        request.extensions_mut().insert(peer);
        let asked = Arc::new(Asked::new(place.clone()));
        let answer = router.clone().oneshot(request.map(|body| Body::new(Whole::new(body, asked.clone()))));
        async move {
            let answer = answer.await;
            asked.answered();
            answer
        }
    });
    http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(params.head)
        .max_buf_size(MAX_HEAD_BYTES)
        .serve_connection(TokioIo::new(Box::pin(stream)), service)
}

fn prepare(stream: &TcpStream) -> io::Result<()> {
    // Small events must not wait for further data.
    stream.set_nodelay(true)?;
    #[cfg(target_os = "linux")]
    socket2::SockRef::from(stream).set_tcp_notsent_lowat(UNSENT_BYTES)?;
    Ok(())
}
