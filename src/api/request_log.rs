//! One line of log for every request, joined to everything else it logged by its id.

use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use std::time::Instant;
use tracing::{Instrument, info, info_span};
use uuid::Uuid;

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
const MAX_ID_BYTES: usize = 128;

/// Takes the client's `x-request-id` when it is harmless, gives one otherwise, and sends it back.
pub(super) async fn log(mut request: Request, next: Next) -> Response {
    let id = request.headers().get(REQUEST_ID).filter(|id| is_harmless(id)).cloned();
    let id = id.unwrap_or_else(|| {
        HeaderValue::from_str(&Uuid::now_v7().to_string()).expect("an UUID is a valid header")
    });
    request.headers_mut().insert(REQUEST_ID, id.clone());
    let span = info_span!("request", id = id.to_str().unwrap_or_default());
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    let route = request.extensions().get::<MatchedPath>().map(|route| route.as_str().to_owned());
    let begun = Instant::now();
    async move {
        let mut response = next.run(request).await;
        let milliseconds = begun.elapsed().as_secs_f64() * 1e3;
        let status = response.status().as_u16();
        info!(%method, path, route, status, milliseconds, "request");
        response.headers_mut().insert(REQUEST_ID, id);
        response
    }
    .instrument(span)
    .await
}

fn is_harmless(id: &HeaderValue) -> bool {
    let bytes = id.as_bytes();
    let allowed = |byte: &u8| byte.is_ascii_alphanumeric() || b"._-".contains(byte);
    !bytes.is_empty() && bytes.len() <= MAX_ID_BYTES && bytes.iter().all(allowed)
}
