//! `/metrics`, in the text format of Prometheus. No metric contains names of tenants, homes or clips.

use super::health::{by, deadline};
use super::problems::KeyProblems;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use metrics::{Unit, counter, describe_counter, describe_gauge, describe_histogram, gauge, histogram};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;
use viola_storage::{QueueState, Storage, StorageError};

const REQUESTS: &str = "viola_http_requests_total";
const REQUEST_SECONDS: &str = "viola_http_request_seconds";
const QUEUED: &str = "viola_queue_jobs";
const QUEUE_AGE: &str = "viola_queue_age_seconds";
const MERGES_DUE: &str = "viola_merges_due";
const RECEIVED: &str = "viola_received_bytes_total";
const DISK_FREE: &str = "viola_disk_free_bytes";
const CONNECTIONS: &str = "viola_database_connections";
const MAX_CONNECTIONS: &str = "viola_database_connections_max";
const BUILD: &str = "viola_build_info";
/// The name that the clients of Prometheus have agreed on.
const MEMORY: &str = "process_resident_memory_bytes";

/// Upper bounds of the buckets in seconds: from a cached answer to the wait of a job in a queue of a day. A quantile is never
/// above the last one.
const SECONDS: [f64; 19] = [
    0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 30.0, 120.0, 600.0, 1_800.0,
    3_600.0, 14_400.0, 86_400.0,
];

static RECORDER: OnceLock<Option<PrometheusHandle>> = OnceLock::new();

/// Installs the recorder, once per process.
pub(super) fn begin() {
    RECORDER.get_or_init(|| {
        let builder = PrometheusBuilder::new();
        let builder = builder.set_buckets_for_metric(Matcher::Suffix("_seconds".to_owned()), &SECONDS);
        let installed = builder.map(PrometheusBuilder::install_recorder);
        match installed {
            Ok(Ok(handle)) => {
                describe();
                Some(handle)
            }
            Ok(Err(error)) | Err(error) => {
                tracing::warn!(%error, "nothing can be counted; /metrics stays empty");
                None
            }
        }
    });
}

/// Interval at which observed times are added to their buckets. Until then the recorder keeps each one.
const ADD_TIMES: Duration = Duration::from_secs(60);

/// Adds observed times to their buckets until `stop`: a process that nobody asks for its metrics would otherwise keep them all.
pub(super) async fn keep_small(stop: CancellationToken) {
    loop {
        tokio::select! {
            () = stop.cancelled() => return,
            () = tokio::time::sleep(ADD_TIMES) => {}
        }
        if let Some(Some(handle)) = RECORDER.get() {
            handle.run_upkeep();
        }
    }
}

fn describe() {
    describe_counter!(REQUESTS, "Requests that were answered");
    describe_histogram!(REQUEST_SECONDS, Unit::Seconds, "Time to the first byte of an answer");
    describe_gauge!(QUEUED, "Jobs that wait, pause after a fault, or run");
    describe_gauge!(QUEUE_AGE, Unit::Seconds, "Waiting time of the job that has been due longest");
    describe_gauge!(
        DISK_FREE,
        Unit::Bytes,
        "Free space of the fullest disk that this process writes files to"
    );
    describe_gauge!(CONNECTIONS, "Connections of this process to its database, in use and idle");
    describe_gauge!(MAX_CONNECTIONS, "Maximum number of these connections");
    describe_gauge!(MEMORY, Unit::Bytes, "Memory of this process, without the processes of its jobs");
    describe_gauge!(BUILD, "1; the labels name the version and the database system");
    describe_gauge!(MERGES_DUE, "Homes whose map is behind");
    describe_counter!(RECEIVED, Unit::Bytes, "Files that arrived");
    crate::jobs::describe_metrics();
    crate::webhooks::describe_metrics();
}

/// Counts bytes of received files; `by` tells whether they arrived whole or in parts.
pub(super) fn received(by: &'static str, bytes: u64) {
    counter!(RECEIVED, "by" => by).increment(bytes);
}

/// Counts a request and measures its time.
pub(super) async fn count(request: Request, next: Next) -> Response {
    let route = request.extensions().get::<MatchedPath>();
    let route = route.map_or("none", MatchedPath::as_str).to_owned();
    // A client may invent a method, which must not create a new time series.
    let method = match request.method().as_str() {
        method @ ("GET" | "HEAD" | "POST" | "PUT" | "PATCH" | "DELETE" | "OPTIONS") => method.to_owned(),
        _ => "other".to_owned(),
    };
    let begun = Instant::now();
    let response = next.run(request).await;
    let status = response.status().as_str().to_owned();
    histogram!(REQUEST_SECONDS, "method" => method.clone(), "route" => route.clone()).record(begun.elapsed());
    counter!(REQUESTS, "method" => method, "route" => route, "status" => status).increment(1);
    response
}

/// Get the metrics
///
/// With `--admin-listen` only that listener serves them, without a key.
#[utoipa::path(get, path = "/metrics", tag = "service",
    responses((status = 200, description = "Text for Prometheus", body = String, content_type = "text/plain"), KeyProblems))]
pub(super) async fn metrics(State(storage): State<Arc<Storage>>) -> Response {
    // A scrape that hangs would have no metrics at all.
    match by(deadline(), storage.queue_state(storage.now())).await {
        Ok(state) => set_queue_gauges(&state),
        Err(error) => clear_queue_gauges(&error),
    }
    set_process_gauges(&storage).await;
    let text = RECORDER.get().and_then(Option::as_ref).map(PrometheusHandle::render).unwrap_or_default();
    let media_type = HeaderValue::from_static("text/plain; version=0.0.4");
    ([(header::CONTENT_TYPE, media_type)], text).into_response()
}

fn set_queue_gauges(state: &QueueState) {
    gauge!(QUEUED, "state" => "queued").set(state.queued.saturating_sub(state.paused) as f64);
    gauge!(QUEUED, "state" => "paused").set(state.paused as f64);
    gauge!(QUEUED, "state" => "running").set(state.running as f64);
    gauge!(QUEUE_AGE).set(state.age.as_secs_f64());
    gauge!(MERGES_DUE).set(state.merges_due as f64);
}

/// Sets the gauges of the queue to NaN, since no number is better than an old one.
fn clear_queue_gauges(error: &StorageError) {
    tracing::warn!(%error, "the queue cannot be counted");
    for state in ["queued", "paused", "running"] {
        gauge!(QUEUED, "state" => state).set(f64::NAN);
    }
    gauge!(QUEUE_AGE).set(f64::NAN);
    gauge!(MERGES_DUE).set(f64::NAN);
}

/// Sets the gauges of this process. Without a reading, a gauge is NaN.
async fn set_process_gauges(storage: &Storage) {
    let free = by(deadline(), storage.free_bytes()).await;
    gauge!(DISK_FREE).set(free.map_or(f64::NAN, |bytes| bytes as f64));
    let connections = storage.connections();
    gauge!(CONNECTIONS, "state" => "used").set(connections.used as f64);
    gauge!(CONNECTIONS, "state" => "idle").set(connections.idle as f64);
    gauge!(MAX_CONNECTIONS).set(connections.max as f64);
    if let Some(bytes) = resident_bytes() {
        gauge!(MEMORY).set(bytes as f64);
    }
    let version = env!("CARGO_PKG_VERSION");
    gauge!(BUILD, "version" => version, "database" => storage.database_name()).set(1.0);
}

/// Returns the memory of this process; `None` on systems without `/proc`.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kib = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix("kB"));
    kib?.trim().parse::<u64>().ok()?.checked_mul(1 << 10)
}
