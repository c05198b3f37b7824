//! The OpenAPI document and the page that shows it; all its assets come from this binary.

use super::App;
use axum::{Json, Router, routing};
use std::sync::Arc;
use utoipa_swagger_ui::{Config, SwaggerUi};

pub(super) fn routes(document: utoipa::openapi::OpenApi) -> Router<App> {
    let document = Arc::new(document);
    let served = routing::get(move || async move { Json(document.as_ref().clone()) });
    let page = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    Router::new().route("/openapi.json", served).merge(page)
}
