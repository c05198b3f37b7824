//! The binary as an operator runs it: traces to a collector, deletion of a tenant, many exports at once.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use serde_json::{Value, json};
use std::io::{Cursor, Read};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use viola_testing::client::Client;
use viola_testing::files::files_below;
use viola_testing::process::{Process, succeed, viola};
use viola_testing::{eventually, receiver, room, zips};

/// Starts an OpenTelemetry collector; returns its URL and the received protobuf, with texts and ids in plain.
fn collector() -> (String, Arc<Mutex<Vec<u8>>>) {
    let got = Arc::<Mutex<Vec<u8>>>::default();
    let kept = got.clone();
    (receiver(move |body| kept.lock().unwrap().extend(body)), got)
}

fn holds(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

#[tokio::test]
async fn traces_go_to_the_collector_that_is_named() {
    let (url, got) = collector();
    let data = tempfile::tempdir().unwrap();
    let server = Process::serve_with(data.path(), &[("OTEL_EXPORTER_OTLP_ENDPOINT", &url)]);
    let home = server.client.make_room("h").await;
    let trace = "4bf92f3577b34da6a3ce929d0e0e4736";
    let request = server.client.request(reqwest::Method::POST, &format!("{home}/clips"));
    let request = request.header("traceparent", format!("00-{trace}-00f067aa0ba902b7-01"));
    let answer = server.client.send(request.body(zips::zip(&room::clip(12)))).await;
    let clip = answer.header("location").to_owned();
    assert_eq!(server.client.settled(&clip).await["state"], "aligned");
    assert!(server.stop("TERM").success(), "what is left is sent before the end");
    let got = got.lock().unwrap().clone();
    let id: Vec<u8> = (0..16).map(|n| u8::from_str_radix(&trace[2 * n..2 * n + 2], 16).unwrap()).collect();
    let clip_id = clip.rsplit('/').next().unwrap();
    let parts: [&[u8]; 8] = [
        b"POST /v1/homes/{home}/clips",
        b"PUT /v1/homes/{home}/lidar-map",
        b"http.response.status_code",
        b"job",
        b"raycast",
        b"service.name",
        clip_id.as_bytes(),
        &id,
    ];
    for part in parts {
        assert!(holds(&got, part), "{:?} is not among the traces", String::from_utf8_lossy(part));
    }
}

/// Runs a command that must succeed; returns its output.
fn run(data: &Path, arguments: &[&str]) -> String {
    succeed(viola().args(arguments).arg("--data").arg(data))
}

#[tokio::test]
async fn ended_jobs_are_listed_and_queued_again_beside_a_running_server() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::serve(data.path(), &["--no-worker"]);
    let client = &server.client;
    let home = client.make_room("h").await;
    let path = client.add_clip(&home, zips::zip(&room::clip(12))).await;
    let clip = client.get(&path).await.ok(200);
    let job = clip["job"]["id"].as_str().unwrap().to_owned();
    client.post(&format!("/v1/jobs/{job}/cancel"), "").await.ok(200);
    let listed = |filter: &[&str]| -> Value {
        let arguments = [&["jobs", "list", "--json"], filter].concat();
        serde_json::from_str(&run(data.path(), &arguments)).unwrap()
    };
    let cancelled = listed(&["--state", "cancelled", "--home", "h", "--tenant", "default"]);
    assert_eq!(cancelled.as_array().unwrap().len(), 1, "{cancelled}");
    assert_eq!((&cancelled[0]["clip"], &cancelled[0]["id"]), (&clip["id"], &clip["job"]["id"]));
    for other in [
        &["--state", "failed"][..],
        &["--state", "cancelled", "--home", "g"],
        &["--state", "cancelled", "--tenant", "acme"],
        &["--state", "cancelled", "--code", "worker_died"],
    ] {
        assert_eq!(listed(other), json!([]), "{other:?}");
    }
    assert!(run(data.path(), &["jobs", "retry"]).contains("0 of 0 clips"));
    let said = run(data.path(), &["jobs", "retry", "--state", "cancelled"]);
    assert!(said.contains("1 of 1 clips"), "{said}");
    assert_eq!(client.get(&path).await.ok(200)["state"], "queued");
    // The cancelled job is not the newest any more.
    assert_eq!(listed(&["--state", "cancelled"]), json!([]));
}

#[test]
fn a_misspelt_data_folder_is_told_and_not_created() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("typo");
    let id = "01a1f766-7a97-7747-9dbb-391e0eeccb64";
    for arguments in [
        &["jobs", "list"][..],
        &["jobs", "retry"],
        &["keys", "list"],
        &["keys", "revoke", id],
        &["tenants", "list"],
        &["tenants", "set", "default", "--max-uploads", "9"],
        &["tenants", "delete", "acme", "--yes"],
        &["clean"],
    ] {
        let output = viola().args(arguments).arg("--data").arg(&data).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.contains("no service in the data folder") && said.contains("--data"), "{said}");
        assert!(output.stdout.is_empty() && !data.exists(), "{arguments:?}");
    }
    run(&data, &["keys", "create", "--tenant", "acme", "--role", "admin"]);
    assert!(run(&data, &["tenants", "list"]).contains("acme"));
}

#[tokio::test]
async fn a_tenant_is_removed_beside_a_running_server() {
    let data = tempfile::tempdir().unwrap();
    let server = Process::serve(data.path(), &["--no-worker"]);
    let key = |tenant| run(data.path(), &["keys", "create", "--tenant", tenant, "--role", "admin"]);
    let (acme, bolt) = (key("acme"), key("bolt"));
    let send = async |key: &str, method, path: &str, body: Vec<u8>| {
        let request = server.client.request(method, path).bearer_auth(key.trim()).body(body);
        server.client.send(request).await
    };
    use reqwest::Method;
    for key in [&acme, &bolt] {
        send(key, Method::PUT, "/v1/homes/h", vec![]).await.ok(201);
        send(key, Method::PUT, "/v1/homes/h/lidar-map", room::lidar_csv().into()).await.ok(201);
        send(key, Method::POST, "/v1/homes/h/clips", zips::zip(&room::clip(12))).await.ok(201);
    }
    assert!(run(data.path(), &["tenants", "list"]).contains("acme"));
    // A new service has this tenant before its first home.
    run(data.path(), &["tenants", "set", "default", "--max-uploads", "9"]);
    for (refused, why) in [
        (vec!["tenants", "delete", "acme"], "--yes"),
        (vec!["tenants", "delete", "nobody", "--yes"], "nobody"),
        (vec!["tenants", "set", "nobody", "--max-bytes", "1"], "there is no tenant nobody"),
    ] {
        let output = viola().args(refused).arg("--data").arg(data.path()).output().unwrap();
        assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains(why));
    }
    let said = run(data.path(), &["tenants", "delete", "acme", "--yes"]);
    assert!(
        said.contains("acme is gone with all its files: homes 1, uploads 0, webhooks 0, keys 1"),
        "{said}"
    );
    send(&acme, Method::GET, "/v1/homes/h", vec![]).await.problem(401, "key-invalid");
    assert_eq!(send(&bolt, Method::GET, "/v1/homes/h", vec![]).await.ok(200)["clips"], 1);
    assert!(!run(data.path(), &["tenants", "list"]).contains("acme"));
    // The last tenant's keys are deleted too, and requests without a key are still refused.
    run(data.path(), &["tenants", "delete", "bolt", "--yes"]);
    server.client.get("/v1/homes/h").await.problem(401, "key-missing");
    eventually("every file is gone", || async {
        files_below(&data.path().join("blobs")).is_empty().then_some(())
    })
    .await;
}

/// More than the blocking threads (512), and more than the queue of connections to be accepted.
const EXPORTS: usize = 2000;

/// Requests one path repeatedly on a connection of its own until `stop`; returns the longest wait for an
/// answer.
async fn longest_wait(client: Client, path: String, stop: Arc<tokio::sync::Notify>) -> Duration {
    let mut longest = Duration::ZERO;
    loop {
        let begun = Instant::now();
        tokio::select! {
            answer = client.get(&path) => assert_eq!(answer.status, 200),
            () = stop.notified() => return longest.max(begun.elapsed()),
        }
        longest = longest.max(begun.elapsed());
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_thousand_exports_at_once_end() {
    // Both ends of each connection; the server inherits the limit.
    let descriptors = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: descriptors.maximum, ..descriptors }).unwrap();
    let data = tempfile::tempdir().unwrap();
    let server = Process::serve(data.path(), &["--no-worker"]);
    let home = server.client.make_room("h").await;
    let recording = zips::zip_of_size(&room::clip(2), 2 << 20);
    server.client.add_clip(&home, recording.clone()).await;

    let other = Client::new(server.client.base.clone());
    other.lives().await;
    let stop = Arc::new(tokio::sync::Notify::new());
    let others = tokio::spawn(longest_wait(other, home.clone(), stop.clone()));
    let exports = async {
        // No body is read before all requests are answered, so that all exports run at once.
        let path = format!("{home}/export");
        let asked = (0..EXPORTS).map(|_| server.client.request(reqwest::Method::GET, &path).send());
        let answers = futures::future::join_all(asked).await.into_iter().map(Result::unwrap);
        futures::future::join_all(answers.map(Client::read)).await
    };
    let begun = Instant::now();
    let answers = tokio::time::timeout(Duration::from_secs(60), exports).await.expect("all exports end");
    let took = begun.elapsed();
    stop.notify_one();
    let longest = others.await.unwrap();
    let mut whole = 0;
    for answer in answers {
        if answer.status == 200 {
            let mut zip = zip::ZipArchive::new(Cursor::new(answer.bytes)).unwrap();
            let name = zip.file_names().map(|name| name.unwrap().into_owned());
            let name = name.into_iter().find(|name| name.ends_with("/recording")).unwrap();
            let mut read = Vec::new();
            zip.by_name(&name).unwrap().read_to_end(&mut read).unwrap();
            assert!(read == recording);
            whole += 1;
        } else {
            assert!(answer.header("retry-after").parse::<u64>().unwrap() >= 1);
            answer.problem(503, "too-many-exports");
        }
    }
    eprintln!("{whole} of {EXPORTS} exports were served within {took:?}; others waited at most {longest:?}");
    assert!((1..100).contains(&whole), "{whole}");
    assert!(longest < Duration::from_secs(20), "another request waited {longest:?}");
    assert_eq!(server.client.get(&format!("{home}/export")).await.status, 200);
}

/// Returns the address of the second listener, from the log.
async fn admin_address(log: &Path) -> String {
    eventually("the second listener is in the log", || async {
        let text = std::fs::read_to_string(log).unwrap();
        let line = text.lines().find(|line| line.contains("health and metrics are served"))?;
        let event: serde_json::Value = serde_json::from_str(line).unwrap();
        event["address"].as_str().map(str::to_owned)
    })
    .await
}

#[tokio::test]
async fn metrics_and_readiness_are_for_operators() {
    let folder = tempfile::tempdir().unwrap();
    let (data, log) = (folder.path().join("data"), folder.path().join("log"));
    run(&data, &["keys", "create", "--tenant", "acme", "--role", "admin"]);
    let server = Process::serve_logged(&data, &log, &["--admin-listen", "127.0.0.1:0"]);
    let operators = Client::new(format!("http://{}", admin_address(&log).await));
    for path in ["/readyz", "/metrics"] {
        server.client.get(path).await.problem(404, "route-not-found");
        assert_eq!(operators.get(path).await.status, 200, "{path}");
    }
    server.client.get("/healthz").await.ok(200);
    // The second listener serves nothing else.
    assert_eq!(operators.get("/v1/homes").await.status, 404);
    let probe = |base: &str| {
        let address = base.strip_prefix("http://").unwrap();
        viola().args(["health", "--address", address]).output().unwrap()
    };
    let refused = probe(&server.client.base);
    assert!(probe(&operators.base).status.success() && !refused.status.success());
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(told.contains("`--admin-listen`") && told.contains("--address"), "{told}");
}
