//! For whoever watches over the service.

use super::App;
use super::error::{Error, Problem};
use axum::Json;
use axum::extract::State;
use serde::Serialize;

#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Health {
    #[schema(example = "ok")]
    status: &'static str,
    version: &'static str,
}

const HEALTHY: Health = Health { status: "ok", version: env!("CARGO_PKG_VERSION") };

/// Whether the process lives
#[utoipa::path(get, path = "/healthz", tag = "service",
    responses((status = 200, description = "It does", body = Health)))]
pub(super) async fn healthz() -> Json<Health> {
    Json(HEALTHY)
}

/// Whether the service can serve
#[utoipa::path(get, path = "/readyz", tag = "service",
    responses(
        (status = 200, description = "It can", body = Health),
        (status = 503, description = "Its database does not answer: `not-ready`", body = Problem,
            content_type = "application/problem+json")))]
pub(super) async fn readyz(State(app): State<App>) -> Result<Json<Health>, Error> {
    app.storage.ready().await.map_err(Error::NotReady)?;
    Ok(Json(HEALTHY))
}
