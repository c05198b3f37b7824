//! For whoever watches over the service.

use super::metrics;
use super::error::{Error, Problem};
use crate::storage::Storage;
use axum::Json;
use axum::extract::State;
use serde::Serialize;
use std::sync::Arc;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Health {
    #[schema(example = "ok")]
    status: &'static str,
    version: &'static str,
}

pub(super) fn routes() -> OpenApiRouter<Arc<Storage>> {
    OpenApiRouter::new()
        .routes(routes!(healthz))
        .routes(routes!(readyz))
        .routes(routes!(metrics::metrics))
}

const HEALTHY: Health = Health { status: "ok", version: env!("CARGO_PKG_VERSION") };

/// Whether the process lives
#[utoipa::path(get, path = "/healthz", tag = "service",
    responses((status = 200, description = "It does", body = Health)))]
async fn healthz() -> Json<Health> {
    Json(HEALTHY)
}

/// Whether the service can serve
#[utoipa::path(get, path = "/readyz", tag = "service",
    responses(
        (status = 200, description = "It can", body = Health),
        (status = 503, description = "Its database does not answer: `not-ready`", body = Problem,
            content_type = "application/problem+json")))]
async fn readyz(State(storage): State<Arc<Storage>>) -> Result<Json<Health>, Error> {
    storage.ready().await.map_err(Error::NotReady)?;
    Ok(Json(HEALTHY))
}
