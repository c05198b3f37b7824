//! Liveness and readiness, for monitoring.

use super::error::Error;
use super::metrics;
use super::problems::KeyProblems;
use axum::Json;
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, timeout, timeout_at};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use viola_storage::{Storage, StorageError};

/// Minimum free space on the disk of incoming files; with less, the process is not ready.
const MIN_FREE_BYTES: u64 = 256 << 20;

/// Maximum time of an answer to `/readyz`, with the look-up of its key. It comes even if the database hangs.
const READY: Duration = Duration::from_millis(2800);

/// Maximum time of all checks together.
const CHECKS: Duration = Duration::from_millis(2500);

/// Answers a request for readiness in time, even if the look-up of its key waits for the database.
pub(super) async fn in_time(request: Request, next: Next) -> Response {
    if request.uri().path() != "/readyz" {
        return next.run(request).await;
    }
    match timeout(READY, next.run(request)).await {
        Ok(answer) => answer,
        Err(_) => {
            let silent = StorageError::Silent { limit_s: READY.as_secs_f64() };
            Error::NotReady { what: "database", cause: Some(silent) }.into_response()
        }
    }
}

/// Returns the result of a check, which ends at a deadline.
pub(super) async fn by<T>(
    deadline: Instant,
    check: impl Future<Output = Result<T, StorageError>>,
) -> Result<T, StorageError> {
    let silent = |_| StorageError::Silent { limit_s: CHECKS.as_secs_f64() };
    timeout_at(deadline, check).await.map_err(silent)?
}

/// Returns a number that readiness does not depend on; `None` if it was not there at the deadline.
fn if_in_time<T>(counted: Result<T, StorageError>) -> Result<Option<T>, StorageError> {
    match counted {
        Err(error @ StorageError::Silent { .. }) => {
            tracing::warn!(%error, "the queue could not be counted");
            Ok(None)
        }
        counted => counted.map(Some),
    }
}

/// Returns the deadline of checks that begin now.
pub(super) fn deadline() -> Instant {
    Instant::now() + CHECKS
}

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

/// State of a process that can serve. The numbers of the queue are null if their count takes too long.
#[derive(Serialize, utoipa::ToSchema)]
pub(super) struct Readiness {
    #[schema(example = "ok")]
    status: &'static str,
    version: &'static str,
    #[schema(example = "postgresql")]
    database: &'static str,
    /// Free space on the disk of incoming files.
    free_bytes: u64,
    /// Number of jobs that wait, with those that pause
    queued: Option<u64>,
    /// Number of queued jobs whose next attempt is due later: a fault or a failed attempt ended the last one
    paused: Option<u64>,
    running: Option<u64>,
    /// Waiting time of the job that has been due longest. Jobs that pause do not count.
    #[schema(example = 1.5)]
    queue_age_s: Option<f64>,
    /// Number of homes whose fused map is out of date.
    merges_due: Option<u64>,
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
/// least five seconds. A check that takes longer than 2.5 s fails. The length of the queue says nothing about this process and
/// has no effect, nor has a count that takes as long. With `--admin-listen` only that listener serves this, without a key.
#[utoipa::path(get, path = "/readyz", tag = "service",
    responses(
        (status = 200, description = "The service is ready", body = Readiness),
        (status = 503, description = "Its database or its blobs do not answer, or a disk is full: `not-ready`; `field` is \
            `database`, `blobs` or `disk`"),
        KeyProblems))]
async fn readyz(State(storage): State<Arc<Storage>>) -> Result<Json<Readiness>, Error> {
    let not_ready =
        |what: &'static str| move |error: StorageError| Error::NotReady { what, cause: Some(error) };
    let deadline = deadline();
    // At the same time: each of them may take all the time.
    let (queue, reads, free_bytes, writes) = tokio::join!(
        by(deadline, storage.queue_state(storage.now())),
        by(deadline, storage.check_reads()),
        by(deadline, storage.blobs_ready()),
        by(deadline, storage.check_writes()),
    );
    reads.map_err(not_ready("database"))?;
    let queue = if_in_time(queue).map_err(not_ready("database"))?;
    let free_bytes = free_bytes.map_err(not_ready("blobs"))?;
    if free_bytes < MIN_FREE_BYTES {
        return Err(Error::NotReady { what: "disk", cause: None });
    }
    writes.map_err(|error| {
        let what = if error.is_full() { "disk" } else { "database" };
        Error::NotReady { what, cause: Some(error) }
    })?;
    Ok(Json(Readiness {
        status: "ok",
        version: env!("CARGO_PKG_VERSION"),
        database: storage.database_name(),
        free_bytes,
        queued: queue.map(|queue| queue.queued),
        paused: queue.map(|queue| queue.paused),
        running: queue.map(|queue| queue.running),
        queue_age_s: queue.map(|queue| queue.age.as_secs_f64()),
        merges_due: queue.map(|queue| queue.merges_due),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::future::pending;

    const _: () = assert!(CHECKS.as_millis() < READY.as_millis() && READY.as_millis() < 3000);

    #[tokio::test]
    async fn a_check_that_hangs_ends_at_its_deadline() {
        let over = Instant::now();
        let hangs = by(over, pending::<Result<(), StorageError>>()).await;
        assert!(matches!(hangs, Err(StorageError::Silent { .. })), "{hangs:?}");
        assert_eq!(by(deadline(), async { Ok(7) }).await.unwrap(), 7);
        let failed = by(deadline(), async { Err::<(), _>(StorageError::NoSuchHome) }).await;
        assert!(matches!(failed, Err(StorageError::NoSuchHome)), "{failed:?}");
    }

    #[tokio::test]
    async fn a_count_that_hangs_is_left_out() {
        let hangs = by(Instant::now(), pending::<Result<u64, StorageError>>()).await;
        assert_eq!(if_in_time(hangs).unwrap(), None);
        assert_eq!(if_in_time(Ok(7)).unwrap(), Some(7));
        let failed = if_in_time(Err::<u64, _>(StorageError::NoSuchHome));
        assert!(matches!(failed, Err(StorageError::NoSuchHome)), "{failed:?}");
    }
}
