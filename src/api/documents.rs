//! The OpenAPI document and the page that shows it; all its assets come from this binary.

use super::App;
use super::digits::json;
use axum::http::header;
use axum::{Router, routing};
use bytes::Bytes;
use utoipa_swagger_ui::{Config, SwaggerUi};

pub(super) fn routes(document: utoipa::openapi::OpenApi) -> Router<App> {
    let text = Bytes::from(json(&document));
    let served = routing::get(move || async move { ([(header::CONTENT_TYPE, "application/json")], text) });
    let page = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    Router::new().route("/openapi.json", served).merge(page)
}
