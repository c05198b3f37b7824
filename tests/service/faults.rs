//! Faults of the machine that a restart does not cure: what the operator is told, and what is served meanwhile.

use serde_json::{Value, json};
use sqlx::Connection as _;
use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use tempfile::TempDir;
use viola_testing::client::Client;
use viola_testing::disk::{Disk, SmallDisk};
use viola_testing::files::files_below;
use viola_testing::process::{Process, prepared, program, viola};
use viola_testing::{eventually, room, zips};

/// Returns what `viola serve` writes when it refuses to start.
fn refusal(data: &Path) -> String {
    let mut command = viola();
    command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(data);
    let ended = command.stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap();
    assert!(!ended.status.success() && ended.stdout.is_empty(), "it started");
    String::from_utf8(ended.stderr).unwrap()
}

fn cut(file: &Path, bytes: u64) {
    OpenOptions::new().write(true).open(file).unwrap().set_len(bytes).unwrap();
}

/// Runs a statement on the database of a data folder.
async fn execute(data: &Path, statement: &'static str) {
    let file = format!("sqlite:{}", data.join("viola.sqlite").display());
    let mut connection = sqlx::SqliteConnection::connect(&file).await.unwrap();
    sqlx::query(statement).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
}

fn file_below(folder: &Path, is_wanted: impl Fn(&Path) -> bool) -> PathBuf {
    files_below(folder).into_iter().find(|path| is_wanted(path)).expect("there is no such file")
}

/// Adds a clip of the room with so many frames; returns its id once it is aligned.
async fn aligned(client: &Client, home: &str, frames: u32) -> String {
    let path = client.add_clip(home, zips::zip(&room::clip(frames))).await;
    assert_eq!(client.settled(&path).await["state"], "aligned");
    path.rsplit('/').next().unwrap().to_owned()
}

/// Waits until the home's map has these clips.
async fn mapped(client: &Client, home: &str, clips: &[&String]) {
    let wanted: BTreeSet<&str> = clips.iter().map(|clip| clip.as_str()).collect();
    eventually("the map has the clips", || async {
        let map = client.get(&format!("{home}/map")).await;
        let map = (map.status == 200).then(|| map.json())?;
        let there = map["clips"].as_array()?.iter().filter_map(|clip| clip["clip"].as_str());
        (there.collect::<BTreeSet<_>>() == wanted).then_some(())
    })
    .await;
}

#[tokio::test]
async fn a_truncated_database_is_told_and_its_files_stay() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &["--workers", "0"]);
    let home = server.client.make_home("h").await;
    server.client.add_clip(&home, zips::zip(&room::clip(2))).await;
    assert!(server.stop("TERM").success());
    let database = data.path().join("viola.sqlite");
    let whole = fs::read(&database).unwrap();
    for bytes in [whole.len() / 2, 1000] {
        cut(&database, bytes as u64);
        let said = refusal(data.path());
        assert!(said.contains("viola.sqlite is damaged") && said.contains("backup"), "{said}");
        fs::write(&database, &whole).unwrap();
    }
    let server = Process::serve(data.path(), &["--workers", "0"]);
    assert_eq!(server.client.get(&home).await.ok(200)["clips"], 1);
}

#[tokio::test]
async fn a_truncated_recording_is_a_fault_of_the_service_and_others_are_aligned() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &["--retry-seconds", "0.1"]);
    let home = server.client.make_home("h").await;
    let bytes = zips::zip(&room::clip(12));
    let bad = server.client.add_clip(&home, bytes.clone()).await;
    let id = bad.rsplit('/').next().unwrap();
    let file = file_below(&data.path().join("blobs"), |path| path.ends_with(format!("{id}/file")));
    cut(&file, bytes.len() as u64 / 2);
    let good = server.client.add_clip(&home, zips::zip(&room::clip(13))).await;
    server.client.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    assert_eq!(server.client.settled(&good).await["state"], "aligned");
    let waiting = eventually("the fault is told", || async {
        let clip = server.client.get(&bad).await.ok(200);
        (clip["reasons"][0]["code"] == "storage_fault").then_some(clip)
    })
    .await;
    // It is not the sender's fault, so the clip has not failed.
    assert_eq!((&waiting["state"], &waiting["job"]["state"]), (&json!("queued"), &json!("queued")));
    eventually("the home needs attention", || async {
        let needs = server.client.get(&home).await.ok(200)["needs_attention"].clone();
        (needs == json!(["service_fault"])).then_some(())
    })
    .await;
    fs::write(&file, &bytes).unwrap();
    assert_eq!(server.client.settled(&bad).await["state"], "aligned");
}

#[tokio::test]
async fn an_end_of_a_job_that_is_not_recorded_is_counted_as_a_fault() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &["--workers", "1", "--lease-seconds", "1"]);
    let client = &server.client;
    let refuse = "CREATE TRIGGER refuse BEFORE UPDATE ON jobs WHEN NEW.state = 'succeeded'
        BEGIN SELECT RAISE(ABORT, 'refused'); END";
    execute(data.path(), refuse).await;
    let home = client.make_room("h").await;
    client.add_clip(&home, zips::zip(&room::clip(12))).await;
    let metrics = eventually("the fault is counted", || async {
        let text = String::from_utf8(client.get("/metrics").await.bytes).unwrap();
        text.contains("viola_job_attempts_total{outcome=\"storage_fault\"} 1").then_some(text)
    })
    .await;
    assert!(metrics.contains("viola_leases_lost_total 0"), "{metrics}");
    assert!(!metrics.contains("outcome=\"aligned\""), "{metrics}");
}

#[tokio::test]
async fn an_acknowledged_upload_that_cannot_become_a_clip_is_a_warning() {
    let folder = TempDir::new().unwrap();
    let (data, log) = (folder.path().join("data"), folder.path().join("log"));
    let server = Process::serve(&data, &["--workers", "0"]);
    server.client.make_home("h").await;
    let upload = server.client.begin("h", 9).await;
    let sent = server.client.send(server.client.patch(&upload, 0, b"no clip!")).await;
    assert_eq!(sent.status, 204, "{sent:?}");
    assert!(server.stop("TERM").success());
    // As if the request with the last byte had been cut off.
    execute(&data, "UPDATE uploads SET state = 'arrived', length_bytes = received_bytes").await;
    let server = Process::serve_logged(&data, &log, &[]);
    let event = eventually("the refusal is logged", || async {
        let text = fs::read_to_string(&log).unwrap();
        let mut events = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        events.find(|event| event["message"] == "an acknowledged upload cannot become a clip")
    })
    .await;
    assert_eq!((&event["level"], &event["home"]), (&json!("WARN"), &json!("h")), "{event}");
    assert_eq!(event["upload"], upload.rsplit('/').next().unwrap(), "{event}");
    assert!(server.stop("TERM").success());
}

/// A damaged clip is left out of its home's map until it is whole again, and damaged files of the map are made again.
#[tokio::test]
async fn a_map_is_made_without_damaged_files() {
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &["--retry-seconds", "0.1"]);
    let client = &server.client;
    let home = &client.make_room("h").await;
    let [a, b] = [aligned(client, home, 12).await, aligned(client, home, 13).await];
    mapped(client, home, &[&a, &b]).await;

    let blobs = data.path().join("blobs");
    let cloud = file_below(&blobs, |path| path.to_string_lossy().contains(&a) && path.ends_with("cloud.ply"));
    let whole = fs::read(&cloud).unwrap();
    cut(&cloud, whole.len() as u64 / 2);
    let c = &aligned(client, home, 14).await;
    mapped(client, home, &[&b, c]).await;
    let map = client.get(&format!("{home}/map")).await.ok(200);
    assert!(map["left_out"][0]["reasons"].to_string().contains("\"results_damaged\""), "{map:#}");
    fs::remove_file(&cloud).unwrap();
    let d = &aligned(client, home, 15).await;
    mapped(client, home, &[&b, c, d]).await;
    fs::write(&cloud, &whole).unwrap();
    let e = &aligned(client, home, 16).await;
    mapped(client, home, &[&a, &b, c, d, e]).await;
    let clip = client.get(&format!("{home}/clips/{a}")).await.ok(200);
    assert!(!clip["reasons"].to_string().contains("results_damaged"), "{clip:#}");

    for file in files_below(&blobs.join("home-maps")) {
        // Files of earlier revisions may go meanwhile.
        let Ok(metadata) = fs::metadata(&file) else { continue };
        cut(&file, metadata.len() / 2);
    }
    let f = &aligned(client, home, 17).await;
    mapped(client, home, &[&a, &b, c, d, e, f]).await;
    let points = client.get(&format!("{home}/map/points")).await;
    assert!(points.status == 200 && points.bytes.len() > 10_000, "{} {}", points.status, points.bytes.len());
}

#[tokio::test]
async fn a_data_folder_that_cannot_be_written_is_told() {
    let folder = TempDir::new().unwrap();
    let Some(disk) = SmallDisk::mount(folder.path(), 288) else { return };
    disk.make_read_only();
    let mut command = prepared(disk.command(program()));
    command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(folder.path());
    let ended = command.stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap();
    let said = String::from_utf8(ended.stderr).unwrap();
    assert!(!ended.status.success() && ended.stdout.is_empty(), "{said}");
    assert!(said.contains("cannot be written") && said.contains("--data"), "{said}");
}

/// The disk fills while jobs and merges are under way, and is freed: they go on without a hand.
#[tokio::test]
async fn jobs_and_merges_go_on_when_a_full_disk_is_freed() {
    let folder = TempDir::new().unwrap();
    let Some(disk) = SmallDisk::mount(folder.path(), 288) else { return };
    let server = Process::serve_on(&disk, &["--retry-seconds", "0.1", "--lease-seconds", "1"]);
    let client = &server.client;
    let home = client.make_room("h").await;
    let mut clips = Vec::new();
    for frames in [12, 100] {
        clips.push(client.add_clip(&home, zips::zip(&room::clip(frames))).await);
        disk.fill(server.id());
        eventually("the service is not ready", || async {
            (client.get("/readyz").await.status == 503).then_some(())
        })
        .await;
        client.get(&home).await.ok(200);
        disk.free(server.id());
    }
    for clip in &clips {
        assert_eq!(client.settled(clip).await["state"], "aligned");
    }
    eventually("the map has both clips", || async {
        let map = client.get(&format!("{home}/map")).await;
        let clips = (map.status == 200).then(|| map.json()["clips"].as_array().map(Vec::len));
        (clips == Some(Some(2))).then_some(())
    })
    .await;
}
