//! One line of log for every request, joined to everything else it logged by its id.

use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use opentelemetry::global::get_text_map_propagator;
use opentelemetry::propagation::Extractor;
use std::time::Instant;
use tracing::field::Empty;
use tracing::{Instrument, Span, info, info_span};
use tracing_opentelemetry::OpenTelemetrySpanExt;
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
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    let route = request.extensions().get::<MatchedPath>().map(|route| route.as_str().to_owned());
    let span = info_span!(
        "request",
        id = id.to_str().unwrap_or_default(),
        tenant = Empty,
        otel.name = format!("{method} {}", route.as_deref().unwrap_or_default()),
        otel.kind = "server",
        http.request.method = %method,
        http.route = route,
        http.response.status_code = Empty,
    );
    // Fails where no traces are made, or the caller has none.
    let _ = span.set_parent(get_text_map_propagator(|trace| trace.extract(&Headers(request.headers()))));
    let begun = Instant::now();
    async move {
        let mut response = next.run(request).await;
        let milliseconds = begun.elapsed().as_secs_f64() * 1e3;
        let status = response.status().as_u16();
        Span::current().record("http.response.status_code", status);
        info!(%method, path, route, status, milliseconds, "request");
        response.headers_mut().insert(REQUEST_ID, id);
        response
    }
    .instrument(span)
    .await
}

/// Where a caller's trace is told (W3C Trace Context).
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
