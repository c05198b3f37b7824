//! The OpenAPI document and the page that shows it; all its assets come from this binary.

use super::App;
use super::compression::StaticFile;
use super::digits::json;
use super::reply::{tag_of, unless_known};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::Response;
use axum::{Router, routing};
use std::sync::LazyLock;
use utoipa_swagger_ui::{Config, SwaggerUi};

/// One text for all requests: answers that nobody reads take no memory each.
static TEXT: LazyLock<StaticFile> = LazyLock::new(|| StaticFile::new(json(super::document())));

static TAG: LazyLock<String> = LazyLock::new(|| tag_of(&[TEXT.plain()]));

async fn serve(headers: HeaderMap) -> Response {
    unless_known(&headers, &TAG, || {
        let mut answer = TEXT.answer(&headers);
        answer.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
        answer
    })
}

pub(super) fn routes() -> Router<App> {
    let page = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    Router::new().route("/openapi.json", routing::get(serve)).merge(page)
}
