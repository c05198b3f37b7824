//! Jobs in processes of their own.

use crate::server::Server;
use serde_json::Value;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;
use tempfile::TempDir;
use viola::jobs::{AlignJobError, ChildParams, JobLimitParams, Method};
use viola_storage::RetryPolicy;
use viola_testing::{eventually, room, until, zips};

pub const VIOLA: &str = env!("CARGO_BIN_EXE_viola");

/// A clip with a file of this name kills its process.
const DEADLY: &str = "deadly.txt";

/// Writes a program that replaces the child. `$clip` is its clip, `$into` its folder, `$tries` its starts.
pub fn script(folder: &TempDir, lines: &str) -> PathBuf {
    let path = folder.path().join("child");
    let tries = folder.path().join("tries").display().to_string();
    let head = format!(
        "#!/bin/sh\necho . >> {tries}\ntries=$(wc -l < {tries})\n\
        for word in \"$@\"; do\n[ \"$last\" = --clip ] && clip=$word\n[ \"$last\" = --into ] && into=$word\n\
        last=$word\ndone\n"
    );
    fs::write(&path, format!("{head}{lines}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// A method that never ends by itself: jobs end only in children.
const ENDLESS: Method = |_, _, _, progress| {
    while !progress.cancelled() {
        std::thread::sleep(Duration::from_millis(1));
    }
    Err(AlignJobError::Cancelled)
};

/// Starts a server whose jobs run in children.
async fn server(program: PathBuf) -> Server {
    server_with(program, JobLimitParams::default()).await
}

async fn server_with(program: PathBuf, limits: JobLimitParams) -> Server {
    Server::with(|params| {
        params.workers = 2;
        params.worker.method = ENDLESS;
        params.worker.limits = limits;
        params.worker.retry = RetryPolicy { first_delay: Duration::from_millis(1), ..RetryPolicy::default() };
        params.worker.child = Some(ChildParams {
            program,
            arguments: vec!["align-job".into()],
            environment: vec![("PATH".into(), "/usr/bin:/bin".into())],
        });
    })
    .await
}

/// Uploads clips, each with one more file, to a home with a map; returns their paths.
pub async fn upload(server: &Server, names: &[&str]) -> Vec<String> {
    let home = server.make_room("h").await;
    let mut paths = Vec::new();
    for name in names {
        let mut files = room::clip(12);
        files.push(((*name).to_owned(), b"text".to_vec()));
        paths.push(server.add_clip(&home, zips::zip(&files)).await);
    }
    paths
}

fn outcome(clip: &Value) -> (&str, Option<&str>, u64) {
    let reason = clip["reasons"].get(0).and_then(|reason| reason["code"].as_str());
    (clip["state"].as_str().unwrap(), reason, clip["job"]["attempts"].as_u64().unwrap())
}

#[tokio::test]
async fn a_child_gives_the_same_answer() {
    let apart = server(VIOLA.into()).await;
    let here = Server::start().await;
    let mut answers = Vec::new();
    for (server, clip) in [
        (&apart, upload(&apart, &["a.txt"]).await.remove(0)),
        (&here, upload(&here, &["a.txt"]).await.remove(0)),
    ] {
        let mut settled = server.settled(&clip).await;
        assert_eq!(settled["job"]["attempts"], 1);
        settled["alignment"].as_object_mut().unwrap().remove("seconds").unwrap();
        let overlay = server.get(&format!("{clip}/overlay.png")).await;
        assert_eq!(overlay.status, 200);
        answers.push((settled["state"].clone(), settled["alignment"].clone(), overlay.bytes));
    }
    assert_eq!(answers[0].0, "aligned");
    assert!(answers[0] == answers[1], "{:#}\n{:#}", answers[0].1, answers[1].1);
    let incoming = apart.blobs().into_iter().filter(|path| path.to_string_lossy().contains("/job-"));
    assert_eq!(incoming.count(), 0, "the job's folder is gone");
}

#[tokio::test]
async fn a_clip_that_kills_its_process_fails_and_others_are_aligned() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!("grep -q {DEADLY} \"$clip\" && kill -ABRT $$\nexec {VIOLA} \"$@\"");
    let server = server(script(&folder, &lines)).await;
    let clips = upload(&server, &["a.txt", DEADLY, "b.txt"]).await;
    let dead = server.settled(&clips[1]).await;
    assert_eq!(outcome(&dead), ("failed", Some("worker_died"), 3), "{dead:#}");
    for clip in [&clips[0], &clips[2]] {
        let clip = server.settled(clip).await;
        assert_eq!((outcome(&clip).0, outcome(&clip).2), ("aligned", 1), "{clip:#}");
    }
}

/// Returns the least address space in which the program starts, in KiB.
fn least_kib() -> u64 {
    let starts = |kib: &u64| {
        let script = format!("ulimit -c 0; ulimit -v {kib}; exec {VIOLA} --version");
        Command::new("sh").args(["-c", &script]).output().unwrap().status.success()
    };
    (16 << 10..1 << 20).step_by(4 << 10).find(starts).unwrap()
}

/// An allocation that the system refuses aborts the process; the clip would need as much again.
#[tokio::test]
async fn a_child_without_memory_dies_alone() {
    let folder = tempfile::tempdir().unwrap();
    // Memory for its threads, and for less than the clip needs.
    let lines = format!("ulimit -v {}; exec {VIOLA} \"$@\"", least_kib() + (12 << 10));
    let server = server(script(&folder, &lines)).await;
    let clip = upload(&server, &["a.txt"]).await.remove(0);
    let clip = server.settled(&clip).await;
    assert_eq!(outcome(&clip).0, "failed", "{clip:#}");
    server.lives().await;
}

/// The limit counts from the child's start: it needs no room for the program itself.
#[tokio::test]
async fn a_clip_that_needs_too_much_memory_fails_at_once() {
    let limits = JobLimitParams { memory_bytes: 1 << 20, ..JobLimitParams::default() };
    let server = server_with(VIOLA.into(), limits).await;
    let clip = upload(&server, &["a.txt"]).await.remove(0);
    let clip = server.settled(&clip).await;
    assert_eq!(outcome(&clip), ("failed", Some("too_large"), 1), "{clip:#}");
    let detail = clip["reasons"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("more memory than it may have, 1 MiB"), "{detail}");
    server.lives().await;
}

#[tokio::test]
async fn a_clip_that_takes_too_long_fails_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let limits = JobLimitParams { time: Duration::from_millis(300), ..JobLimitParams::default() };
    let server = server_with(script(&folder, "exec tail -f /dev/null"), limits.clone()).await;
    let here = Server::with(|params| {
        params.worker.method = ENDLESS;
        params.worker.limits = limits;
    })
    .await;
    for server in [&server, &here] {
        let clip = upload(server, &["a.txt"]).await.remove(0);
        let clip = server.settled(&clip).await;
        assert_eq!(outcome(&clip), ("failed", Some("took_too_long"), 1), "{clip:#}");
    }
}

/// A child that was asked to stop, or could not start, is no evidence against its clip.
#[tokio::test]
async fn a_child_that_does_not_come_to_work_costs_no_attempt() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!(
        "case $tries in 1) exit 1;; 2) kill -TERM $$;; 3) kill -INT $$;; 4) exit 127;; esac\nexec {VIOLA} \"$@\""
    );
    let server = server(script(&folder, &lines)).await;
    let clip = upload(&server, &["a.txt"]).await.remove(0);
    let clip = server.settled(&clip).await;
    assert_eq!((outcome(&clip).0, outcome(&clip).2), ("aligned", 1), "{clip:#}");
}

#[tokio::test]
async fn a_child_that_talks_nonsense_is_a_failed_attempt() {
    let folder = tempfile::tempdir().unwrap();
    // Nonsense, an endless line, and an empty result.
    let lines = "case $tries in 1) echo nonsense;; 2) exec cat /dev/zero;; *) echo {} > \"$into/alignment.json\"; echo '\"finished\"';; esac";
    let server = server(script(&folder, lines)).await;
    let clip = upload(&server, &["a.txt"]).await.remove(0);
    let clip = server.settled(&clip).await;
    assert_eq!(outcome(&clip), ("failed", Some("internal_error"), 3), "{clip:#}");
}

#[tokio::test]
async fn a_job_that_is_cancelled_or_given_up_ends_its_child() {
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("pid");
    let lines = format!("echo $$ > {0}.part; mv {0}.part {0}; exec tail -f /dev/null", told.display());
    let server = server(script(&folder, &lines)).await;
    let clip = upload(&server, &["a.txt"]).await.remove(0);
    let began = || {
        eventually("a child is at work", || async {
            fs::read_to_string(&told).ok()?.trim().parse::<i32>().ok()
        })
    };
    let process = began().await;
    let job = server.job_of(&clip).await;
    server.post(&format!("{job}/cancel"), "").await.ok(200);
    is_gone(process).await;
    assert_eq!(server.get(&clip).await.ok(200)["state"], "uploaded");

    fs::remove_file(&told).unwrap();
    server.post(&format!("{clip}/align"), "").await.ok(202);
    let process = began().await;
    server.stop().await;
    is_gone(process).await;
}

pub async fn is_gone(process: i32) {
    let process = rustix::process::Pid::from_raw(process).unwrap();
    until("the child is gone", async || {
        rustix::process::test_kill_process(process) == Err(rustix::io::Errno::SRCH)
    })
    .await;
}
