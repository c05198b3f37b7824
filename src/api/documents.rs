//! The OpenAPI document and the page that shows it; all its assets come from this binary.

use super::App;
use axum::http::header;
use axum::{Router, routing};
use bytes::Bytes;
use utoipa_swagger_ui::{Config, SwaggerUi};

pub(super) fn routes(document: utoipa::openapi::OpenApi) -> Router<App> {
    // One text for all requests: answers that nobody reads take no memory each.
    let document =
        Bytes::from(document.to_json().expect("the document has text keys and cannot fail to serialise"));
    let media_type = [(header::CONTENT_TYPE, "application/json")];
    let served = routing::get(move || async move { (media_type, document) });
    let page = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    Router::new().route("/openapi.json", served).merge(page)
}
