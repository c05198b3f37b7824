//! Bodies that are files: requests are streamed to the disk, answers from storage.

use super::App;
use super::error::Error;
use super::metrics;
use super::reply::REVALIDATED;
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
        (header::CACHE_CONTROL, REVALIDATED),
    ];
    (headers, Body::from_stream(blob.stream)).into_response()
}

/// Returns an answer with the name under which a browser saves it (RFC 6266, RFC 8187).
pub(super) fn attachment(mut answer: Response, name: &str) -> Response {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "!#$&+-.^_`|~".contains(c);
    let ascii: String = name
        .chars()
        .map(|c| if c == ' ' || c.is_ascii_graphic() && !"\"\\%/".contains(c) { c } else { '_' })
        .collect();
    let mut value = format!("attachment; filename=\"{ascii}\"");
    if ascii != name {
        value.push_str("; filename*=UTF-8''");
        for c in name.chars() {
            if is_plain(c) {
                value.push(c);
            } else {
                let mut bytes = [0; 4];
                c.encode_utf8(&mut bytes).bytes().for_each(|byte| value.push_str(&format!("%{byte:02X}")));
            }
        }
    }
    if let Ok(value) = HeaderValue::from_str(&value) {
        answer.headers_mut().insert(header::CONTENT_DISPOSITION, value);
    }
    answer
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_a_file_is_sent() {
        for (name, want) in [
            ("clip 1.zip", "attachment; filename=\"clip 1.zip\""),
            ("K\u{fc}che.zip", "attachment; filename=\"K_che.zip\"; filename*=UTF-8''K%C3%BCche.zip"),
            ("a\"b/c\\d.zip", "attachment; filename=\"a_b_c_d.zip\"; filename*=UTF-8''a%22b%2Fc%5Cd.zip"),
        ] {
            let answer = attachment(Response::new(Body::empty()), name);
            assert_eq!(answer.headers()[header::CONTENT_DISPOSITION], want);
        }
    }
}
