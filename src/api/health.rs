//! For whoever watches over the service.

use super::error::{Error, Problem};
use super::metrics;
use crate::storage::{Storage, StorageError};
use axum::Json;
use axum::extract::State;
use jiff::Timestamp;
use serde::Serialize;
use std::sync::Arc;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// With less free than this on the disk of files that arrive, a process is not given more.
const LEAST_FREE_BYTES: u64 = 256 << 20;

pub(super) fn routes() -> OpenApiRouter<Arc<Storage>> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz)).routes(routes!(metrics::metrics))
}

#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Health {
    #[schema(example = "ok")]
    status: &'static str,
    version: &'static str,
}

/// What a process that can serve stands on.
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Readiness {
    #[schema(example = "ok")]
    status: &'static str,
    version: &'static str,
    #[schema(example = "postgresql")]
    database: &'static str,
    /// On the disk of files that arrive.
    free_bytes: u64,
    queued: u64,
    running: u64,
    /// How long the job that has been due longest has waited.
    #[schema(example = 1.5)]
    queue_age_s: f64,
    /// Homes whose map is behind.
    merges_due: u64,
}

/// Whether the process lives
#[utoipa::path(get, path = "/healthz", tag = "service", security(()),
    responses((status = 200, description = "It does", body = Health)))]
async fn healthz() -> Json<Health> {
    Json(Health { status: "ok", version: env!("CARGO_PKG_VERSION") })
}

/// Whether the service can serve
///
/// Its database answers and can write, its blobs can be written and read, and there is room for files that arrive. After
/// a write that failed for want of room the answer is 503 for five seconds at least. How long the queue is tells nothing
/// about this process, and does not make it unready.
#[utoipa::path(get, path = "/readyz", tag = "service", security(()),
    responses(
        (status = 200, description = "It can", body = Readiness),
        (status = 503, description = "Its database or its blobs do not answer, or a disk is full: `not-ready`; `field` is \
            `database`, `blobs` or `disk`",
            body = Problem, content_type = "application/problem+json")))]
async fn readyz(State(storage): State<Arc<Storage>>) -> Result<Json<Readiness>, Error> {
    let not_ready =
        |what: &'static str| move |error: StorageError| Error::NotReady { what, cause: Some(error) };
    let queue = storage.queue_state(Timestamp::now()).await.map_err(not_ready("database"))?;
    let free_bytes = storage.blobs_ready().await.map_err(not_ready("blobs"))?;
    if free_bytes < LEAST_FREE_BYTES {
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
