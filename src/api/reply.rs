//! Entity tags and conditional requests (RFC 9110, 13.1.2).

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};

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

/// Returns whether the client has the answer with this tag.
pub(super) fn is_known(headers: &HeaderMap, tag: &str) -> bool {
    let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let mut each = known.flat_map(|list| list.split(',')).map(|one| one.trim().trim_start_matches("W/"));
    each.any(|one| one == "*" || one == tag)
}

/// Returns whether a change of the resource with this tag may go ahead (RFC 9110, 13.1.1).
pub(super) fn may_change(headers: &HeaderMap, tag: &str) -> bool {
    let mut known = headers.get_all(header::IF_MATCH).iter().peekable();
    let is_unconditional = known.peek().is_none();
    let known = known.filter_map(|value| value.to_str().ok());
    is_unconditional
        || known.flat_map(|list| list.split(',')).map(str::trim).any(|one| one == "*" || one == tag)
}

/// Returns the answer with its entity tag, or 304 if the client has it.
pub(super) fn unless_known(headers: &HeaderMap, tag: &str, answer: impl FnOnce() -> Response) -> Response {
    let answer = if is_known(headers, tag) { StatusCode::NOT_MODIFIED.into_response() } else { answer() };
    tagged(answer, tag)
}

/// Returns the answer with its entity tag; caches must revalidate it.
pub(super) fn tagged(mut answer: Response, tag: &str) -> Response {
    if let Ok(tag) = HeaderValue::from_str(tag) {
        answer.headers_mut().insert(header::ETAG, tag);
    }
    answer.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    answer.headers_mut().insert(header::VARY, HeaderValue::from_static("accept"));
    answer
}
