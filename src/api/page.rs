//! The operator's page: homes, their clips, and why a clip failed.

use super::App;
use axum::http::{HeaderName, header};
use axum::response::{IntoResponse, Response};
use axum::{Router, routing};

/// Nothing is loaded from elsewhere, and nothing in a name or reason can run.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

pub(super) fn routes() -> Router<App> {
    Router::new()
        .route("/", routing::get(async || file("text/html; charset=utf-8", include_str!("page/index.html"))))
        .route(
            "/page.css",
            routing::get(async || file("text/css; charset=utf-8", include_str!("page/page.css"))),
        )
        .route(
            "/page.js",
            routing::get(async || file("text/javascript; charset=utf-8", include_str!("page/page.js"))),
        )
}

fn file(media_type: &'static str, text: &'static str) -> Response {
    let headers: [(HeaderName, &str); 3] = [
        (header::CONTENT_TYPE, media_type),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, text).into_response()
}
