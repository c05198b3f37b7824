//! Metrics and readiness.

use crate::server::Server;
use std::collections::BTreeSet;
use viola_testing::client::id_of;
use viola_testing::{eventually, until};

/// Returns the names of our metrics in a text.
fn names(text: &str) -> BTreeSet<String> {
    let words = text.split(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_');
    words.filter(|word| word.starts_with("viola_")).map(str::to_owned).collect()
}

#[tokio::test]
async fn the_dashboard_shows_what_is_counted() {
    let server = Server::start().await;
    let home = server.make_room("secret-home").await;
    let clip = server.film(&home, 24).await;
    server.settled(&clip).await;
    let shown = names(include_str!("../../docker/grafana.json"));
    assert!(shown.len() > 10, "{shown:?}");
    // The home's map is merged a moment after its clip.
    let text = eventually("everything was counted once", || async {
        let answer = server.get("/metrics").await;
        assert_eq!((answer.status, answer.header("content-type")), (200, "text/plain; version=0.0.4"));
        let text = String::from_utf8(answer.bytes).unwrap();
        let counted = names(&text);
        shown.iter().all(|name| counted.contains(name)).then_some(text)
    })
    .await;
    let value = |series: &str| -> f64 {
        let line = text.lines().find_map(|line| line.strip_prefix(series)?.trim().parse().ok());
        line.unwrap_or_else(|| panic!("{series}: {text}"))
    };
    assert!(value("viola_disk_free_bytes") > 0.0);
    assert!(value("viola_database_connections_max") >= 4.0);
    for state in ["queued", "paused", "running"] {
        assert!(value(&format!("viola_queue_jobs{{state=\"{state}\"}}")) >= 0.0, "{state}");
    }
    // An alert on their increase needs the series before the first failure.
    for outcome in ["storage_fault", "system_fault", "worker_died", "internal_error"] {
        assert!(value(&format!("viola_job_attempts_total{{outcome=\"{outcome}\"}}")) >= 0.0, "{outcome}");
    }
    assert!(value("viola_merges_total{outcome=\"failed\"}") >= 0.0);
    // A quantile ends at the last bucket, and jobs wait for hours.
    for le in ["120", "600", "3600", "86400"] {
        assert!(value(&format!("viola_job_start_seconds_bucket{{le=\"{le}\"}}")) >= 1.0, "{le}");
    }
    let build = text.lines().find(|line| line.starts_with("viola_build_info{")).expect("the build is told");
    assert!(build.contains(concat!("version=\"", env!("CARGO_PKG_VERSION"), "\"")), "{build}");
    if cfg!(target_os = "linux") {
        // A megabyte at least, and no number of kilobytes.
        assert!(value("process_resident_memory_bytes") > 1e6);
    }
    // The metrics reveal no owner, and invented paths add no series.
    server.get("/v1/homes/secret-home/invented").await.problem(404, "route-not-found");
    assert!(!text.contains("secret-home") && !text.contains(id_of(&clip)), "{text}");
    let again = String::from_utf8(server.get("/metrics").await.bytes).unwrap();
    assert!(!again.contains("invented"));
}

#[tokio::test]
async fn readiness_tells_what_it_stands_on() {
    let server = Server::without_workers().await;
    let home = server.make_room("h").await;
    server.film(&home, 2).await;
    let ready = server.get("/readyz").await.ok(200);
    assert_eq!((&ready["status"], &ready["queued"], &ready["running"]), (&"ok".into(), &1.into(), &0.into()));
    assert_eq!(ready["paused"], 0);
    assert!(["sqlite", "postgresql"].contains(&ready["database"].as_str().unwrap()));
    assert!(ready["free_bytes"].as_u64().unwrap() > 0 && ready["queue_age_s"].as_f64().unwrap() >= 0.0);
}

/// With a lock of PostgreSQL, under which nobody reads a table.
#[tokio::test]
async fn a_process_is_ready_while_the_queue_is_counted() {
    let server = Server::without_workers().await;
    let Some(locked) = server.lock_reads("homes").await else { return };
    let ready = server.get("/readyz").await.ok(200);
    assert_eq!((&ready["status"], &ready["queued"]), (&"ok".into(), &serde_json::Value::Null), "{ready}");
    drop(locked);
    until("the queue is counted", async || server.get("/readyz").await.ok(200)["queued"] == 0).await;
}
