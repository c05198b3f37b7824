//! The OpenAPI document and the page that shows it; all its assets come from this binary.

use super::App;
use super::digits::json;
use super::reply::{tag_of, unless_known};
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use axum::{Router, routing};
use bytes::Bytes;
use std::sync::LazyLock;
use utoipa_swagger_ui::{Config, SwaggerUi};

/// One text for all requests: answers that nobody reads take no memory each.
static TEXT: LazyLock<Bytes> = LazyLock::new(|| Bytes::from(json(super::document())));

static TAG: LazyLock<String> = LazyLock::new(|| tag_of(&[&TEXT]));

async fn serve(headers: HeaderMap) -> Response {
    unless_known(&headers, &TAG, || {
        ([(header::CONTENT_TYPE, "application/json")], TEXT.clone()).into_response()
    })
}

pub(super) fn routes() -> Router<App> {
    let page = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    Router::new().route("/openapi.json", routing::get(serve)).merge(page)
}
