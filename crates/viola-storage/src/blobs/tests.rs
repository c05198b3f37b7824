//! Tests of both places, and of the store on the network alone.

mod both;
mod network;
mod secrets;

use super::*;
use crate::conformance::bucket;
use crate::incoming::Arrived;
use tempfile::TempDir;
use viola_testing::s3_server::S3Server;

/// More than three parts; the last one is not full.
const LARGE: usize = (3 << 23) + 12_345;

/// An empty place for blobs.
struct Bench {
    blobs: Blobs,
    folder: TempDir,
    server: Option<S3Server>,
}

impl Bench {
    /// Opens a folder; `incoming` is the path of arriving files below it.
    fn in_folder(incoming: &str) -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let place = BlobPlace::Folder(folder.path().join("blobs"));
        let blobs = Blobs::open(&place, &folder.path().join(incoming)).unwrap();
        Bench { blobs, folder, server: None }
    }

    fn on_s3() -> Bench {
        let (folder, server) = (tempfile::tempdir().unwrap(), S3Server::start());
        let place = BlobPlace::S3(bucket(&server));
        let blobs = Blobs::open(&place, &folder.path().join("incoming")).unwrap();
        Bench { blobs, folder, server: Some(server) }
    }

    /// Opens the same place with other limits.
    fn within(&self, limits: Limits) -> Blobs {
        let place = BlobPlace::S3(bucket(self.server()));
        Blobs::open_within(&place, &self.blobs.incoming, limits).unwrap()
    }

    fn server(&self) -> &S3Server {
        self.server.as_ref().expect("it is on S3")
    }

    /// Returns the file with the bytes of a blob.
    fn path_of(&self, key: &str) -> PathBuf {
        match &self.server {
            Some(server) => server.path_of(key),
            None => self.folder.path().join("blobs").join(key),
        }
    }

    async fn arrived(&self, bytes: &[u8]) -> Arrived {
        let mut incoming = self.blobs.incoming().unwrap();
        incoming.write(bytes).await.unwrap();
        incoming.finish().await.unwrap()
    }

    async fn keep(&self, key: &str, bytes: &[u8]) {
        self.blobs.keep(self.arrived(bytes).await, key).await.unwrap();
    }

    /// Returns all keys, sorted, including those of arriving files.
    async fn keys(&self) -> Vec<String> {
        let mut keys = self.blobs.keys().await.unwrap();
        keys.sort();
        keys
    }

    async fn bytes(&self, key: &str) -> Option<Vec<u8>> {
        self.blobs.read_if_there(key).await.unwrap().map(Vec::from)
    }
}

/// Returns bytes that differ everywhere, so that a wrong order of parts is detected.
fn large() -> Vec<u8> {
    (0..LARGE as u32 / 4 + 1).flat_map(u32::to_le_bytes).take(LARGE).collect()
}
