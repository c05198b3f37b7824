//! `/v1/usage`

use super::App;
use super::access::Caller;
use super::error::Error;
use super::problems::CommonProblems;
use axum::Json;
use axum::extract::State;
use serde::Serialize;

/// Bytes and uploads of a tenant, and its limits
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Usage {
    #[schema(example = "acme")]
    tenant: String,
    /// Size of all files: clips, LiDAR maps, results, maps of homes, and unfinished uploads with all the bytes
    /// that their clients announced
    bytes: u64,
    /// Uploads that would exceed it get 507, `tenant-full`; null: unlimited
    max_bytes: Option<u64>,
    /// Number of unfinished uploads
    uploads: u64,
    max_uploads: u64,
}

/// Get the tenant's usage and limits
#[utoipa::path(get, path = "/v1/usage", tag = "service",
    responses((status = 200, description = "Usage and limits", body = Usage), CommonProblems))]
pub(super) async fn get_usage(State(app): State<App>, caller: Caller) -> Result<Json<Usage>, Error> {
    let tenant = caller.for_all_homes()?;
    let own = app.storage.tenant_limits(tenant).await?;
    Ok(Json(Usage {
        tenant: tenant.name().to_owned(),
        bytes: app.storage.tenant_bytes(tenant).await?,
        max_bytes: own.max_bytes.or(app.limits.storage_bytes),
        uploads: app.storage.unfinished_uploads(tenant).await?,
        max_uploads: own.max_uploads.unwrap_or(app.uploads.limits.in_tenant),
    }))
}
