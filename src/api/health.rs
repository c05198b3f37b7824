//! Liveness and readiness, for monitoring.

use super::error::{Error, Problem};
use super::metrics;
use super::problems::KeyProblems;
use crate::storage::{Storage, StorageError};
use axum::Json;
use axum::extract::State;
use jiff::Timestamp;
use serde::Serialize;
use std::sync::Arc;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Minimum free space on the disk of incoming files; with less, the process is not ready.
const MIN_FREE_BYTES: u64 = 256 << 20;

/// Returns the route for anybody.
pub(super) fn open_routes() -> OpenApiRouter<Arc<Storage>> {
    OpenApiRouter::new().routes(routes!(healthz))
}

/// Returns the routes for operators: they tell of all tenants' work, and each costs a query.
pub(super) fn routes() -> OpenApiRouter<Arc<Storage>> {
    OpenApiRouter::new().routes(routes!(readyz)).routes(routes!(metrics::metrics))
}

#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Health {
    #[schema(example = "ok")]
    status: &'static str,
    version: &'static str,
}

/// State of a process that can serve.
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Readiness {
    #[schema(example = "ok")]
    status: &'static str,
    version: &'static str,
    #[schema(example = "postgresql")]
    database: &'static str,
    /// Free space on the disk of incoming files.
    free_bytes: u64,
    queued: u64,
    running: u64,
    /// Waiting time of the job that has been due longest.
    #[schema(example = 1.5)]
    queue_age_s: f64,
    /// Number of homes whose fused map is out of date.
    merges_due: u64,
}

/// Check liveness
#[utoipa::path(get, path = "/healthz", tag = "service", security(()),
    responses((status = 200, description = "The process is alive", body = Health)))]
async fn healthz() -> Json<Health> {
    Json(Health { status: "ok", version: env!("CARGO_PKG_VERSION") })
}

/// Check readiness
///
/// The service is ready if its database answers and can write, its blobs can be written and read, and the
/// disk has room for incoming files. After a write that failed for lack of room, the answer is 503 for at
/// least five seconds. The length of the queue says nothing about this process and has no effect. With
/// `--admin-listen` only that listener serves this, without a key.
#[utoipa::path(get, path = "/readyz", tag = "service",
    responses(
        (status = 200, description = "The service is ready", body = Readiness),
        (status = 503, description = "Its database or its blobs do not answer, or a disk is full: `not-ready`; `field` is \
            `database`, `blobs` or `disk`",
            body = Problem, content_type = "application/problem+json"),
        KeyProblems))]
async fn readyz(State(storage): State<Arc<Storage>>) -> Result<Json<Readiness>, Error> {
    let not_ready =
        |what: &'static str| move |error: StorageError| Error::NotReady { what, cause: Some(error) };
    let queue = storage.queue_state(Timestamp::now()).await.map_err(not_ready("database"))?;
    let free_bytes = storage.blobs_ready().await.map_err(not_ready("blobs"))?;
    if free_bytes < MIN_FREE_BYTES {
        return Err(Error::NotReady { what: "disk", cause: None });
    }
    storage.check_writes().await.map_err(|error| {
        let what = if error.is_full() { "disk" } else { "database" };
        Error::NotReady { what, cause: Some(error) }
    })?;
    Ok(Json(Readiness {
        status: "ok",
        version: env!("CARGO_PKG_VERSION"),
        database: storage.database_name(),
        free_bytes,
        queued: queue.queued,
        running: queue.running,
        queue_age_s: queue.age.as_secs_f64(),
        merges_due: queue.merges_due,
    }))
}
