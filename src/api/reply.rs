//! Documents, entity tags and conditional requests (RFC 9110, 13.1).

use super::digits::json;
use super::error::Error;
use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures::{Stream, stream};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::convert::Infallible;
use viola_storage::StorageError;

/// Caching of answers that may change, and of those that never do. A picture of somebody's home belongs into no shared
/// cache.
pub(super) const REVALIDATED: HeaderValue = HeaderValue::from_static("private, no-cache");
pub(super) const IMMUTABLE: HeaderValue = HeaderValue::from_static("private, max-age=31536000, immutable");

/// Maximum size of a document that gets its tag after it was made.
const MAX_TAGGED_BYTES: u64 = 64 << 20;

/// Paths whose HEAD is an operation of its own: that of tus.
const OWN_HEADS: &str = "/v1/uploads/";

/// A JSON document as an answer.
pub(super) struct Document<T>(pub T);

impl<T: Serialize> IntoResponse for Document<T> {
    fn into_response(self) -> Response {
        json_response(json(&self.0))
    }
}

/// A resource as the answer to its change, with the entity tag that the answer to GET has: the next `If-Match` needs no GET.
pub(super) struct Resource<T>(pub T);

impl<T: Serialize> IntoResponse for Resource<T> {
    fn into_response(self) -> Response {
        let text = json(&self.0);
        let tag = tag_of(&[&text]);
        tagged(json_response(text), &tag)
    }
}

/// Returns the answer with the text of a JSON document.
pub(super) fn json_response(text: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))], text).into_response()
}

/// Returns the answer with an event stream. By default nginx would hold the events back until they fill a buffer.
pub(super) fn event_stream(
    events: impl Stream<Item = Result<Event, axum::Error>> + Send + 'static,
) -> Response {
    let unbuffered = (HeaderName::from_static("x-accel-buffering"), HeaderValue::from_static("no"));
    ([unbuffered], Sse::new(events).keep_alive(KeepAlive::default())).into_response()
}

/// Returns the entity tag of an answer from everything that it depends on.
pub(super) fn tag_of(parts: &[&[u8]]) -> String {
    let mut sum = Sha256::new();
    for part in parts {
        sum.update(part.len().to_le_bytes());
        sum.update(part);
    }
    let sum: String = sum.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    format!("\"{sum}\"")
}

/// Returns the entity tag of a file that is made for a request, from everything that it is made of. Another version of the
/// service may make other bytes of the same.
pub(super) fn tag_of_made(parts: &[&[u8]]) -> String {
    tag_of(&[&[env!("CARGO_PKG_VERSION").as_bytes()][..], parts].concat())
}

/// Returns the entity tag of a document.
pub(super) fn tag_of_document<T: Serialize>(document: &T) -> String {
    tag_of(&[&json(document)])
}

/// Returns whether the client has the answer with this tag.
fn is_known(headers: &HeaderMap, tag: &str) -> bool {
    let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let mut each = known.flat_map(|list| list.split(',')).map(|one| one.trim().trim_start_matches("W/"));
    each.any(|one| one == "*" || one == tag)
}

/// Returns whether a change may go ahead: `If-Match` must have the tag of the document as it is now, and
/// `If-None-Match: *` asks that there is none.
pub(super) fn may_change<T: Serialize>(headers: &HeaderMap, current: Option<&T>) -> bool {
    let Some(current) = current else { return !headers.contains_key(header::IF_MATCH) };
    let tag = tag_of_document(current);
    is_wanted(headers, &tag) && !is_known(headers, &tag)
}

/// Returns whether a request allows to change what is stored: its conditions are about the document `D` of that.
pub(super) fn is_expected<D: From<S> + Serialize, S: Clone>(
    headers: HeaderMap,
) -> impl Fn(&S) -> bool + Send {
    move |stored| may_change(&headers, Some(&D::from(stored.clone())))
}

/// Returns whether a change that changes nothing goes ahead whatever `If-Match` says (RFC 9110, section 13.1.1): it may be
/// the repetition of one with a lost answer. A client with `If-None-Match` asks whether there is something.
pub(super) fn may_repeat(headers: &HeaderMap) -> bool {
    !headers.contains_key(header::IF_NONE_MATCH)
}

/// Returns whether `If-Match` has the tag, or is absent (RFC 9110, section 13.1.1). Beyond the RFC, the weak tag of a
/// compressed answer counts: it names the same document.
pub(super) fn is_wanted(headers: &HeaderMap, tag: &str) -> bool {
    let wanted = headers.get_all(header::IF_MATCH).iter().filter_map(|value| value.to_str().ok());
    let mut wanted = wanted.flat_map(|list| list.split(',')).map(|one| one.trim().trim_start_matches("W/"));
    !headers.contains_key(header::IF_MATCH) || wanted.any(|one| one == "*" || one == tag)
}

/// Returns the refusal of a change, which names the condition that is not met.
pub(super) fn unmet(headers: &HeaderMap, error: StorageError) -> Error {
    match error {
        StorageError::Changed { what } if !headers.contains_key(header::IF_MATCH) => Error::Exists { what },
        error => error.into(),
    }
}

/// Returns the answer with its entity tag, or 304 if the client has it.
pub(super) fn unless_known(headers: &HeaderMap, tag: &str, answer: impl FnOnce() -> Response) -> Response {
    known(headers, tag).unwrap_or_else(|| tagged(answer(), tag))
}

/// Returns 304 if the client has the answer with this tag.
pub(super) fn known(headers: &HeaderMap, tag: &str) -> Option<Response> {
    is_known(headers, tag).then(|| tagged(StatusCode::NOT_MODIFIED.into_response(), tag))
}

/// Returns the answer with its entity tag; caches must revalidate it.
pub(super) fn tagged(mut answer: Response, tag: &str) -> Response {
    if let Ok(tag) = HeaderValue::from_str(tag) {
        answer.headers_mut().insert(header::ETAG, tag);
    }
    answer.headers_mut().insert(header::CACHE_CONTROL, REVALIDATED);
    answer.headers_mut().append(header::VARY, HeaderValue::from_static("accept"));
    answer
}

/// The extension of a HEAD request that is answered as GET. Files that would be made for the answer are not.
#[derive(Clone, Copy)]
pub(super) struct Head;

/// Middleware that gives every document its entity tag, and answers 304 to a client that has it. HEAD is answered as GET
/// without the body, since the tag is that of the body.
pub(super) async fn tag_documents(mut request: Request, next: Next) -> Response {
    let is_head = request.method() == Method::HEAD && !request.uri().path().starts_with(OWN_HEADS);
    if is_head {
        *request.method_mut() = Method::GET;
        request.extensions_mut().insert(Head);
    } else if request.method() != Method::GET {
        return next.run(request).await;
    }
    let conditions = request.headers().clone();
    let answer = tagged_document(&conditions, next.run(request).await).await;
    if is_head { without_body(answer) } else { answer }
}

async fn tagged_document(conditions: &HeaderMap, answer: Response) -> Response {
    let size_bytes = answer.body().size_hint().exact();
    let is_document = answer.status() == StatusCode::OK
        && answer.headers().get(header::CONTENT_TYPE).is_some_and(|kind| kind == "application/json")
        && !answer.headers().contains_key(header::ETAG)
        && size_bytes.is_some_and(|bytes| bytes <= MAX_TAGGED_BYTES);
    if !is_document {
        return answer;
    }
    let (head, body) = answer.into_parts();
    // The body of a document is in memory already.
    let Ok(text) = axum::body::to_bytes(body, MAX_TAGGED_BYTES as usize).await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    let tag = tag_of(&[&text]);
    unless_known(conditions, &tag, || Response::from_parts(head, Body::from(text)))
}

/// Returns an empty body of unknown length: of an empty one axum would tell the length 0, and the compression would leave it as
/// it is.
pub(super) fn no_body() -> Body {
    Body::from_stream(stream::empty::<Result<Bytes, Infallible>>())
}

/// Returns the head of an answer, with the length of its body if that is known.
fn without_body(answer: Response) -> Response {
    let size_bytes = answer.body().size_hint().exact();
    let (mut head, _) = answer.into_parts();
    if let Some(size_bytes) = size_bytes.filter(|_| head.status != StatusCode::NOT_MODIFIED) {
        head.headers.insert(header::CONTENT_LENGTH, HeaderValue::from(size_bytes));
    }
    Response::from_parts(head, no_body())
}
