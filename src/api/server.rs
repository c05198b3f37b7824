//! A process from start to graceful stop: HTTP with or without workers (`viola serve`), or workers alone (`viola work`).

use super::bodies::BodyParams;
use super::connections::{ConnectionParams, TenantOf};
use super::fairness::{
    Arrivals, FailedKeyParams, FailedKeys, LimitParams, Limits, Makers, ReaderParams, Readers, Turns,
};
use super::layers::Origin;
use super::uploads::{UploadParams, clean};
use super::{App, Shared, access, changes, connections, export, homes, metrics};
use crate::jobs::{self, Queue, WorkerParams};
use crate::webhooks::{self, WebhookParams};
use futures::FutureExt;
use std::net::SocketAddr;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpSocket};
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};
use viola_storage::{Storage, StorageError, StorageParams};

/// Interval at which a process looks whether it must read the database's clock.
const FOLLOW_CLOCK: Duration = Duration::from_secs(5);

/// Maximum time from the last answer to the end of the process. A worker needs its grace period, and then stores results.
const END: Duration = Duration::from_secs(60);

/// Pause before a task that panicked starts again.
const RESTART_AFTER: Duration = Duration::from_secs(1);

/// Parameters of [`serve`].
#[derive(Debug, Clone)]
pub struct ServeParams {
    pub listen: SocketAddr,
    /// Address that serves health and metrics without a key.
    pub admin_listen: Option<SocketAddr>,
    pub storage: StorageParams,
    /// Number of parallel jobs; each job uses all cores if it can. With 0, jobs wait for other processes.
    pub workers: usize,
    /// Maximum size of one clip.
    pub max_upload_bytes: u64,
    pub uploads: UploadParams,
    pub readers: ReaderParams,
    pub limits: LimitParams,
    pub failed_keys: FailedKeyParams,
    pub bodies: BodyParams,
    pub connections: ConnectionParams,
    pub worker: WorkerParams,
    pub webhooks: WebhookParams,
    /// Origins whose pages may call the service, for example `https://app.example`.
    pub cors_origins: Vec<Origin>,
}

impl ServeParams {
    /// Returns the defaults: one job at a time, and clips of at most 2 GiB.
    pub fn new(listen: SocketAddr, storage: StorageParams) -> ServeParams {
        ServeParams {
            listen,
            admin_listen: None,
            storage,
            workers: 1,
            max_upload_bytes: 2 << 30,
            uploads: UploadParams::default(),
            readers: ReaderParams::default(),
            limits: LimitParams::default(),
            failed_keys: FailedKeyParams::default(),
            bodies: BodyParams::default(),
            connections: ConnectionParams::default(),
            worker: WorkerParams::default(),
            webhooks: WebhookParams::default(),
            cors_origins: Vec::new(),
        }
    }
}

/// Parameters of [`work`].
#[derive(Debug, Clone)]
pub struct WorkParams {
    pub storage: StorageParams,
    /// Number of parallel jobs.
    pub workers: usize,
    pub worker: WorkerParams,
    pub webhooks: WebhookParams,
    /// Address for health and metrics; without it they are not served.
    pub listen: Option<SocketAddr>,
}

#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error("cannot listen on {address}: {source}; choose another address with --listen or --admin-listen")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error(
        "{address} can be reached by other machines, and there is no key yet; make one with `viola keys create`, or listen on 127.0.0.1"
    )]
    Open { address: SocketAddr },
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the server failed: {0}")]
    Serve(#[from] std::io::Error),
}

/// Serves until `stop`; calls `listening` with the address once requests are accepted.
pub async fn serve(
    params: ServeParams,
    stop: CancellationToken,
    listening: impl FnOnce(SocketAddr),
) -> Result<(), ServeError> {
    metrics::begin();
    let Some(storage) = open(&params.storage, &stop).await? else { return Ok(()) };
    let prepared = async {
        let has_keys = check_keys(&storage, params.listen).await?;
        Ok((has_keys, bind(params.listen)?, bind_admin(params.admin_listen)?))
    };
    let (has_keys, listener, admin_listener) = closing(&storage, prepared.await).await?;
    let queue = Arc::new(Queue::new(storage.clone()));
    let mut tasks = begin_work(&queue, &storage, params.workers, &params.worker, params.webhooks, &stop);
    let app = App::new(Shared {
        storage: storage.clone(),
        queue,
        max_upload_bytes: params.max_upload_bytes,
        uploads: params.uploads,
        limits: Limits::new(&params.limits),
        turns: Turns::new(storage.connections().max),
        bodies: params.bodies,
        arrivals: Arrivals::new(
            params.bodies.process_bytes,
            params.bodies.tenant_bytes,
            params.max_upload_bytes,
        ),
        failed_keys: FailedKeys::new(params.failed_keys),
        is_on_loopback: params.listen.ip().is_loopback(),
        webhooks: params.webhooks,
        cors_origins: params.cors_origins,
        has_keys: has_keys.into(),
        readers: Readers::new(params.readers),
        makers: Makers::default(),
        waits: changes::waits(),
        searches: homes::searches(),
        exports: export::exports(),
        compressing: Arc::new(Semaphore::new(1)),
        stop: stop.clone(),
    });
    let cleaned = app.clone();
    tasks.spawn(kept_up("cleaner", RESTART_AFTER, move || clean(cleaned.clone())));
    let (watched, ended) = (app.queue.clone(), stop.clone());
    let notify = move || watched.clone().notify_watchers(ended.clone());
    tasks.spawn(kept_up("watchers", RESTART_AFTER, notify));
    let has_admin_listener = admin_listener.is_some();
    if let Some(listener) = admin_listener {
        tasks.spawn(answer_operators(listener, storage.clone(), stop.clone()));
    }
    let tenant_of: TenantOf = {
        let app = app.clone();
        Arc::new(move |headers| access::known_tenant(&app, headers))
    };
    let router = super::router(app, has_admin_listener);
    let answered =
        connections::answer(listener, router, &params.connections, tenant_of, &stop, listening).await;
    end(tasks, &storage, &stop).await;
    answered
}

/// Opens the storage; `None` if the process is asked to stop meanwhile, as while it waits for the database.
async fn open(params: &StorageParams, stop: &CancellationToken) -> Result<Option<Arc<Storage>>, ServeError> {
    tokio::select! {
        opened = Storage::open(params) => Ok(Some(Arc::new(opened?))),
        () = stop.cancelled() => Ok(None),
    }
}

/// Closes the storage after an error: otherwise SQLite's log stays, and would be applied to a copy that replaces the database.
async fn closing<T>(storage: &Storage, prepared: Result<T, ServeError>) -> Result<T, ServeError> {
    if prepared.is_err() {
        storage.close().await;
    }
    prepared
}

/// Runs jobs until `stop`; calls `listening` with the address, if there is one.
pub async fn work(
    params: WorkParams,
    stop: CancellationToken,
    listening: impl FnOnce(SocketAddr),
) -> Result<(), ServeError> {
    metrics::begin();
    let Some(storage) = open(&params.storage, &stop).await? else { return Ok(()) };
    let listener = closing(&storage, params.listen.map(bind).transpose()).await?;
    let queue = Arc::new(Queue::new(storage.clone()));
    let tasks = begin_work(&queue, &storage, params.workers, &params.worker, params.webhooks, &stop);
    info!(workers = params.workers, database = storage.database_name(), "working");
    if !storage.is_shared() {
        warn!(
            "this worker has the SQLite database for itself, and no server can run beside it: `viola serve` serves and works \
             in one process; for several processes give all of them --database-url"
        );
    }
    let answered = match listener {
        Some(listener) => {
            let router = super::health_router(storage.clone());
            let params = ConnectionParams::default();
            connections::answer(listener, router, &params, nobody(), &stop, listening).await
        }
        None => {
            stop.cancelled().await;
            Ok(())
        }
    };
    end(tasks, &storage, &stop).await;
    answered
}

/// Returns whether keys exist. Without keys every caller may do everything, so the address must be loopback.
async fn check_keys(storage: &Storage, address: SocketAddr) -> Result<bool, ServeError> {
    if storage.has_keys().await? {
        return Ok(true);
    }
    if !address.ip().is_loopback() {
        return Err(ServeError::Open { address });
    }
    warn!("there is no key: everybody on this machine may do everything; `viola keys create` makes one");
    Ok(false)
}

/// Maximum number of connections that wait to be accepted, if the system allows so many. Beyond it a client's first packet
/// is dropped, and it tries again after a second.
const BACKLOG: u32 = 4096;

fn bind(address: SocketAddr) -> Result<TcpListener, ServeError> {
    let listen = || {
        let socket = if address.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
        #[cfg(unix)]
        socket.set_reuseaddr(true)?;
        socket.bind(address)?;
        socket.listen(BACKLOG)
    };
    listen().map_err(|source| ServeError::Listen { address, source })
}

/// Binds the second listener, if there is one, and logs its address.
fn bind_admin(address: Option<SocketAddr>) -> Result<Option<TcpListener>, ServeError> {
    let Some(address) = address else { return Ok(None) };
    let listener = bind(address)?;
    info!(address = %listener.local_addr()?, "health and metrics are served without a key");
    Ok(Some(listener))
}

/// Serves health and metrics until `stop`.
async fn answer_operators(listener: TcpListener, storage: Arc<Storage>, stop: CancellationToken) {
    let router = super::health_router(storage);
    let answered =
        connections::answer(listener, router, &ConnectionParams::default(), nobody(), &stop, |_| {}).await;
    if let Err(error) = answered {
        error!(%error, "health and metrics are served no longer");
    }
}

/// Names no tenant: operators have no key.
fn nobody() -> TenantOf {
    Arc::new(|_| None)
}

/// Starts the workers, the tasks that every process has and, if there are workers, the delivery of webhooks.
fn begin_work(
    queue: &Arc<Queue>,
    storage: &Arc<Storage>,
    workers: usize,
    params: &WorkerParams,
    webhooks: WebhookParams,
    stop: &CancellationToken,
) -> JoinSet<()> {
    let mut tasks = JoinSet::new();
    for _ in 0..workers {
        let (queue, params, stop) = (queue.clone(), params.clone(), stop.clone());
        let work = move || jobs::work(queue.clone(), params.clone(), stop.clone());
        tasks.spawn(kept_up("worker", RESTART_AFTER, work));
    }
    if workers > 0 {
        let (queue, storage, stop) = (queue.clone(), storage.clone(), stop.clone());
        let deliver = move || webhooks::deliver(storage.clone(), webhooks, queue.changed(), stop.clone());
        tasks.spawn(kept_up("webhooks", RESTART_AFTER, deliver));
    }
    let (followed, ended) = (storage.clone(), stop.clone());
    let follow = move || follow_clock(followed.clone(), ended.clone());
    tasks.spawn(kept_up("clock", RESTART_AFTER, follow));
    let ended = stop.clone();
    tasks.spawn(kept_up("metrics", RESTART_AFTER, move || metrics::keep_small(ended.clone())));
    let (queue, stop) = (queue.clone(), stop.clone());
    let exchange = move || queue.clone().exchange_signals(stop.clone());
    tasks.spawn(kept_up("signals", RESTART_AFTER, exchange));
    tasks
}

/// Follows the database's clock until `stop`.
async fn follow_clock(storage: Arc<Storage>, stop: CancellationToken) {
    let follow = async {
        loop {
            if let Err(error) = storage.follow_clock().await {
                warn!(%error, "the database's clock could not be read; it is tried again");
            }
            tokio::time::sleep(FOLLOW_CLOCK).await;
        }
    };
    tokio::select! {
        () = stop.cancelled() => {}
        () = follow => {}
    }
}

/// Runs a task, again after each panic: otherwise a part of the service would rest until the next start of the process.
async fn kept_up<F: Future<Output = ()>>(name: &'static str, pause: Duration, start: impl Fn() -> F) {
    loop {
        let task = AssertUnwindSafe(start()).catch_unwind();
        if task.await.is_ok() {
            return;
        }
        error!(task = name, "a task of the service panicked; it starts again");
        tokio::time::sleep(pause).await;
    }
}

/// Ends the tasks and the storage. A database or a store that does not answer must not keep the process from ending: what it
/// leaves is released when its leases expire.
async fn end(mut tasks: JoinSet<()>, storage: &Storage, stop: &CancellationToken) {
    stop.cancel();
    let ended = async {
        while tasks.join_next().await.is_some() {}
        storage.close().await;
    };
    match tokio::time::timeout(END, ended).await {
        Ok(()) => info!("stopped"),
        Err(_) => error!(
            seconds = END.as_secs(),
            "a task of the service did not end in time; the process ends without it"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    #[tokio::test]
    async fn a_task_that_panics_starts_again() {
        let starts = &AtomicU32::new(0);
        let start = || async move {
            assert!(starts.fetch_add(1, Ordering::Relaxed) >= 2, "the first two times");
        };
        kept_up("test", Duration::ZERO, start).await;
        assert_eq!(starts.load(Ordering::Relaxed), 3);
    }
}
