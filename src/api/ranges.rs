//! Range requests (RFC 9110, section 14) for every answer of known length that has an entity tag, except JSON: a part of a
//! document is no document.
//!
//! One range of bytes is served. A blob is opened at its first byte; of a file that was made, the bytes around it are left
//! out. A request for several ranges gets the whole answer, as does one that accepts a compressed answer of a compressible
//! type, because its bytes would be others.

use super::bodies::media_type;
use super::compression::{codings, is_text_or_points};
use super::error::Error;
use super::reply::is_wanted;
use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures::StreamExt;
use std::ops::Range;
use viola_storage::{BlobParts, StorageError};

/// Middleware that serves the part that a request asks for.
pub(super) async fn serve_part(request: Request, next: Next) -> Response {
    let wanted = request.headers().get(header::RANGE).filter(|_| request.method() == Method::GET).cloned();
    let only_identity = accepts_only_identity(request.headers());
    let unless_changed = request.headers().get(header::IF_RANGE).cloned();
    let is_read = [Method::GET, Method::HEAD].contains(request.method());
    let has_condition = is_read && request.headers().contains_key(header::IF_MATCH);
    let conditions = has_condition.then(|| request.headers().clone());
    let mut answer = next.run(request).await;
    let tag = answer.headers().get(header::ETAG).and_then(|tag| tag.to_str().ok());
    if let (Some(conditions), Some(tag)) = (conditions, tag)
        && !is_wanted(&conditions, tag)
    {
        return Error::Storage(StorageError::Changed { what: "document" }).into_response();
    }
    let Some(length) = length_of(&answer) else { return answer };
    answer.headers_mut().insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    let has_changed = unless_changed.is_some_and(|tag| answer.headers().get(header::ETAG) != Some(&tag));
    let may_have_part = !has_changed && (only_identity || !is_text_or_points(answer.headers()));
    let Some(wanted) = wanted.filter(|_| may_have_part) else { return answer };
    match wanted.to_str().ok().and_then(|text| parse(text, length)) {
        None => answer,
        Some(Ok(range)) => part(answer, range, length).await,
        Some(Err(NotSatisfiable)) => {
            let whole = [(header::CONTENT_RANGE, format!("bytes */{length}"))];
            (whole, Error::NoSuchRange { length }).into_response()
        }
    }
}

fn accepts_only_identity(headers: &HeaderMap) -> bool {
    codings(headers).all(|(name, weight)| matches!(name.as_str(), "" | "identity") || weight == 0.0)
}

/// Returns the length of an answer of which parts can be served; `None` for others.
fn length_of(answer: &Response) -> Option<u64> {
    let headers = answer.headers();
    let is_whole =
        answer.status() == StatusCode::OK && headers.contains_key(header::ETAG) && !is_json(headers);
    let told = || headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok();
    let known = || answer.body().size_hint().exact();
    if is_whole { told().or_else(known) } else { None }
}

fn is_json(headers: &HeaderMap) -> bool {
    let media_type = media_type(headers);
    media_type == "application/json" || media_type.ends_with("+json")
}

/// The range begins behind the end.
#[derive(Debug, PartialEq, Eq)]
struct NotSatisfiable;

/// Returns the one range of bytes that a header asks for; `None` for anything else, which is ignored.
fn parse(header: &str, length: u64) -> Option<Result<Range<u64>, NotSatisfiable>> {
    let (first, last) = header.strip_prefix("bytes=")?.trim().split_once('-')?;
    let number = |text: &str| -> Option<u64> {
        text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok())?
    };
    let range = match (first, last) {
        ("", suffix) => length.saturating_sub(number(suffix)?)..length,
        (first, "") => number(first)?..length,
        (first, last) => {
            let (first, last) = (number(first)?, number(last)?);
            if first > last {
                return None;
            }
            first..last.saturating_add(1).min(length)
        }
    };
    Some(if range.start < range.end { Ok(range) } else { Err(NotSatisfiable) })
}

async fn part(answer: Response, range: Range<u64>, length: u64) -> Response {
    let (mut head, body) = answer.into_parts();
    let blob = head.extensions.remove::<BlobParts>().filter(|_| range.start > 0);
    let body = match blob {
        None => cut_out(body, range.clone()),
        Some(blob) => match blob.open(range.clone()).await {
            Ok(stream) => Body::from_stream(stream),
            Err(error) => return Error::Storage(error).into_response(),
        },
    };
    head.status = StatusCode::PARTIAL_CONTENT;
    let content_range = format!("bytes {}-{}/{length}", range.start, range.end - 1);
    for (name, text) in [
        (header::CONTENT_RANGE, content_range),
        (header::CONTENT_LENGTH, (range.end - range.start).to_string()),
    ] {
        if let Ok(value) = HeaderValue::from_str(&text) {
            head.headers.insert(name, value);
        }
    }
    Response::from_parts(head, body)
}

/// Returns the bytes of a body that lie in a range.
fn cut_out(body: Body, range: Range<u64>) -> Body {
    let cut = body.into_data_stream().scan(0u64, move |at, chunk| {
        let begin = *at;
        // The stream ends with the range, so that the rest is not made.
        let cut = (begin < range.end).then(|| chunk.map(|bytes| cut(&bytes, begin, &range)));
        if let Some(Ok((_, length))) = &cut {
            *at += length;
        }
        std::future::ready(cut.map(|cut| cut.map(|(bytes, _)| bytes)))
    });
    Body::from_stream(cut)
}

/// Returns the bytes of a chunk at `begin` that lie in the range, and the chunk's length.
fn cut(bytes: &Bytes, begin: u64, range: &Range<u64>) -> (Bytes, u64) {
    let length = bytes.len() as u64;
    let inside = |at: u64| at.saturating_sub(begin).min(length) as usize;
    (bytes.slice(inside(range.start)..inside(range.end)), length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_range_of_bytes_is_understood() {
        for (header, want) in [
            ("bytes=0-0", Some(Ok(0..1))),
            ("bytes=2-5", Some(Ok(2..6))),
            ("bytes=2-", Some(Ok(2..10))),
            ("bytes=-3", Some(Ok(7..10))),
            ("bytes=-30", Some(Ok(0..10))),
            ("bytes=9-18446744073709551615", Some(Ok(9..10))),
            ("bytes=10-", Some(Err(NotSatisfiable))),
            ("bytes=-0", Some(Err(NotSatisfiable))),
            ("bytes=5-2", None),
            ("bytes=0-1,4-5", None),
            ("bytes=+1-2", None),
            ("bytes=a-b", None),
            ("lines=0-1", None),
            ("bytes=99999999999999999999-", None),
        ] {
            assert_eq!(parse(header, 10), want, "{header}");
        }
    }

    #[test]
    fn a_client_that_excludes_all_compression_gets_parts_of_text() {
        for (accepted, want) in [
            ("", true),
            ("identity", true),
            ("Identity;q=0.5, gzip;q=0", true),
            ("gzip; q=0, br;q=0.000", true),
            ("gzip;q=0.5", false),
            ("identity, *", false),
        ] {
            let headers = HeaderMap::from_iter([(header::ACCEPT_ENCODING, accepted.parse().unwrap())]);
            assert_eq!(accepts_only_identity(&headers), want, "{accepted}");
        }
    }

    #[tokio::test]
    async fn a_part_is_cut_out_of_chunks_of_any_size() {
        let whole: Vec<u8> = (0..100).collect();
        for size in [1, 7, 40, 100, 200] {
            for range in [0..1, 0..100, 13..14, 39..81, 99..100] {
                let chunks: Vec<Result<Bytes, std::io::Error>> =
                    whole.chunks(size).map(|chunk| Ok(Bytes::copy_from_slice(chunk))).collect();
                let answer = Response::new(Body::from_stream(futures::stream::iter(chunks)));
                let answer = part(answer, range.start..range.end, 100).await;
                assert_eq!(answer.headers()[header::CONTENT_LENGTH], (range.end - range.start).to_string());
                let body = axum::body::to_bytes(answer.into_body(), 100).await.unwrap();
                assert_eq!(body, whole[range.start as usize..range.end as usize], "{size} {range:?}");
            }
        }
    }
}
