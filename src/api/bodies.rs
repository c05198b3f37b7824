//! Bodies that are files: requests are streamed to the disk, answers from storage.

use super::App;
use super::digest::Digests;
use super::error::Error;
use super::fairness::{Arrival, FairPlace};
use super::metrics;
use super::reply::{REVALIDATED, no_body};
use axum::body::{Body, BodyDataStream};
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures::{Stream, StreamExt, stream};
use std::convert::Infallible;
use std::future::Future;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Poll, ready};
use std::time::{Duration, Instant};
use tokio_util::task::AbortOnDropHandle;
use tracing::Instrument;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{KnownFormat, ObjectBuilder, Schema, SchemaFormat, Type};
use utoipa::{PartialSchema, ToSchema};
use viola_storage::{Arrived, BlobReader};

/// Minimum mean rate of a file's body, in each window of time.
const MIN_BYTES_PER_S: f64 = 1024.0;

/// Minimum mean rate at which a client reads a file that was made, in each window of time.
const MIN_READ_BYTES_PER_S: f64 = 4.0 * 1024.0;
const READ_WINDOW: Duration = Duration::from_secs(60);

/// Bytes that a connection takes at a time of a file that was made.
pub(super) const PIECE_BYTES: usize = 64 << 10;

/// Limits of the bodies of requests and answers.
#[derive(Debug, Clone, Copy)]
pub struct BodyParams {
    /// Timeout for a whole JSON body.
    pub json: Duration,
    /// Length of the windows in which a file must arrive at 1024 bytes per second on average. The time that the service
    /// itself takes does not count.
    pub window: Duration,
    /// Interval at which an event stream checks that its caller's key or session is still valid.
    pub credentials: Duration,
    /// Maximum number of bytes of whole files that arrive at once in one process.
    pub process_bytes: u64,
    /// The same of one tenant.
    pub tenant_bytes: u64,
}

impl Default for BodyParams {
    fn default() -> BodyParams {
        let minute = Duration::from_secs(60);
        BodyParams {
            json: Duration::from_secs(10),
            window: minute,
            credentials: minute,
            process_bytes: 64 << 30,
            tenant_bytes: 16 << 30,
        }
    }
}

/// Measures the rate at which a file's body arrives.
pub(super) struct Pace {
    window: Duration,
    /// Time spent on waiting for the client in the current window, and the bytes that came in it.
    waited: Duration,
    bytes: u64,
}

impl Pace {
    pub fn new(window: Duration) -> Pace {
        Pace { window, waited: Duration::ZERO, bytes: 0 }
    }

    /// Returns the next chunk, or none at the end; refuses a body that is too slow.
    pub async fn next(&mut self, chunks: &mut BodyDataStream) -> Result<Option<Bytes>, Error> {
        loop {
            let begun = Instant::now();
            let next = tokio::time::timeout(self.window.saturating_sub(self.waited), chunks.next()).await;
            self.waited += begun.elapsed();
            let chunk = match next {
                Ok(Some(Ok(chunk))) => Some(chunk),
                Ok(Some(Err(error))) => return Err(Error::BodyIncomplete(error.to_string())),
                Ok(None) => return Ok(None),
                Err(_) => None,
            };
            self.bytes += chunk.as_ref().map_or(0, |chunk| chunk.len() as u64);
            if self.waited >= self.window {
                if (self.bytes as f64) < MIN_BYTES_PER_S * self.window.as_secs_f64() {
                    let least = format!("of a file, at least {MIN_BYTES_PER_S} bytes per second must arrive");
                    return Err(Error::BodyStalled(least));
                }
                *self = Pace::new(self.window);
            }
            if chunk.is_some() {
                return Ok(chunk);
            }
        }
    }
}

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

/// Receives a tenant's body of at most `limit` bytes into a file of its own. The second value is dropped when the file is
/// stored or removed.
pub(super) async fn receive(
    app: &App,
    tenant: &str,
    request: Request,
    limit: u64,
) -> Result<(Arrived, Arrival), Error> {
    refuse_form(request.headers())?;
    let digests = Digests::of(request.headers())?;
    let announced_bytes = content_length(request.headers()).unwrap_or_default();
    if announced_bytes > limit {
        return Err(Error::BodyTooLarge { limit });
    }
    let mut arrival = app.arrivals.begin(tenant, announced_bytes)?;
    let mut incoming = app.storage.incoming()?;
    let mut size_bytes = 0;
    let mut chunks = request.into_body().into_data_stream();
    let mut pace = Pace::new(app.bodies.window);
    while let Some(chunk) = pace.next(&mut chunks).await? {
        size_bytes += chunk.len() as u64;
        if size_bytes > limit {
            return Err(Error::BodyTooLarge { limit });
        }
        arrival.grow(chunk.len() as u64)?;
        incoming.write(&chunk).await?;
    }
    if size_bytes == 0 {
        return Err(Error::BodyEmpty);
    }
    let arrived = incoming.finish().await?;
    digests.check(&arrived.sha256)?;
    metrics::received("whole", size_bytes);
    Ok((arrived, arrival))
}

/// Refuses multipart forms, which wrap the file. Other media types are ignored: the content tells the format.
fn refuse_form(headers: &HeaderMap) -> Result<(), Error> {
    if media_type(headers).starts_with("multipart/") {
        let detail = "send the file itself as the body, as Content-Type: application/octet-stream, not a form (curl: \
            --data-binary @FILE or -T FILE)";
        return Err(Error::UnsupportedMediaType(detail.to_owned()));
    }
    Ok(())
}

/// Refuses JSON where no format of a file is JSON: a client library encoded the file, or its sender took the operation for
/// another one.
pub(super) fn refuse_json(headers: &HeaderMap) -> Result<(), Error> {
    if media_type(headers) == "application/json" {
        let detail = "the body came as JSON, and this operation takes a file: send its bytes as Content-Type: \
            application/octet-stream";
        return Err(Error::UnsupportedMediaType(detail.to_owned()));
    }
    Ok(())
}

/// Returns the media type of a body in lower case, without its parameters; empty without one.
pub(super) fn media_type(headers: &HeaderMap) -> String {
    let sent = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    sent.split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

/// Returns an answer with a blob. The blob of a path may change, so caches must revalidate.
pub(super) fn send(blob: BlobReader, media_type: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::CONTENT_LENGTH, HeaderValue::from(blob.size_bytes)),
        (header::CACHE_CONTROL, REVALIDATED),
    ];
    let mut answer = (headers, Body::from_stream(blob.stream)).into_response();
    // For the middleware that serves ranges.
    answer.extensions_mut().insert(blob.parts);
    answer
}

/// Returns an answer with a file of a known size.
pub(super) fn sized((body, size_bytes): (Body, u64), media_type: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::CONTENT_LENGTH, HeaderValue::from(size_bytes)),
    ];
    (headers, body).into_response()
}

/// Returns the answer to HEAD of a file that would be made for the request. Only the making tells the size, so the answer has
/// none (RFC 9110, section 9.3.2).
pub(super) fn head_alone(media_type: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::ACCEPT_RANGES, HeaderValue::from_static("bytes")),
    ];
    (headers, no_body()).into_response()
}

/// Returns an answer with a file that was made in memory. The place is free once the client has it, or has left.
pub(super) fn send_made(bytes: Bytes, media_type: &'static str, place: FairPlace) -> Response {
    let size_bytes = bytes.len() as u64;
    // A connection takes the next piece when it has sent the last one.
    let pieces = stream::unfold(bytes, |mut rest| async move {
        let piece = rest.split_to(rest.len().min(PIECE_BYTES));
        (!piece.is_empty()).then_some((Ok::<_, Infallible>(piece), rest))
    });
    sized((holding(place, pieces), size_bytes), media_type)
}

/// Returns a body that holds a place until it is dropped, or until its client reads too slowly.
pub(super) fn holding<E: Into<axum::BoxError>>(
    place: FairPlace,
    pieces: impl Stream<Item = Result<Bytes, E>> + Send + 'static,
) -> Body {
    holding_at_rate(READ_WINDOW, place, pieces)
}

/// Like [`holding`]. Both the place and the pieces are dropped after a window in which the client read too little.
fn holding_at_rate<E: Into<axum::BoxError>>(
    window: Duration,
    place: FairPlace,
    pieces: impl Stream<Item = Result<Bytes, E>> + Send + 'static,
) -> Body {
    let least_bytes = (MIN_READ_BYTES_PER_S * window.as_secs_f64()) as u64;
    // Layers such as the compression ask again after the end.
    let held = Arc::new(Mutex::new(Some((place, Box::pin(pieces.fuse())))));
    let read_bytes = Arc::new(AtomicU64::new(0));
    let (watched, watched_bytes) = (Arc::downgrade(&held), read_bytes.clone());
    // A task, since nobody asks for the next piece while the client does not read.
    let watch = AbortOnDropHandle::new(tokio::spawn(async move {
        loop {
            tokio::time::sleep(window).await;
            if watched_bytes.swap(0, Ordering::Relaxed) < least_bytes {
                break;
            }
        }
        if let Some(held) = watched.upgrade() {
            held.lock().unwrap_or_else(PoisonError::into_inner).take();
        }
    }));
    Body::from_stream(stream::poll_fn(move |context| {
        let _watch = &watch;
        let mut held = held.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((_, pieces)) = held.as_mut() else {
            return Poll::Ready(Some(Err(axum::BoxError::from("the client reads too slowly"))));
        };
        let piece = ready!(pieces.as_mut().poll_next(context));
        if let Some(Ok(bytes)) = &piece {
            read_bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        }
        Poll::Ready(piece.map(|piece| piece.map_err(Into::into)))
    }))
}

/// Returns an answer that a browser saves, with the name of the file.
pub(super) fn attachment(answer: Response, name: &str) -> Response {
    named(answer, "attachment", name)
}

/// Returns an answer that a browser shows if it can, with the name under which it saves it.
pub(super) fn inline(answer: Response, name: &str) -> Response {
    named(answer, "inline", name)
}

/// Returns an answer with a disposition and the name of its file (RFC 6266, RFC 8187).
fn named(mut answer: Response, disposition: &str, name: &str) -> Response {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "!#$&+-.^_`|~".contains(c);
    let ascii: String = name
        .chars()
        .map(|c| if c == ' ' || c.is_ascii_graphic() && !"\"\\%/".contains(c) { c } else { '_' })
        .collect();
    let mut value = format!("{disposition}; filename=\"{ascii}\"");
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::fairness::FairPlaces;

    #[tokio::test]
    async fn a_made_file_has_its_place_until_it_is_sent() {
        let places = FairPlaces::new(1, 1);
        let file = Bytes::from(vec![7; 2 * PIECE_BYTES + 1]);
        let answer = send_made(file.clone(), "model/ply", places.take("acme").await);
        assert_eq!(answer.headers()[header::CONTENT_LENGTH], file.len().to_string());
        let mut sent = answer.into_body().into_data_stream();
        let mut next = std::pin::pin!(places.take("bolt"));
        for size in [PIECE_BYTES, PIECE_BYTES, 1] {
            assert!(futures::poll!(&mut next).is_pending());
            assert_eq!(sent.next().await.unwrap().unwrap(), vec![7; size]);
        }
        assert!(sent.next().await.is_none());
        assert!(sent.next().await.is_none(), "the compression asks once more");
        drop(sent);
        // A client that leaves frees the place, too.
        drop(send_made(file, "model/ply", next.await));
        places.take("acme").await;
    }

    #[tokio::test]
    async fn a_client_that_reads_too_slowly_loses_its_place() {
        let places = FairPlaces::new(1, 1);
        let pieces = stream::repeat_with(|| Ok::<_, Infallible>(Bytes::from_static(b"piece")));
        let answer = holding_at_rate(Duration::from_millis(20), places.take("acme").await, pieces);
        let mut sent = answer.into_data_stream();
        assert_eq!(sent.next().await.unwrap().unwrap(), "piece");
        places.take("bolt").await;
        assert!(sent.next().await.unwrap().is_err());
    }

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
        let shown = inline(Response::new(Body::empty()), "elm-7-plan.svg");
        assert_eq!(shown.headers()[header::CONTENT_DISPOSITION], "inline; filename=\"elm-7-plan.svg\"");
    }
}
