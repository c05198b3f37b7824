//! One log line per request; its id joins it to the other log lines of the request.

use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use opentelemetry::global::get_text_map_propagator;
use opentelemetry::propagation::Extractor;
use std::time::Instant;
use tower_http::request_id::{MakeRequestId, RequestId};
use tracing::field::Empty;
use tracing::{Instrument, Span, info, info_span};
use tracing_opentelemetry::OpenTelemetrySpanExt;
use uuid::Uuid;

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
const MAX_ID_BYTES: usize = 128;

/// A new `x-request-id`, for requests that bring none.
#[derive(Clone, Copy)]
pub(super) struct NewId;

impl MakeRequestId for NewId {
    fn make_request_id<B>(&mut self, _: &hyper::Request<B>) -> Option<RequestId> {
        HeaderValue::from_str(&Uuid::now_v7().to_string()).ok().map(RequestId::new)
    }
}

/// Removes an `x-request-id` that could forge a line of log.
pub(super) async fn drop_harmful_id(mut request: Request) -> Request {
    if request.headers().get(REQUEST_ID).is_some_and(|id| !is_harmless(id)) {
        request.headers_mut().remove(REQUEST_ID);
    }
    request
}

/// Logs a request, within a span that has its id.
pub(super) async fn log(request: Request, next: Next) -> Response {
    let id = request.headers().get(REQUEST_ID).and_then(|id| id.to_str().ok()).unwrap_or_default();
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    let route = request.extensions().get::<MatchedPath>().map(|route| route.as_str().to_owned());
    let span = info_span!(
        "request",
        id,
        tenant = Empty,
        otel.name = format!("{method} {}", route.as_deref().unwrap_or_default()),
        otel.kind = "server",
        http.request.method = %method,
        http.route = route,
        http.response.status_code = Empty,
    );
    // Fails if no traces are made, or if the caller sent none.
    let _ = span.set_parent(get_text_map_propagator(|trace| trace.extract(&Headers(request.headers()))));
    let begun = Instant::now();
    async move {
        let response = next.run(request).await;
        let milliseconds = begun.elapsed().as_secs_f64() * 1e3;
        let status = response.status().as_u16();
        Span::current().record("http.response.status_code", status);
        info!(%method, path, route, status, milliseconds, "request");
        response
    }
    .instrument(span)
    .await
}

/// The headers that carry a caller's trace (W3C Trace Context).
struct Headers<'a>(&'a HeaderMap);

impl Extractor for Headers<'_> {
    fn get(&self, name: &str) -> Option<&str> {
        self.0.get(name)?.to_str().ok()
    }

    fn keys(&self) -> Vec<&str> {
        self.0.keys().map(HeaderName::as_str).collect()
    }
}

fn is_harmless(id: &HeaderValue) -> bool {
    let bytes = id.as_bytes();
    let allowed = |byte: &u8| byte.is_ascii_alphanumeric() || b"._-".contains(byte);
    !bytes.is_empty() && bytes.len() <= MAX_ID_BYTES && bytes.iter().all(allowed)
}
