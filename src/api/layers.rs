//! The layer for pages of other origins: CORS.

use axum::extract::{Request, State};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use std::str::FromStr;
use std::time::Duration;
use tower::{Layer, ServiceExt};
use tower_http::cors::{AllowHeaders, CorsLayer};
use url::Url;

/// Time for which a browser may cache the answer to a preflight request.
const PREFLIGHT_LIFE: Duration = Duration::from_secs(600);

/// A web origin (RFC 6454): a scheme, a host, and a port if it is not the scheme's default.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin(HeaderValue);

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("an origin is a scheme, a host and, if it is not the scheme's own, a port: https://app.example")]
pub struct InvalidOrigin;

impl FromStr for Origin {
    type Err = InvalidOrigin;

    fn from_str(text: &str) -> Result<Origin, InvalidOrigin> {
        let origin = Url::parse(text).map_err(|_| InvalidOrigin)?.origin().ascii_serialization();
        if origin != text.trim_end_matches('/') {
            return Err(InvalidOrigin);
        }
        HeaderValue::from_str(&origin).map(Origin).map_err(|_| InvalidOrigin)
    }
}

impl Origin {
    /// Returns whether this is the origin of an `Origin` header.
    pub(super) fn is(&self, header: &HeaderValue) -> bool {
        self.0 == header
    }
}

/// Middleware of [`cors`]. The layer takes every OPTIONS for a preflight; one without `Access-Control-Request-Method` is a
/// request as any other: tus asks so for the abilities of the service.
pub(super) async fn allow_origins(
    State(cors): State<CorsLayer>,
    mut request: Request,
    next: Next,
) -> Response {
    let is_request = request.method() == Method::OPTIONS
        && !request.headers().contains_key(header::ACCESS_CONTROL_REQUEST_METHOD);
    if is_request {
        *request.method_mut() = Method::GET;
    }
    let served = next.map_request(move |mut request: Request| {
        if is_request {
            *request.method_mut() = Method::OPTIONS;
        }
        request
    });
    match cors.layer(served).oneshot(request).await {
        Ok(answer) => answer,
        Err(never) => match never {},
    }
}

/// Returns the layer that lets pages of `origins` call the service (CORS, Fetch standard) and read the
/// headers of tus and of errors. Returns none without origins: browsers then refuse pages of other origins.
pub(super) fn cors(origins: &[Origin]) -> Option<CorsLayer> {
    if origins.is_empty() {
        return None;
    }
    let exposed = [
        "accept-ranges",
        "content-disposition",
        "content-range",
        "etag",
        "location",
        "retry-after",
        "tus-checksum-algorithm",
        "tus-extension",
        "tus-max-size",
        "tus-resumable",
        "tus-version",
        "upload-concat",
        "upload-defer-length",
        "upload-expires",
        "upload-length",
        "upload-metadata",
        "upload-offset",
        "viola-clip",
        "viola-job",
        "x-request-id",
    ];
    let methods = [Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::PATCH, Method::DELETE];
    Some(
        CorsLayer::new()
            .allow_origin(origins.iter().map(|origin| origin.0.clone()).collect::<Vec<_>>())
            .allow_methods(methods)
            .allow_headers(AllowHeaders::mirror_request())
            .expose_headers(exposed.map(HeaderName::from_static))
            .max_age(PREFLIGHT_LIFE),
    )
}
