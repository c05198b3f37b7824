//! Compression of answers: files of the binary once, all other text and points while they are sent, in turns.

use super::bodies::media_type;
use axum::body::{Body, HttpBody};
use axum::extract::{Request, State};
use axum::http::{Extensions, HeaderMap, HeaderValue, StatusCode, Version, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use flate2::Compression;
use flate2::write::GzEncoder;
use hyper::body::Frame;
use std::io::Write;
use std::pin::Pin;
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll, ready};
use tokio::sync::Semaphore;
use tokio_util::sync::PollSemaphore;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{And, Predicate, SizeAbove};

/// Minimum size of a compressed answer: a shorter one is one packet either way.
const MIN_BYTES: u64 = 1024;

type IsCompressed = fn(StatusCode, Version, &HeaderMap, &Extensions) -> bool;

/// Compresses text and points by gzip or Brotli, if the client accepts one. Pictures and archives are
/// compressed already, and events must not wait in a buffer.
pub(super) fn compression() -> CompressionLayer<And<SizeAbove, IsCompressed>> {
    let is_compressed: IsCompressed = |_, _, headers, _| is_text_or_points(headers);
    CompressionLayer::new().compress_when(SizeAbove::new(MIN_BYTES).and(is_compressed))
}

/// Returns whether an answer may be compressed.
pub(super) fn is_text_or_points(headers: &HeaderMap) -> bool {
    match media_type(headers).as_str() {
        "text/event-stream" => false,
        "application/javascript" | "application/json" | "image/svg+xml" => true,
        other => other.starts_with("text/") || other.starts_with("model/") || other.ends_with("+json"),
    }
}

/// Returns the codings that a client names, in lower case, with their weights.
pub(super) fn codings(headers: &HeaderMap) -> impl Iterator<Item = (String, f32)> {
    let accepted = headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    accepted.flat_map(|list| list.split(',')).map(coding)
}

/// Parses a coding and its weight, by default 1 (RFC 9110, section 12.5.3).
fn coding(text: &str) -> (String, f32) {
    let text = text.to_ascii_lowercase();
    let (name, weight) = text.split_once(';').unwrap_or((text.as_str(), ""));
    let weight = weight.trim().strip_prefix("q=").and_then(|weight| weight.trim().parse().ok());
    (name.trim().to_owned(), weight.unwrap_or(1.0))
}

/// Removes what forbids an answer without compression: it would be answered by 406 after its change was made. A server may
/// ignore it (RFC 9110, section 12.5.3).
fn allow_identity(headers: &mut HeaderMap) {
    let forbids = |text: &str| {
        let (name, weight) = coding(text);
        matches!(name.as_str(), "identity" | "*") && weight == 0.0
    };
    let accepted = headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    let (forbidding, kept): (Vec<&str>, Vec<&str>) =
        accepted.flat_map(|value| value.split(',')).partition(|coding| forbids(coding));
    if !forbidding.is_empty() {
        let kept = HeaderValue::from_str(&kept.join(",")).ok();
        headers.remove(header::ACCEPT_ENCODING);
        headers.extend(kept.map(|kept| (header::ACCEPT_ENCODING, kept)));
    }
}

/// Returns the turns of the answers that are compressed while they are sent: half of the processors are left to others.
pub(super) fn turns() -> Arc<Semaphore> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    Arc::new(Semaphore::new(processors.div_ceil(2)))
}

/// Middleware around [`compression`]. Compressed answers take turns. Their entity tags become weak, since the answer has
/// other bytes without compression (RFC 9110, section 8.8.3.3).
pub(super) async fn in_turns(
    State(turns): State<Arc<Semaphore>>,
    mut request: Request,
    next: Next,
) -> Response {
    allow_identity(request.headers_mut());
    let mut answer = next.run(request).await;
    if !answer.headers().contains_key(header::CONTENT_ENCODING) {
        return answer;
    }
    let tag = answer.headers().get(header::ETAG).and_then(|tag| tag.to_str().ok());
    let weak = tag.filter(|tag| !tag.starts_with("W/")).map(|tag| format!("W/{tag}"));
    if let Some(weak) = weak.and_then(|tag| HeaderValue::from_str(&tag).ok()) {
        answer.headers_mut().insert(header::ETAG, weak);
    }
    // The size of a file that was compressed before is known.
    if answer.body().size_hint().exact().is_some() {
        return answer;
    }
    answer.map(|body| Body::new(InTurns { body, turns: PollSemaphore::new(turns), has_sent: false }))
}

/// A body that is compressed while it is sent. It has a turn while a piece is made, and none while its client reads.
struct InTurns {
    body: Body,
    turns: PollSemaphore,
    has_sent: bool,
}

impl HttpBody for InTurns {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        // Other tasks of this thread run between two pieces.
        if std::mem::take(&mut self.has_sent) {
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        let _turn = ready!(self.turns.poll_acquire(context));
        let piece = Pin::new(&mut self.body).poll_frame(context);
        self.has_sent = piece.is_ready();
        piece
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }
}

/// A file of the binary, and its gzip from the first request for it on.
pub(super) struct StaticFile {
    plain: Bytes,
    gzip: OnceLock<Bytes>,
}

impl StaticFile {
    pub fn new(plain: impl Into<Bytes>) -> StaticFile {
        StaticFile { plain: plain.into(), gzip: OnceLock::new() }
    }

    /// Returns the bytes without compression.
    pub fn plain(&self) -> &Bytes {
        &self.plain
    }

    /// Returns the answer with the file, compressed if the client accepts gzip.
    pub fn answer(&self, headers: &HeaderMap) -> Response {
        let vary = (header::VARY, HeaderValue::from_static("accept-encoding"));
        if !accepts_gzip(headers) || (self.plain.len() as u64) < MIN_BYTES {
            return ([vary], self.plain.clone()).into_response();
        }
        let encoding = (header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
        ([vary, encoding], self.gzip.get_or_init(|| gzip(&self.plain)).clone()).into_response()
    }
}

fn gzip(bytes: &[u8]) -> Bytes {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    let packed = encoder.write_all(bytes).and_then(|()| encoder.finish());
    Bytes::from(packed.expect("memory takes all bytes"))
}

/// Returns whether a client names gzip and does not exclude it (RFC 9110, section 12.5.3).
fn accepts_gzip(headers: &HeaderMap) -> bool {
    codings(headers).any(|(name, weight)| name == "gzip" && weight > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::{StreamExt, poll};

    #[tokio::test]
    async fn a_compressed_answer_has_a_turn_only_while_it_is_made() {
        let turns = Arc::new(Semaphore::new(1));
        let answer = || {
            let turns = PollSemaphore::new(turns.clone());
            Body::new(InTurns { body: Body::from("piece"), turns, has_sent: false }).into_data_stream()
        };
        let (mut first, mut second) = (answer(), answer());
        let held = turns.acquire().await.unwrap();
        assert!(poll!(first.next()).is_pending());
        drop(held);
        assert_eq!(first.next().await.unwrap().unwrap(), "piece");
        // The client of the first one reads no further.
        assert_eq!(second.next().await.unwrap().unwrap(), "piece");
        assert!(poll!(second.next()).is_pending(), "other tasks run between two pieces");
        assert!(second.next().await.is_none() && first.next().await.is_none());
    }

    #[test]
    fn gzip_is_for_clients_that_name_it() {
        for (accepted, want) in [
            ("gzip", true),
            ("br, GZIP ;q=0.5", true),
            ("gzip;q=0", false),
            ("gzip;q=0.000, br", false),
            ("br, zstd", false),
            ("", false),
        ] {
            let headers = HeaderMap::from_iter([(header::ACCEPT_ENCODING, accepted.parse().unwrap())]);
            assert_eq!(accepts_gzip(&headers), want, "{accepted}");
        }
    }
}
