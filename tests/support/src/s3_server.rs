//! An S3 endpoint for tests, in the process of the test. It checks signatures, keeps objects in a temporary
//! folder, and injects faults. It has a thread and a runtime of its own, so a test needs no further one.

use futures::StreamExt;
use http_body_util::{BodyExt, StreamBody};
use hyper::body::{Frame, Incoming};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::TokioIo;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use s3s::auth::SimpleAuth;
use s3s::service::{S3Service, S3ServiceBuilder};
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinSet;

pub const REGION: &str = "eu-central-1";
/// Prefix of every key.
pub const PREFIX: &str = "homes/one";
pub const BUCKET: &str = "viola-blobs";
pub const ACCESS_KEY_ID: &str = "test-access-key";
pub const SECRET_ACCESS_KEY: &str = "test-secret-of-the-access-key";

/// Fault of the server at a request.
#[derive(Debug, Clone, Copy)]
pub enum Fault {
    /// Does not execute the request and answers with this status.
    Refuse(u16),
    /// Executes the request and answers that it failed.
    Deny,
    /// Does not execute the request and closes the connection.
    Cut,
    /// Executes the request and closes the connection.
    CutAfter,
    /// Executes the request and closes the connection in the middle of the answer.
    CutHalfway,
    /// Executes the request after a delay.
    Slow(Duration),
    /// Does not execute the request and keeps the connection open.
    Silent,
}

/// Plan of faults. The same seed and the same order of requests give the same faults.
#[derive(Debug, Clone)]
pub struct Faults {
    pub seed: u64,
    pub when: When,
    /// All with the same probability; empty for no faults.
    pub kinds: Vec<Fault>,
}

#[derive(Debug, Clone, Copy)]
pub enum When {
    Always,
    /// Every n-th request.
    Every(u64),
    /// This fraction of all requests.
    Share(f64),
    /// Requests with this method.
    Method(&'static str),
}

pub struct S3Server {
    address: SocketAddr,
    folder: TempDir,
    shared: Arc<Shared>,
    /// Orders to listen or not, each with a channel for its completion.
    orders: mpsc::UnboundedSender<(bool, oneshot::Sender<()>)>,
    thread: Option<std::thread::JoinHandle<()>>,
}

struct Shared {
    faults: Mutex<(Faults, ChaCha8Rng)>,
    requests: AtomicU64,
    failed: AtomicU64,
}

impl S3Server {
    /// Starts a server with an empty bucket.
    pub fn start() -> S3Server {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::create_dir(folder.path().join(BUCKET)).expect("a bucket");
        let mut service =
            S3ServiceBuilder::new(s3s_fs::FileSystem::new(folder.path()).expect("the folder is there"));
        service.set_auth(SimpleAuth::from_single(ACCESS_KEY_ID, SECRET_ACCESS_KEY));
        let service = service.build();
        let shared = Arc::new(Shared {
            faults: Mutex::new(seeded(no_faults())),
            requests: AtomicU64::new(0),
            failed: AtomicU64::new(0),
        });
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
        listener.set_nonblocking(true).expect("sockets can be non-blocking");
        let address = listener.local_addr().expect("it is bound");
        let (orders, received) = mpsc::unbounded_channel();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let serving = serve(listener, address, service, shared.clone(), received);
        let thread = std::thread::spawn(move || runtime.block_on(serving));
        S3Server { address, folder, shared, orders, thread: Some(thread) }
    }

    pub fn endpoint(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Returns the path of an object, which need not exist.
    pub fn path_of(&self, key: &str) -> PathBuf {
        self.folder.path().join(BUCKET).join(PREFIX).join(key)
    }

    /// Injects faults from now on, and resets the counts of requests.
    pub fn fail(&self, faults: Faults) {
        let mut current = self.shared.faults.lock().expect("nobody panics with it");
        *current = seeded(faults);
        self.shared.requests.store(0, Ordering::Relaxed);
        self.shared.failed.store(0, Ordering::Relaxed);
    }

    pub fn heal(&self) {
        self.fail(no_faults());
    }

    /// Cuts all connections and accepts none until [`S3Server::listen`]. Objects stay.
    pub fn stop(&self) {
        self.order(false);
    }

    pub fn listen(&self) {
        self.order(true);
    }

    fn order(&self, listen: bool) {
        let (done, mut was_done) = oneshot::channel();
        self.orders.send((listen, done)).expect("the server runs");
        while let Err(oneshot::error::TryRecvError::Empty) = was_done.try_recv() {
            std::thread::yield_now();
        }
    }

    /// Returns the number of requests since [`S3Server::fail`].
    pub fn requests(&self) -> u64 {
        self.shared.requests.load(Ordering::Relaxed)
    }

    /// Returns the number of requests with a fault since [`S3Server::fail`].
    pub fn failed(&self) -> u64 {
        self.shared.failed.load(Ordering::Relaxed)
    }

    /// Returns the number of multipart uploads that were neither completed nor aborted.
    pub fn unfinished_uploads(&self) -> usize {
        let names = std::fs::read_dir(self.folder.path()).expect("the folder is there");
        names
            .filter(|name| name.as_ref().is_ok_and(|name| is_upload(&name.file_name().to_string_lossy())))
            .count()
    }
}

impl Drop for S3Server {
    fn drop(&mut self) {
        // Closing the channel ends the thread; the folder goes after it.
        let (closed, _) = mpsc::unbounded_channel();
        self.orders = closed;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Returns whether a file of s3s-fs is the record of a multipart upload.
fn is_upload(name: &str) -> bool {
    name.starts_with(".upload-") && name.ends_with(".json")
}

fn no_faults() -> Faults {
    Faults { seed: 0, when: When::Always, kinds: vec![] }
}

fn seeded(faults: Faults) -> (Faults, ChaCha8Rng) {
    let random = ChaCha8Rng::seed_from_u64(faults.seed);
    (faults, random)
}

async fn serve(
    listener: std::net::TcpListener,
    address: SocketAddr,
    service: S3Service,
    shared: Arc<Shared>,
    mut orders: mpsc::UnboundedReceiver<(bool, oneshot::Sender<()>)>,
) {
    let mut listener = Some(TcpListener::from_std(listener).expect("inside a runtime"));
    let mut connections = JoinSet::new();
    loop {
        let accept = async {
            match &listener {
                Some(listener) => listener.accept().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            order = orders.recv() => {
                let Some((listen, done)) = order else { return };
                if !listen {
                    listener = None;
                    connections.shutdown().await;
                } else if listener.is_none() {
                    listener = Some(TcpListener::bind(address).await.expect("the port is still free"));
                }
                let _ = done.send(());
            }
            accepted = accept => {
                let Ok((stream, _)) = accepted else { continue };
                let (service, shared) = (service.clone(), shared.clone());
                let answering = service_fn(move |request| answer(service.clone(), shared.clone(), request));
                connections.spawn(http1::Builder::new().serve_connection(TokioIo::new(stream), answering));
            }
            Some(_) = connections.join_next() => {}
        }
    }
}

/// Answers a request, with its fault; an error closes the connection.
async fn answer(
    service: S3Service,
    shared: Arc<Shared>,
    request: Request<Incoming>,
) -> io::Result<Response<s3s::Body>> {
    let fault = shared.next_fault(request.method());
    let work = async || service.call(request.map(s3s::Body::from)).await.map_err(io::Error::other);
    match fault {
        None => work().await,
        Some(Fault::Refuse(status)) => Ok(failure(status)),
        Some(Fault::Deny) => work().await.map(|_| failure(500)),
        Some(Fault::Cut) => Err(io::ErrorKind::ConnectionReset.into()),
        Some(Fault::CutAfter) => work().await.and(Err(io::ErrorKind::ConnectionReset.into())),
        Some(Fault::CutHalfway) => half(work().await?).await,
        Some(Fault::Slow(time)) => {
            tokio::time::sleep(time).await;
            work().await
        }
        Some(Fault::Silent) => std::future::pending().await,
    }
}

impl Shared {
    fn next_fault(&self, method: &Method) -> Option<Fault> {
        let mut faults = self.faults.lock().expect("nobody panics with it");
        let (faults, random) = &mut *faults;
        let request = self.requests.fetch_add(1, Ordering::Relaxed) + 1;
        let hit = match faults.when {
            When::Always => true,
            When::Every(nth) => request.is_multiple_of(nth),
            When::Share(share) => random.random_bool(share),
            When::Method(name) => method.as_str() == name,
        };
        if !hit || faults.kinds.is_empty() {
            return None;
        }
        self.failed.fetch_add(1, Ordering::Relaxed);
        Some(faults.kinds[random.random_range(0..faults.kinds.len())])
    }
}

fn failure(status: u16) -> Response<s3s::Body> {
    let code = if status == 503 { "SlowDown" } else { "InternalError" };
    let body =
        format!("<?xml version=\"1.0\"?><Error><Code>{code}</Code><Message>on order</Message></Error>");
    let mut response = Response::new(s3s::Body::from(body));
    *response.status_mut() = StatusCode::from_u16(status).expect("a status");
    response
}

/// Returns an answer that ends before its declared length.
async fn half(answer: Response<s3s::Body>) -> io::Result<Response<s3s::Body>> {
    let (parts, body) = answer.into_parts();
    let bytes = BodyExt::collect(body).await.map_err(io::Error::other)?.to_bytes();
    if bytes.len() < 2 {
        return Err(io::ErrorKind::ConnectionReset.into());
    }
    let first = Ok(Frame::data(bytes.slice(..bytes.len() / 2)));
    // Later, so that the first half is sent before.
    let cut = async {
        tokio::time::sleep(Duration::from_millis(1)).await;
        Err(io::Error::from(io::ErrorKind::ConnectionReset))
    };
    let frames = futures::stream::iter([first]).chain(futures::stream::once(cut));
    Ok(Response::from_parts(parts, s3s::Body::http_body_unsync(StreamBody::new(frames))))
}
