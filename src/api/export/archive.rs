//! A zip that is sent while it is written, without a thread that waits for its reader.

use super::contents::ExportError;
use bytes::{Bytes, BytesMut};
use futures::{Stream, StreamExt};
use serde::Serialize;
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{Semaphore, mpsc};
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, StreamWriter, ZipWriter};

/// Size of the pieces that are sent.
const PIECE_BYTES: usize = 128 << 10;
/// Size of the pieces that are compressed in one go: each takes half a millisecond, in which its thread serves nobody.
const COMPRESSED_BYTES: usize = 16 << 10;
/// Number of pieces that wait for a slow reader.
const AHEAD: usize = 1;

/// The writing end. The zip writer fills a buffer in memory, and full pieces of it wait for the reader.
pub(super) struct Archive {
    zip: ZipWriter<StreamWriter<Buffer>>,
    outlet: Outlet,
    compressing: Arc<Semaphore>,
}

impl Archive {
    /// Returns an empty archive, which takes turns at `compressing`, and the end from which it is read.
    pub fn new(compressing: Arc<Semaphore>) -> (Archive, mpsc::Receiver<Bytes>) {
        let (pieces, read) = mpsc::channel(AHEAD);
        let buffer = Buffer::default();
        let zip = ZipWriter::new_stream(buffer.clone());
        (Archive { zip, outlet: Outlet { buffer, pieces }, compressing }, read)
    }

    /// Adds a file, compressed.
    pub async fn file(&mut self, name: &str, bytes: &[u8]) -> Result<(), ExportError> {
        self.zip.start_file(name, SimpleFileOptions::default())?;
        for piece in bytes.chunks(COMPRESSED_BYTES) {
            // The semaphore is never closed.
            let turn = self.compressing.acquire().await;
            self.zip.write_all(piece)?;
            drop(turn);
            self.outlet.send_from(PIECE_BYTES).await?;
            // Compression takes time and may produce nothing to wait for: other tasks get a turn.
            tokio::task::yield_now().await;
        }
        Ok(())
    }

    /// Adds a JSON document.
    pub async fn document(&mut self, name: &str, value: &impl Serialize) -> Result<(), ExportError> {
        let text = serde_json::to_vec_pretty(value).map_err(std::io::Error::other)?;
        self.file(name, &text).await
    }

    /// Adds a file as it is read, not compressed: pictures, recordings and floats would not get smaller.
    pub async fn stream<Failure: Into<ExportError>>(
        &mut self,
        name: &str,
        bytes: impl Stream<Item = Result<Bytes, Failure>>,
    ) -> Result<(), ExportError> {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        self.zip.start_file(name, options.large_file(true))?;
        let mut bytes = std::pin::pin!(bytes);
        while let Some(bytes) = bytes.next().await {
            self.zip.write_all(&bytes.map_err(Into::<ExportError>::into)?)?;
            self.outlet.send_from(PIECE_BYTES).await?;
        }
        Ok(())
    }

    /// Writes the directory; without it no program opens the zip.
    pub async fn finish(self) -> Result<(), ExportError> {
        let Archive { zip, outlet, .. } = self;
        zip.finish()?;
        outlet.send_from(1).await
    }
}

/// Sends the bytes of the buffer to the reader.
struct Outlet {
    buffer: Buffer,
    pieces: mpsc::Sender<Bytes>,
}

impl Outlet {
    /// Sends the buffer if it holds at least `bytes`, as soon as the reader has room.
    async fn send_from(&self, bytes: usize) -> Result<(), ExportError> {
        match self.buffer.take_from(bytes) {
            Some(piece) => self.pieces.send(piece).await.map_err(|_| ExportError::Abandoned),
            None => Ok(()),
        }
    }
}

/// Bytes that the zip writer has written and that are not sent yet. The lock is never contended; it is needed
/// because the writer of a streamed zip does not return its target.
#[derive(Clone, Default)]
struct Buffer(Arc<Mutex<BytesMut>>);

impl Buffer {
    fn take_from(&self, bytes: usize) -> Option<Bytes> {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (held.len() >= bytes).then(|| {
            let piece = held.split().freeze();
            // Reuses the memory of sent pieces, if there are any.
            held.reserve(PIECE_BYTES);
            piece
        })
    }
}

impl Write for Buffer {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
