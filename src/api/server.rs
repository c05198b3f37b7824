//! The server: storage, workers and HTTP in one process, from start to graceful stop.

use super::App;
use super::uploads::{UploadParams, clean};
use crate::jobs::{Queue, WorkerParams, work};
use crate::storage::{Storage, StorageError};
use axum::serve::ListenerExt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

/// How long requests under way may take to end when the server stops.
const DRAIN: Duration = Duration::from_secs(10);

/// Uploaded files that are opened at the same time.
const READERS: usize = 4;

/// How to serve.
#[derive(Debug, Clone)]
pub struct ServeParams {
    pub listen: SocketAddr,
    /// The data folder.
    pub data: PathBuf,
    /// Jobs at a time; each uses all cores where it can.
    pub workers: usize,
    /// Of one clip.
    pub max_upload_bytes: u64,
    pub uploads: UploadParams,
    pub worker: WorkerParams,
}

#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error("cannot listen on {address}: {source}; choose another address with --listen")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("the server failed: {0}")]
    Serve(#[from] std::io::Error),
}

/// Serves until `stop`; `listening` is told the address once requests are accepted.
pub async fn serve(
    params: ServeParams,
    stop: CancellationToken,
    listening: impl FnOnce(SocketAddr),
) -> Result<(), ServeError> {
    let storage = Arc::new(Storage::open(&params.data).await?);
    let listen_error = |source| ServeError::Listen { address: params.listen, source };
    let listener = TcpListener::bind(params.listen).await.map_err(listen_error)?;
    let address = listener.local_addr().map_err(listen_error)?;
    let queue = Arc::new(Queue::new(storage.clone()));

    let mut workers = JoinSet::new();
    for _ in 0..params.workers {
        workers.spawn(work(queue.clone(), params.worker.clone(), stop.clone()));
    }
    let app = App {
        storage: storage.clone(),
        queue,
        max_upload_bytes: params.max_upload_bytes,
        uploads: Arc::new(params.uploads),
        readers: Arc::new(Semaphore::new(READERS)),
        stop: stop.clone(),
    };
    workers.spawn(clean(app.clone()));
    // Events are small and must not wait for more to come.
    let listener = listener.tap_io(|stream| {
        if let Err(error) = stream.set_nodelay(true) {
            warn!(%error, "a connection keeps Nagle's delay");
        }
    });
    let served =
        axum::serve(listener, super::router(app)).with_graceful_shutdown(stop.clone().cancelled_owned());
    info!(%address, data = %params.data.display(), "listening");
    listening(address);

    let drained = async {
        stop.cancelled().await;
        info!("stopping");
        tokio::time::sleep(DRAIN).await;
    };
    tokio::select! {
        served = served.into_future() => served?,
        () = drained => warn!("requests were still under way and are cut off"),
    }
    stop.cancel();
    while workers.join_next().await.is_some() {}
    storage.close().await;
    info!("stopped");
    Ok(())
}
