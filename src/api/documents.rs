//! The OpenAPI document and the page that shows it; all its assets come from this binary.

use super::App;
use super::digits::json;
use axum::http::header;
use axum::{Router, routing};
use bytes::Bytes;
use std::sync::LazyLock;
use utoipa_swagger_ui::{Config, SwaggerUi};

/// One text for all requests: answers that nobody reads take no memory each.
static TEXT: LazyLock<Bytes> = LazyLock::new(|| Bytes::from(json(super::document())));

pub(super) fn routes() -> Router<App> {
    let served = routing::get(async || ([(header::CONTENT_TYPE, "application/json")], TEXT.clone()));
    let page = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    Router::new().route("/openapi.json", served).merge(page)
}
