//! Reading of blobs, in one piece or as a stream.

use super::limits::Limits;
use super::{Blobs, PAUSES, StorageError, tried};
use bytes::{Bytes, BytesMut};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};
use object_store::path::Path as Key;
use object_store::{GetOptions, GetRange, GetResult, ObjectStore};
use std::ops::Range;
use std::sync::Arc;

/// A blob to be read: its size and the stream of its bytes.
pub struct BlobReader {
    pub size_bytes: u64,
    pub stream: BlobStream,
    /// Opens parts of the same blob.
    pub parts: BlobParts,
}

impl BlobReader {
    /// Returns all bytes in one piece.
    pub async fn all(mut self) -> Result<Bytes, StorageError> {
        let first = self.stream.try_next().await?.unwrap_or_default();
        if first.len() as u64 == self.size_bytes {
            return Ok(first);
        }
        let mut bytes = BytesMut::with_capacity(self.size_bytes as usize);
        bytes.extend_from_slice(&first);
        while let Some(next) = self.stream.try_next().await? {
            bytes.extend_from_slice(&next);
        }
        Ok(bytes.freeze())
    }
}

impl Blobs {
    /// Returns a reader; `None` if the blob was removed since the caller read its row.
    pub async fn read(&self, key: &str) -> Result<Option<BlobReader>, StorageError> {
        match self.begin_to_read(key).await {
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            reader => Ok(Some(reader?)),
        }
    }

    /// Returns a blob in one piece; `None` if it was removed.
    pub async fn read_if_there(&self, key: &str) -> Result<Option<Bytes>, StorageError> {
        match self.read(key).await? {
            Some(reader) => Ok(Some(reader.all().await?)),
            None => Ok(None),
        }
    }

    pub async fn read_all(&self, key: &str) -> Result<Bytes, StorageError> {
        self.begin_to_read(key).await?.all().await
    }

    pub(super) async fn begin_to_read(&self, key: &str) -> object_store::Result<BlobReader> {
        let key = Key::from(key);
        let tries = tried("reading a blob", || self.store.get_opts(&key, GetOptions::default()));
        let found = self.limits.bound(tries).await?;
        let size_bytes = found.meta.size;
        let (store, limits, e_tag) = (self.store.clone(), self.limits, found.meta.e_tag.clone());
        let parts = BlobParts { store, limits, key, e_tag };
        Ok(BlobReader { size_bytes, stream: parts.stream(0..size_bytes, body(found)), parts })
    }
}

/// Opens parts of a blob, for readers that need no other bytes of it.
#[derive(Clone)]
pub struct BlobParts {
    store: Arc<dyn ObjectStore>,
    limits: Limits,
    key: Key,
    e_tag: Option<String>,
}

impl BlobParts {
    /// Returns the stream of the bytes in a range, which must lie in the blob and not be empty.
    pub async fn open(&self, range: Range<u64>) -> Result<BlobStream, StorageError> {
        let tries = tried("reading a part of a blob", || self.get(range.clone()));
        let found = self.limits.bound(tries).await?;
        Ok(self.stream(range, body(found)))
    }

    async fn get(&self, range: Range<u64>) -> object_store::Result<GetResult> {
        let options = GetOptions {
            range: Some(GetRange::Bounded(range)),
            if_match: self.e_tag.clone(),
            ..GetOptions::default()
        };
        self.store.get_opts(&self.key, options).await
    }

    fn stream(&self, rest: Range<u64>, body: Body) -> BlobStream {
        let reading = Reading { blob: self.clone(), rest, body };
        let stream = futures::stream::try_unfold(reading, |mut reading| async move {
            let limits = reading.blob.limits;
            let next = limits.bound(reading.next()).await?;
            Ok(next.map(|bytes| (bytes, reading)))
        });
        stream.boxed()
    }
}

/// The bytes of a blob or of a part of it.
type BlobStream = BoxStream<'static, Result<Bytes, StorageError>>;

type Body = BoxStream<'static, object_store::Result<Bytes>>;

fn body(found: GetResult) -> Body {
    found.into_stream()
}

/// A blob that is being read. A request that ends early is followed by one for the rest: stores cut
/// connections, and a slow reader needs longer than the timeout of one request.
struct Reading {
    blob: BlobParts,
    /// The bytes that are not read yet.
    rest: Range<u64>,
    body: Body,
}

impl Reading {
    async fn next(&mut self) -> object_store::Result<Option<Bytes>> {
        let mut pauses = PAUSES.iter();
        loop {
            let failed = match self.body.try_next().await {
                Ok(Some(bytes)) if bytes.is_empty() => continue,
                Ok(Some(bytes)) => {
                    self.rest.start += bytes.len() as u64;
                    if self.rest.start > self.rest.end {
                        return Err(other_size(&self.rest));
                    }
                    return Ok(Some(bytes));
                }
                Ok(None) | Err(_) if self.rest.is_empty() => return Ok(None),
                Ok(None) => other_size(&self.rest),
                Err(error) => error,
            };
            let Some(pause) = pauses.next() else { return Err(failed) };
            tracing::warn!(key = %self.blob.key, error = %failed, "a blob was cut off; the rest of it is asked for");
            tokio::time::sleep(*pause).await;
            // If this fails too, its own error is returned; `failed` is in the log.
            match self.blob.get(self.rest.clone()).await {
                Ok(found) => self.body = body(found),
                Err(error) => self.body = futures::stream::iter([Err(error)]).boxed(),
            }
        }
    }
}

fn other_size(rest: &Range<u64>) -> object_store::Error {
    let detail = format!("a blob that is read up to byte {} gave {}", rest.end, rest.start);
    let source = std::io::Error::new(std::io::ErrorKind::InvalidData, detail);
    object_store::Error::Generic { store: "blobs", source: source.into() }
}
