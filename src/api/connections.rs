//! Connections: their maximum number, their timeouts and their graceful shutdown.

mod accept_queue;
mod displacement;
mod watched;
mod whole;

pub(super) use accept_queue::TenantOf;
pub(super) use displacement::Asked;

use super::peer::Peer;
use super::server::ServeError;
use accept_queue::{AcceptQueue, AcceptQueueParams, Lane, lane_of};
use axum::Router;
use axum::body::Body;
use axum::http::header;
use displacement::{OpenConnections, Place};
use futures::poll;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::{GracefulShutdown, Watcher};
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::task::Poll;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;
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
    /// Maximum number of connections. A further one displaces those of the largest network that have waited longest for
    /// their clients: one in 32.
    pub most: usize,
    /// Maximum number of connections of one address (IPv6: of one network of 64 bits). A further one displaces one in 32
    /// of this address.
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

/// New connections of tenants that begin at once: at most about 600 of a tenant in a second. While one begins, its request
/// is read and started; with few at a time the tasks of running requests wait for little else.
const OF_TENANTS: AcceptQueueParams =
    AcceptQueueParams { at_once: 16, at_once_of_lane: 2, hold: Duration::from_millis(3) };
/// The same of clients whose tenant is unknown: at most 500 in a second.
const OF_UNKNOWN: AcceptQueueParams =
    AcceptQueueParams { at_once: 4, at_once_of_lane: 4, hold: Duration::from_millis(8) };

/// Delay after the system failed to accept a connection.
const PAUSE: Duration = Duration::from_millis(500);

/// Answers requests until `stop`, then gives those under way a grace period. Connections of tenants that `tenant_of` knows
/// wait for few of the others.
pub(super) async fn answer(
    listener: TcpListener,
    router: Router,
    params: &ConnectionParams,
    tenant_of: TenantOf,
    stop: &CancellationToken,
    listening: impl FnOnce(SocketAddr),
) -> Result<(), ServeError> {
    let address = listener.local_addr()?;
    info!(%address, "listening");
    listening(address);
    let connections = OpenConnections::new(params.most, params.most_of_network);
    let (tenants, unknown) = (AcceptQueue::new(OF_TENANTS), AcceptQueue::new(OF_UNKNOWN));
    let door =
        Arc::new(Door { tenants, unknown, tenant_of, router, params: params.clone(), stop: stop.clone() });
    let open = GracefulShutdown::new();
    let accept = async {
        loop {
            match listener.accept().await {
                Ok((stream, peer)) => {
                    let place = connections.enter(peer.ip());
                    tokio::spawn(door.clone().enter(stream, peer.ip(), place, open.watcher()));
                }
                Err(error) if is_of_one(&error) => {}
                Err(error) => {
                    warn!(%error, "no connection can be accepted for now");
                    tokio::time::sleep(PAUSE).await;
                }
            }
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

/// State shared by all connections.
struct Door {
    tenants: AcceptQueue,
    /// The lanes of networks.
    unknown: AcceptQueue,
    tenant_of: TenantOf,
    router: Router,
    params: ConnectionParams,
    stop: CancellationToken,
}

impl Door {
    /// Serves a connection to its end, or until another one takes its place.
    async fn enter(self: Arc<Door>, stream: TcpStream, peer: IpAddr, place: Arc<Place>, watcher: Watcher) {
        tokio::select! {
            () = self.serve(stream, peer, place.clone(), watcher) => {}
            () = place.displaced() => debug!("a connection was displaced by a newer one"),
        }
    }

    async fn serve(&self, stream: TcpStream, peer: IpAddr, place: Arc<Place>, watcher: Watcher) {
        let lane = tokio::select! {
            lane = timeout(self.params.head, lane_of(&stream, peer, &self.tenant_of)) => lane,
            () = self.stop.cancelled() => return,
        };
        let Ok(Ok(lane)) = lane else { return debug!("a connection sent nothing") };
        place.came(lane.tenant());
        let begin = match lane {
            Lane::Tenant(tenant) => self.tenants.begin(tenant.name()).await,
            Lane::Network(network) => self.unknown.begin(&network.to_string()).await,
        };
        if let Err(error) = prepare(&stream) {
            warn!(%error, "a connection keeps the system's defaults");
        }
        let connection = self.connection(Watched::new(stream, place.clone()), place, Peer(peer));
        // In a box, for most connections of a flood never come so far.
        let mut connection = Box::pin(watcher.watch(connection));
        // Reads what the client has sent.
        let ended = poll!(connection.as_mut());
        drop(begin);
        let ended = match ended {
            Poll::Ready(ended) => ended,
            Poll::Pending => connection.await,
        };
        if let Err(error) = ended {
            debug!(%error, "a connection broke");
        }
    }

    fn connection(
        &self,
        stream: Watched,
        place: Arc<Place>,
        peer: Peer,
    ) -> impl hyper_util::server::graceful::GracefulConnection<Error = hyper::Error> + use<> {
        let mut stream = TimeoutWriter::new(stream);
        stream.set_timeout(Some(self.params.write));
        let (router, stop) = (self.router.clone(), self.stop.clone());
        let service = service_fn(move |mut request: hyper::Request<Incoming>| {
            request.extensions_mut().insert(peer);
            let asked = Arc::new(Asked::new(place.clone()));
            request.extensions_mut().insert(asked.clone());
            let is_sent = !request.headers().contains_key(header::EXPECT);
            let whole = |body| Body::new(Whole::new(body, asked.clone(), is_sent, stop.clone()));
            let answer = router.clone().oneshot(request.map(whole));
            async move {
                let answer = answer.await;
                asked.answered();
                answer
            }
        });
        http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(self.params.head)
            .max_buf_size(MAX_HEAD_BYTES)
            .serve_connection(TokioIo::new(Box::pin(stream)), service)
    }
}

/// Returns whether an error concerns only the connection that was to be accepted.
fn is_of_one(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    [ConnectionAborted, ConnectionRefused, ConnectionReset].contains(&error.kind())
}

fn prepare(stream: &TcpStream) -> io::Result<()> {
    // Small events must not wait for further data.
    stream.set_nodelay(true)?;
    #[cfg(target_os = "linux")]
    socket2::SockRef::from(stream).set_tcp_notsent_lowat(UNSENT_BYTES)?;
    Ok(())
}
