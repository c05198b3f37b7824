//! Guarantees of a server that is killed, stopped, or started twice: the real binary, real signals.

mod blame;
mod hundred;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::Stdio;
use tempfile::TempDir;
use viola_testing::client::Client;
use viola_testing::files::files_below;
use viola_testing::process::{Process, viola};
use viola_testing::tus::sha256;
use viola_testing::{eventually, room, zips};

/// Enough frames that a job is still running when it is interrupted.
const FRAMES: u32 = 200;

/// Creates a home with a map and a clip whose job runs; returns the paths of the clip and of the job.
async fn running_job(client: &Client) -> (String, String) {
    let clip = zips::zip(&room::clip(FRAMES));
    let home = client.make_room("h").await;
    let answer = client.post(&format!("{home}/clips"), clip).await;
    let clip = answer.header("location").to_owned();
    let job = format!("/v1/jobs/{}", answer.ok(201)["job"]["id"].as_str().unwrap());
    eventually("the job runs", || async {
        (client.get(&job).await.ok(200)["state"] == "running").then_some(())
    })
    .await;
    (clip, job)
}

#[tokio::test]
async fn a_job_outlives_its_server() {
    let data = TempDir::new().unwrap();
    let lease = ["--lease-seconds", "1", "--models", "none"];
    let server = Process::serve(data.path(), &lease);
    let (clip, job) = running_job(&server.client).await;
    server.kill();

    let server = Process::serve(data.path(), &lease);
    let settled = server.client.settled(&clip).await;
    assert_eq!(settled["state"], "aligned", "{settled:#}");
    let job = server.client.get(&job).await.ok(200);
    // The attempt that the kill ended does not count.
    assert_eq!((&job["state"], &job["attempts"]), (&"succeeded".into(), &1.into()));
    // The LiDAR map's two files, the clip, and the result's six files; the home's map follows later.
    let files = files_below(&data.path().join("blobs"));
    let of_clips = files.iter().filter(|path| !path.to_string_lossy().contains("home-maps"));
    assert_eq!(of_clips.count(), 9, "{files:?}");
}

#[tokio::test]
async fn an_upload_cut_off_by_a_kill_leaves_nothing() {
    let data = TempDir::new().unwrap();
    let blobs = data.path().join("blobs");
    let server = Process::serve(data.path(), &[]);
    let home = server.client.make_home("h").await;
    let body = zips::zip(&room::clip(20));
    let address = server.client.base.strip_prefix("http://").unwrap();
    let mut connection = TcpStream::connect(address).unwrap();
    let length = body.len();
    write!(connection, "POST {home}/clips HTTP/1.1\r\nhost: localhost\r\ncontent-length: {length}\r\n\r\n")
        .unwrap();
    connection.write_all(&body[..length / 2]).unwrap();
    eventually("half of the clip is on the disk", || async {
        let sizes = files_below(&blobs).into_iter().filter_map(|file| Some(file.metadata().ok()?.len()));
        (sizes.sum::<u64>() > 0).then_some(())
    })
    .await;
    server.kill();
    assert_eq!(connection.read(&mut [0; 100]).unwrap_or(0), 0, "half a clip was acknowledged");
    assert_eq!(files_below(&blobs).len(), 1);

    let server = Process::serve(data.path(), &[]);
    assert_eq!(files_below(&blobs).len(), 0);
    assert_eq!(server.client.get(&format!("{home}/clips")).await.ok(200)["items"], serde_json::json!([]));
    // The phone retries.
    let answer = server.client.post(&format!("{home}/clips"), body).await;
    assert_eq!(answer.ok(201)["state"], "uploaded");
}

#[tokio::test]
async fn a_resumable_upload_outlives_its_server() {
    let data = TempDir::new().unwrap();
    let blobs = data.path().join("blobs");
    // Larger than one durable piece of a request: 40 MiB that do not compress.
    let mut files = room::clip(2);
    let noise =
        (0..10u64 << 19).flat_map(|n| n.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31).to_le_bytes());
    files.push(("noise.bin".to_owned(), noise.collect()));
    let body = zips::zip(&files);
    assert!(body.len() > 36 << 20, "{} bytes", body.len());
    let mut server = Process::serve(data.path(), &["--workers", "0"]);
    server.client.make_home("h").await;
    let upload = server.client.begin("h", body.len()).await;
    let first = server.client.patch(&upload, 0, &body[..1000]);
    server.client.send(first).await.ok(204);
    let mut acknowledged = 1000;
    // Killed in the middle of a request, each time later; offsets from HEAD in between are acknowledged too.
    for (sent, durable) in [(500_000, 1000), (17 << 20, 16 << 20), (17 << 20, 32 << 20)] {
        let offset = server.client.offset(&upload).await;
        assert!(offset >= acknowledged, "{acknowledged} bytes were acknowledged, {offset} are there");
        let length = |file: PathBuf| file.metadata().map_or(0, |data| data.len());
        let mut connection = server.client.patch_partly(&upload, offset, &body, 0);
        let sending = body[offset..offset + sent].to_vec();
        let sender = tokio::task::spawn_blocking(move || connection.write_all(&sending).map(|()| connection));
        let connection = sender.await.unwrap().unwrap();
        eventually("all that was sent is in files", || async {
            let there: u64 = files_below(&blobs).into_iter().map(length).sum();
            (there >= (offset + sent) as u64).then_some(())
        })
        .await;
        acknowledged = eventually("most of it is acknowledged", || async {
            let offset = server.client.offset(&upload).await;
            (offset >= durable).then_some(offset)
        })
        .await;
        server.kill();
        drop(connection);
        server = Process::serve(data.path(), &["--workers", "0"]);
    }
    let last = server.client.go_on(&upload, &body).await;
    assert_eq!(last.status, 204, "{last:?}");
    let clip = server.client.get(last.header("viola-clip")).await.ok(200);
    assert_eq!(clip["sha256"], serde_json::json!(sha256(&body)));
    // The clip's file alone.
    assert_eq!(files_below(&blobs).len(), 1);
}

#[tokio::test]
async fn what_was_acknowledged_is_there_after_a_kill() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &["--workers", "0"]);
    let home = server.client.make_home("h").await;
    let map = server.client.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.client.post(&format!("{home}/clips"), zips::zip(&room::clip(2))).await.ok(201);
    server.kill();
    let server = Process::serve(data.path(), &["--workers", "0"]);
    let mut kept = server.client.get(&format!("{home}/lidar-map")).await.ok(200);
    // Only a read returns the place of its picture.
    kept.as_object_mut().unwrap().remove("image");
    assert_eq!(kept, map);
    assert_eq!(server.client.get(&format!("{home}/clips")).await.ok(200)["items"], serde_json::json!([clip]));
    assert_eq!(files_below(&data.path().join("blobs")).len(), 3);
}

#[tokio::test]
async fn a_server_that_is_asked_to_stop_gives_its_job_back() {
    let data = TempDir::new().unwrap();
    for signal in ["TERM", "INT"] {
        // Longer than the test waits for the clip: the job does not wait for the lease.
        let server = Process::serve(data.path(), &["--lease-seconds", "590"]);
        let (clip, job) = running_job(&server.client).await;
        assert!(server.stop(signal).success());
        let server = Process::serve(data.path(), &[]);
        assert_eq!(server.client.settled(&clip).await["state"], "aligned");
        // The attempt does not count.
        assert_eq!(server.client.get(&job).await.ok(200)["attempts"], 1);
        server.client.delete("/v1/homes/h").await.ok(204);
    }
}

#[tokio::test]
async fn a_bomb_does_not_grow_the_server() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &[]);
    let home = server.client.make_home("h").await;
    let clip = room::clip(2);
    let bomb = tokio::task::spawn_blocking(move || zips::zip_with_zeros(&clip, "depth/2.png", 10 << 30));
    let bomb = bomb.await.unwrap();
    server.client.post(&format!("{home}/clips"), bomb).await.problem(422, "zip-bomb");
    server.client.lives().await;
    if let Some(peak_mib) = server.peak_mib() {
        assert!(peak_mib < 200, "the server had {peak_mib} MiB");
    }
}

#[tokio::test]
async fn a_folder_serves_once_at_a_time() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &[]);
    for command in ["serve", "migrate"] {
        let second = viola().arg(command).arg("--data").arg(data.path()).output().unwrap();
        let said = String::from_utf8(second.stderr).unwrap();
        assert!(!second.status.success());
        assert!(said.contains("in use by another viola server"), "{said}");
    }
    server.kill();
    let migrated = viola().arg("migrate").arg("--data").arg(data.path()).output().unwrap();
    assert!(migrated.status.success(), "{migrated:?}");
}

#[tokio::test]
async fn a_lost_database_loses_no_file() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &["--workers", "0"]);
    let home = server.client.make_home("h").await;
    server.client.add_clip(&home, zips::zip(&room::clip(2))).await;
    server.kill();
    for file in files_below(data.path()) {
        if file.file_name().unwrap().to_string_lossy().starts_with("viola.sqlite") {
            std::fs::remove_file(file).unwrap();
        }
    }
    let begin = |arguments: &[&str]| {
        let mut command = viola();
        command.args(arguments).arg("--data").arg(data.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    let store = std::fs::read_to_string(data.path().join("blobs/viola-store-id")).unwrap().trim().to_owned();
    let (serve, work) = (["serve", "--listen", "127.0.0.1:0"], ["work", "--admin-listen", "127.0.0.1:0"]);
    let clean = ["clean", "--older-than-seconds", "0"];
    // A cleaner without the right database deletes nothing.
    let clean_all = ["clean", "--remove-unknown", "--older-than-seconds=0"];
    for arguments in [serve, work, clean, clean_all] {
        let mut child = begin(&arguments);
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        child.kill().unwrap();
        let said = String::from_utf8(child.wait_with_output().unwrap().stderr).unwrap();
        assert_eq!(line, "", "{arguments:?}: it says on its standard output that it works");
        assert!(said.contains("viola clean --remove-unknown"), "{arguments:?}: {said}");
        assert!(said.contains(&format!("--store-id {store}")), "{arguments:?}: {said}");
        assert_eq!(files_below(&data.path().join("blobs")).len(), 1, "{arguments:?}");
        // The log would be applied to a copy that replaces the database.
        assert!(!data.path().join("viola.sqlite-wal").exists(), "{arguments:?} left a log");
    }
    let clean = begin(&["clean", "--remove-unknown", "--store-id", &store, "--older-than-seconds", "0"]);
    assert!(clean.wait_with_output().unwrap().status.success());
    assert_eq!(files_below(&data.path().join("blobs")).len(), 0);
    Process::serve(data.path(), &["--workers", "0"]).client.lives().await;
}

#[tokio::test]
async fn nobody_writes_into_the_log() {
    let folder = TempDir::new().unwrap();
    let (data, log) = (folder.path().join("data"), folder.path().join("log"));
    let server = Process::serve_logged(&data, &log, &[]);
    let home = server.client.make_home("h").await;
    let forged = "x\n{\"level\":\"ERROR\",\"message\":\"forged\"}\r\n";
    let name = serde_json::json!({"name": forged});
    let named = server.client.request(reqwest::Method::PUT, &home).json(&name);
    server.client.send(named).await.problem(422, "invalid-body");
    for path in ["/v1/homes/%0A%7B%22message%22%3A%22forged%22%7D", "/%0d%0aforged", "/v1/jobs/forged%1b[2J"]
    {
        assert!(server.client.get(path).await.status >= 400, "{path}");
    }
    let mut raw = TcpStream::connect(server.client.base.strip_prefix("http://").unwrap()).unwrap();
    raw.write_all(
        b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-request-id: a\tforged\r\nconnection: close\r\n\r\n",
    )
    .unwrap();
    let mut answer = String::new();
    raw.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    let key = format!("viola_{}", "5ec7e7".repeat(11));
    let secret = &key[..70];
    let asked = server
        .client
        .request(reqwest::Method::GET, "/v1/homes")
        .header("authorization", format!("Bearer {secret}"));
    server.client.send(asked).await.problem(401, "key-invalid");
    assert!(server.stop("TERM").success());
    let text = std::fs::read_to_string(&log).unwrap();
    for line in text.lines() {
        let event: serde_json::Value =
            serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line:?}"));
        assert_ne!(event["message"], "forged");
        assert!(!line.contains('\u{1b}'), "{line:?}");
    }
    assert!(text.lines().count() > 5 && !text.contains("5ec7e7"), "secrets are not logged");
}
