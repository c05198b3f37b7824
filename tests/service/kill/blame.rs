//! Dead processes and faults of the machine, and the clips that they count against.

use super::FRAMES;
use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, kill_process, prlimit};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use viola_testing::client::Client;
use viola_testing::files::files_below;
use viola_testing::process::Process;
use viola_testing::{eventually, room, zips};

/// Leases and pauses that are short enough for a test.
const SHORT: [&str; 4] = ["--lease-seconds", "1", "--retry-seconds", "0.1"];

/// Uploads clips to a home, then its map; returns the paths of the clips.
async fn upload(client: &Client, clips: usize, frames: u32) -> Vec<String> {
    let files = room::clip(frames);
    let with_number = |number: usize| {
        let mut files = files.clone();
        files.push(("notes.txt".to_owned(), number.to_string().into_bytes()));
        zips::zip(&files)
    };
    // Drawn first: the server closes a connection that is idle meanwhile.
    let clips: Vec<Vec<u8>> = (0..clips).map(with_number).collect();
    let home = client.make_home("h").await;
    let mut paths = Vec::new();
    for clip in clips {
        paths.push(client.add_clip(&home, clip).await);
    }
    client.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    paths
}

async fn jobs_in(client: &Client, state: &str) -> usize {
    let jobs = client.get(&format!("/v1/jobs?state={state}")).await.ok(200);
    jobs["items"].as_array().unwrap().len()
}

/// Returns the processes that align a clip below a data folder, with the name of their clip.
fn children(data: &Path) -> Vec<(Pid, String)> {
    let data = data.to_string_lossy();
    let mut found = Vec::new();
    for process in fs::read_dir("/proc").unwrap().flatten() {
        let Some(id) = process.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
        let said = fs::read(process.path().join("cmdline")).unwrap_or_default();
        let said = String::from_utf8_lossy(&said);
        let arguments: Vec<&str> = said.split('\0').collect();
        if arguments.get(1) != Some(&"align-job") || !said.contains(&*data) {
            continue;
        }
        let clip = arguments.iter().find_map(|path| path.strip_suffix("/file")?.rsplit('/').next());
        found.push((Pid::from_raw(id).unwrap(), clip.unwrap().to_owned()));
    }
    found
}

fn outcome(clip: &Value) -> (&str, Option<&str>, u64) {
    let reason = clip["reasons"].get(0).and_then(|reason| reason["code"].as_str());
    (clip["state"].as_str().unwrap(), reason, clip["job"]["attempts"].as_u64().unwrap())
}

/// Kills of a server, however many, count against none of its clips.
#[tokio::test]
async fn kills_of_a_server_are_held_against_no_clip() {
    let data = TempDir::new().unwrap();
    let mut arguments = vec!["--workers", "3"];
    arguments.extend(SHORT);
    let mut server = Process::serve(data.path(), &arguments);
    let clips = upload(&server.client, 3, FRAMES).await;
    for _ in 0..5 {
        eventually("all clips are worked on", || async {
            (jobs_in(&server.client, "running").await == clips.len()).then_some(())
        })
        .await;
        eventually("each has a process", || async {
            (children(data.path()).len() == clips.len()).then_some(())
        })
        .await;
        server.kill();
        eventually("no process outlives its server", || async {
            children(data.path()).is_empty().then_some(())
        })
        .await;
        server = Process::serve(data.path(), &arguments);
    }
    for clip in &clips {
        let clip = server.client.settled(clip).await;
        assert_eq!((outcome(&clip).0, outcome(&clip).2), ("aligned", 1), "{clip:#}");
    }
    assert_eq!(jobs_in(&server.client, "failed").await, 0);
    assert!(!has_leftovers(data.path()), "the folders of jobs are gone");
}

fn has_leftovers(data: &Path) -> bool {
    files_below(&data.join("blobs/incoming")).iter().any(|path| path.to_string_lossy().contains("/job-"))
}

/// A clip whose own process dies while the server lives fails after its attempts, and no other clip does.
#[tokio::test]
async fn a_clip_whose_own_process_dies_fails_alone() {
    let data = TempDir::new().unwrap();
    let mut arguments = vec!["--workers", "2"];
    arguments.extend(SHORT);
    let server = Process::serve(data.path(), &arguments);
    let clips = upload(&server.client, 2, FRAMES).await;
    // As the system kills a process that uses too much memory.
    let bad = clips[0].rsplit('/').next().unwrap();
    let blamed = eventually("the clip has failed", || async {
        for (process, clip) in children(data.path()) {
            if clip == bad {
                // It may have ended by itself.
                let _ = kill_process(process, Signal::KILL);
            }
        }
        let clip = server.client.get(&clips[0]).await.ok(200);
        (clip["state"] == "failed").then_some(clip)
    })
    .await;
    assert_eq!(outcome(&blamed), ("failed", Some("worker_died"), 3), "{blamed:#}");
    let other = server.client.settled(&clips[1]).await;
    assert_eq!((outcome(&other).0, outcome(&other).2), ("aligned", 1), "{other:#}");
    assert!(!has_leftovers(data.path()), "the folders of jobs are gone");
}

/// Secrets of a service stay with it.
#[tokio::test]
async fn a_job_knows_no_secret_of_its_server() {
    let data = TempDir::new().unwrap();
    let secrets = [("POSTGRES_PASSWORD", "a secret"), ("VIOLA_S3_SECRET_ACCESS_KEY", "a secret")];
    let server =
        Process::serve_with(data.path(), &[secrets.as_slice(), &[("RAYON_NUM_THREADS", "2")]].concat());
    upload(&server.client, 1, FRAMES).await;
    let process = eventually("a job has a process", || async { children(data.path()).pop() }).await.0;
    let environment = fs::read(format!("/proc/{}/environ", process.as_raw_pid())).unwrap();
    let environment = String::from_utf8(environment).unwrap();
    assert!(environment.contains("RAYON_NUM_THREADS=2") && !environment.contains("secret"), "{environment}");
}

/// A server that cannot open files retries its clips until it can.
#[tokio::test]
async fn a_server_without_descriptors_fails_no_clip() {
    let folder = TempDir::new().unwrap();
    let (data, log) = (folder.path().join("data"), folder.path().join("log"));
    let server = Process::serve_logged(&data, &log, &["--retry-seconds", "0.1"]);
    let clips = upload(&server.client, 4, 12).await;
    let process = Pid::from_raw(server.id() as i32);
    let whole = getrlimit(Resource::Nofile);
    let limit = |files: Option<u64>| Rlimit { current: files, maximum: whole.maximum };
    // Fewer than it has.
    prlimit(process, Resource::Nofile, limit(Some(8))).unwrap();
    // More often than the three attempts of each clip.
    let faults = || {
        let log = fs::read_to_string(&log).unwrap();
        log.lines().filter(|line| line.contains("ended an attempt")).count()
    };
    eventually("each clip has met more than three faults", || async {
        (faults() > 3 * clips.len()).then_some(())
    })
    .await;
    prlimit(process, Resource::Nofile, limit(whole.current)).unwrap();
    for clip in &clips {
        let clip = server.client.settled(clip).await;
        assert_eq!((outcome(&clip).0, outcome(&clip).2), ("aligned", 1), "{clip:#}");
    }
}
