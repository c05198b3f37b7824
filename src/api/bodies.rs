//! Bodies that are files: requests are streamed to the disk, answers from storage.

use super::App;
use super::error::Error;
use super::metrics;
use crate::storage::{Arrived, BlobReader, Storage};
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use futures::StreamExt;
use std::future::Future;
use std::time::Duration;
use tracing::Instrument;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{KnownFormat, ObjectBuilder, Schema, SchemaFormat, Type};
use utoipa::{PartialSchema, ToSchema};

/// Idle timeout of a request's body.
pub(super) const MAX_SILENCE: Duration = Duration::from_secs(60);

/// The schema of a file's bytes in the OpenAPI document.
pub(super) struct FileBytes;

impl PartialSchema for FileBytes {
    fn schema() -> RefOr<Schema> {
        let binary = SchemaFormat::KnownFormat(KnownFormat::Binary);
        ObjectBuilder::new().schema_type(Type::String).format(Some(binary)).into()
    }
}

impl ToSchema for FileBytes {}

/// Returns the value of `Content-Length`.
pub(super) fn content_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// Receives a body of at most `limit` bytes into a file of its own.
pub(super) async fn receive(storage: &Storage, request: Request, limit: u64) -> Result<Arrived, Error> {
    refuse_form(request.headers())?;
    if content_length(request.headers()).is_some_and(|length| length > limit) {
        return Err(Error::BodyTooLarge { limit });
    }
    let mut incoming = storage.incoming()?;
    let mut size_bytes = 0;
    let mut chunks = request.into_body().into_data_stream();
    loop {
        let chunk = match tokio::time::timeout(MAX_SILENCE, chunks.next()).await {
            Ok(Some(Ok(chunk))) => chunk,
            Ok(Some(Err(error))) => return Err(Error::BodyIncomplete(error.to_string())),
            Ok(None) => break,
            Err(_) => return Err(Error::BodyStalled { seconds: MAX_SILENCE.as_secs() }),
        };
        size_bytes += chunk.len() as u64;
        if size_bytes > limit {
            return Err(Error::BodyTooLarge { limit });
        }
        incoming.write(&chunk).await?;
    }
    if size_bytes == 0 {
        return Err(Error::BodyEmpty);
    }
    let arrived = incoming.finish().await?;
    metrics::received("whole", size_bytes);
    Ok(arrived)
}

/// Refuses multipart forms, which wrap the file. Other media types are ignored: the content tells the format.
fn refuse_form(headers: &HeaderMap) -> Result<(), Error> {
    let media_type =
        headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    if media_type.trim_start().to_ascii_lowercase().starts_with("multipart/") {
        let detail = "send the file itself as the body, not a form (curl: --data-binary @FILE or -T FILE)";
        return Err(Error::UnsupportedMediaType(detail.to_owned()));
    }
    Ok(())
}

/// Returns an answer with a blob. The blob of a path may change, so caches must revalidate.
pub(super) fn send(blob: BlobReader, media_type: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::CONTENT_LENGTH, HeaderValue::from(blob.size_bytes)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
    ];
    (headers, Body::from_stream(blob.stream)).into_response()
}

/// Runs work to its end even if the client disconnects.
pub(super) async fn to_the_end<T: Send + 'static>(work: impl Future<Output = T> + Send + 'static) -> T {
    match tokio::spawn(work.in_current_span()).await {
        Ok(value) => value,
        Err(error) => std::panic::resume_unwind(error.into_panic()),
    }
}

/// Runs the blocking reader of an uploaded file on a thread of its own, once a permit is free.
pub(super) async fn understand<T: Send + 'static>(app: &App, read: impl FnOnce() -> T + Send + 'static) -> T {
    let _place = app.readers.acquire().await.expect("the semaphore is never closed");
    match tokio::task::spawn_blocking(read).await {
        Ok(value) => value,
        Err(error) => std::panic::resume_unwind(error.into_panic()),
    }
}
