use crate::server::Server;
use futures::StreamExt;
use serde_json::{Value, json};
use viola_testing::client::Client;
use viola_testing::until;

/// Creates a home with a map and a clip; returns the paths of the clip and of its job.
async fn one_job(server: &Server, frames: u32) -> (String, String) {
    let home = server.make_room("h").await;
    let clip = server.film(&home, frames).await;
    let job = server.job_of(&clip).await;
    (clip, job)
}

/// Returns name, id and data of every event up to the stream's end.
async fn events(client: &Client, path: &str, last_event_id: Option<&str>) -> Vec<(String, String, Value)> {
    let answer = Client::read(client.watch(path, last_event_id).await).await;
    assert_eq!((answer.status, answer.header("content-type")), (200, "text/event-stream"));
    assert_eq!(answer.header("x-accel-buffering"), "no");
    let text = String::from_utf8(answer.bytes).unwrap();
    let field = |event: &str, name: &str| {
        event.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default().trim().to_owned()
    };
    text.split("\n\n")
        .filter(|event| event.contains("data:"))
        .map(|event| {
            let data = serde_json::from_str(&field(event, "data:")).unwrap();
            (field(event, "event:"), field(event, "id:"), data)
        })
        .collect()
}

#[tokio::test]
async fn a_job_is_watched_to_its_end() {
    let server = Server::start().await;
    let (clip, job) = one_job(&server, 24).await;
    let seen = events(&server, &format!("{job}/events"), None).await;
    let (last, before) = seen.split_last().unwrap();
    assert_eq!(
        (last.0.as_str(), &last.2["state"], &last.2["progress"]),
        ("end", &json!("succeeded"), &json!(1.0))
    );
    assert!(before.iter().all(|(name, _, _)| name == "job"));
    let versions: Vec<i64> = seen.iter().map(|(_, id, _)| id.parse().unwrap()).collect();
    assert!(versions.is_sorted_by(|a, b| a < b), "{versions:?}");
    let progress: Vec<f64> = seen.iter().map(|(_, _, job)| job["progress"].as_f64().unwrap()).collect();
    assert!(progress.is_sorted(), "{progress:?}");
    assert_eq!(server.get(&job).await.ok(200), last.2);
    assert_eq!(server.get(&clip).await.ok(200)["job"], last.2);

    // A client that reconnects gets the new events, and 204 after the last one.
    assert_eq!(events(&server, &format!("{job}/events"), Some(&seen[0].1)).await.last(), Some(last));
    server.get_with(&format!("{job}/events"), "Last-Event-ID", &last.1).await.ok(204);
    server.post(&format!("{job}/cancel"), "").await.problem(409, "job-ended");
}

#[tokio::test]
async fn a_waiting_job_is_cancelled_and_queued_again() {
    let server = Server::without_workers().await;
    let (clip, job) = one_job(&server, 2).await;
    let events = tokio::spawn({
        let (client, path) = ((*server).clone(), format!("{job}/events"));
        async move { events(&client, &path, None).await }
    });
    let cancelled = server.post(&format!("{job}/cancel"), "").await.ok(200);
    assert_eq!(
        (&cancelled["state"], &cancelled["error"]["code"]),
        (&json!("cancelled"), &json!("cancelled"))
    );
    assert_eq!(server.post(&format!("{job}/cancel"), "").await.ok(200), cancelled);
    assert_eq!(events.await.unwrap().last().unwrap().2, cancelled);
    let after = server.get(&clip).await.ok(200);
    assert_eq!((&after["state"], &after["reasons"][0]["code"]), (&json!("uploaded"), &json!("cancelled")));
    let again = server.post(&format!("{clip}/align"), "").await;
    let location = again.header("location").to_owned();
    let again = again.ok(202);
    assert_eq!(again["state"], "queued");
    assert_eq!(location, format!("/v1/jobs/{}", again["job"]["id"].as_str().unwrap()));
    assert_ne!(location, job);
    // While the job is queued or running, another request changes nothing.
    assert_eq!(server.post(&format!("{clip}/align"), "").await.ok(202), again);
}

#[tokio::test]
async fn a_running_job_is_cancelled() {
    let server = Server::start().await;
    let (clip, job) = one_job(&server, 300).await;
    until("the job runs", async || server.get(&job).await.ok(200)["state"] == "running").await;
    assert_eq!(server.post(&format!("{job}/cancel"), "").await.ok(200)["state"], "cancelled");
    assert_eq!(server.get(&clip).await.ok(200)["state"], "uploaded");
    assert_eq!(server.get("/v1/jobs?state=failed").await.ok(200)["items"], json!([]), "it is no failure");
    until("the end of the attempt is counted", async || {
        let counted = String::from_utf8(server.get("/metrics").await.bytes).unwrap();
        counted.contains("viola_job_attempts_total{outcome=\"cancelled\"}")
    })
    .await;
    // The worker is free again: the next job runs to its end.
    server.post(&format!("{clip}/align"), "").await.ok(202);
    assert_eq!(server.settled(&clip).await["state"], "aligned");
    assert_eq!(server.get(&job).await.ok(200)["state"], "cancelled");
}

#[tokio::test]
async fn a_watched_job_that_is_removed_ends_with_null() {
    let server = Server::without_workers().await;
    let (clip, job) = one_job(&server, 2).await;
    let watching = server.watch(&format!("{job}/events"), None).await;
    let mut chunks = watching.bytes_stream();
    chunks.next().await.unwrap().unwrap();
    server.delete(&clip).await.ok(204);
    let mut rest = Vec::new();
    while let Some(chunk) = chunks.next().await {
        rest.extend(chunk.unwrap());
    }
    assert_eq!(String::from_utf8(rest).unwrap().trim(), "event: end\ndata: null");
    server.get(&job).await.problem(404, "job-not-found");
}

#[tokio::test]
async fn a_server_that_stops_ends_its_streams() {
    let server = Server::without_workers().await;
    let (_, job) = one_job(&server, 2).await;
    let watching = server.watch(&format!("{job}/events"), None).await;
    let begun = std::time::Instant::now();
    server.stop().await;
    watching.bytes().await.unwrap();
    assert!(begun.elapsed().as_secs() < 20);
}

#[tokio::test]
async fn what_failed_is_listed_newest_first_and_can_be_run_again() {
    let first_delay = std::time::Duration::from_millis(1);
    let retry = viola_storage::RetryPolicy { first_delay, ..Default::default() };
    let server = Server::with(|params| {
        params.worker.method = |_, _, _, _| panic!("a fault of ours");
        params.worker.retry = retry;
    })
    .await;
    let mut jobs = Vec::new();
    for home in ["a", "b"] {
        let home = server.make_room(home).await;
        let clip = server.film(&home, 12).await;
        jobs.push(server.settled(&clip).await["job"].clone());
    }
    let listed = async |query: &str| server.get(&format!("/v1/jobs{query}")).await.ok(200);
    let failed = listed("?state=failed").await;
    assert_eq!(failed["items"], json!([jobs[1], jobs[0]]));
    assert!(failed["items"][0]["error"]["code"].is_string());
    let first = listed("?limit=1").await;
    assert_eq!(first["items"], json!([jobs[1]]));
    let second = listed(&format!("?limit=1&after={}", first["next"].as_str().unwrap())).await;
    assert_eq!((&second["items"], &second["next"]), (&json!([jobs[0]]), &Value::Null));
    assert_eq!(listed("?state=succeeded,queued").await["items"], json!([]));
    server.get("/v1/jobs?state=dead").await.problem(400, "invalid-query");
    let clip = format!("/v1/homes/a/clips/{}", jobs[0]["clip"].as_str().unwrap());
    server.post(&format!("{clip}/align"), "").await.ok(202);
    server.settled(&clip).await;
    assert_eq!(listed("?state=failed").await["items"].as_array().unwrap().len(), 3);
}
