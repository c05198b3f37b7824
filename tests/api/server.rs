//! A server of one's own on a free port and a fresh data folder.

use crate::common::client::Client;
use std::ops::Deref;
use std::path::PathBuf;
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use viola::api::{ServeParams, UploadParams, serve};
use viola::jobs::WorkerParams;

pub struct Server {
    client: Client,
    folder: TempDir,
    stop: CancellationToken,
    running: JoinHandle<()>,
}

impl Server {
    pub async fn start() -> Server {
        Server::with(|_| {}).await
    }

    /// Without workers, jobs stay queued.
    pub async fn without_workers() -> Server {
        Server::with(|params| params.workers = 0).await
    }

    pub async fn with(change: impl FnOnce(&mut ServeParams)) -> Server {
        let folder = TempDir::new().unwrap();
        let mut params = ServeParams {
            listen: "127.0.0.1:0".parse().unwrap(),
            data: folder.path().to_owned(),
            workers: 1,
            max_upload_bytes: 64 << 20,
            uploads: UploadParams::default(),
            worker: WorkerParams::default(),
        };
        change(&mut params);
        let (told, address) = tokio::sync::oneshot::channel();
        let stop = CancellationToken::new();
        let stopped = stop.clone();
        let running = tokio::spawn(async move {
            serve(params, stopped, |address| told.send(address).unwrap()).await.unwrap();
        });
        let client = Client::new(format!("http://{}", address.await.unwrap()));
        Server { client, folder, stop, running }
    }

    /// Every file of the blob store, also those that are arriving.
    pub fn blobs(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        let mut folders = vec![self.folder.path().join("blobs")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { folders.push(path) } else { files.push(path) }
            }
        }
        files
    }

    /// Stops as on SIGTERM and waits for the end.
    pub async fn stop(self) {
        self.stop.cancel();
        self.running.await.unwrap();
    }
}

impl Deref for Server {
    type Target = Client;

    fn deref(&self) -> &Client {
        &self.client
    }
}
