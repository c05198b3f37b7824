//! Workers whose method panics, is slow, or does not react to a stop.

use crate::server::Server;
use rustix::io::Errno;
use serde_json::{Value, json};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};
use viola::jobs::{AlignJobError, JobLimitParams, Method, align_clip};
use viola_formats::clip::ClipError;
use viola_formats::container::ContainerError;
use viola_geometry::progress::{EarlyPose, Stage, check};
use viola_geometry::{LevelName, Pose2};
use viola_storage::RetryPolicy;
use viola_testing::{eventually, room, until};

async fn server(method: Method) -> Server {
    Server::with(|params| {
        params.worker.method = method;
        params.worker.grace = Duration::from_millis(100);
        params.worker.retry = RetryPolicy { first_delay: Duration::from_millis(1), ..RetryPolicy::default() };
    })
    .await
}

/// Uploads a clip to a home with a map; returns its path.
async fn upload(server: &Server) -> String {
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await;
    server.film(&home, 12).await
}

/// Returns the error of a clip that the system could not read.
fn unreadable(error: Errno) -> AlignJobError {
    let source = error.into();
    ClipError::Container(ContainerError::Unreadable { name: "clip".into(), source }).into()
}

/// Waits on the thread of a method.
fn wait_for(flag: &AtomicBool) {
    while !flag.load(Ordering::SeqCst) {
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn outcome(clip: &Value) -> (&str, u64) {
    (clip["state"].as_str().unwrap(), clip["job"]["attempts"].as_u64().unwrap())
}

#[tokio::test]
async fn a_panic_is_a_failed_attempt() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let once: Method = |clip, map, params, progress| {
        assert!(CALLS.fetch_add(1, Ordering::SeqCst) > 0, "the first call");
        align_clip(clip, map, params, progress)
    };
    let server = server(once).await;
    let clip = upload(&server).await;
    assert_eq!(outcome(&server.settled(&clip).await), ("aligned", 2));
}

#[tokio::test]
async fn panics_end_in_a_failed_clip_and_not_in_a_dead_worker() {
    let server = server(|_, _, _, _| panic!("a secret of the method")).await;
    for _ in 0..2 {
        let clip = upload(&server).await;
        let clip = server.settled(&clip).await;
        assert_eq!(outcome(&clip), ("failed", 3));
        assert_eq!(clip["reasons"][0]["code"], "internal_error");
        assert_eq!((&clip["job"]["state"], &clip["job"]["error"]), (&"failed".into(), &clip["reasons"][0]));
        assert!(!clip.to_string().contains("secret"));
    }
}

/// Six faults are more than the three attempts of a job.
#[tokio::test]
async fn a_machine_without_descriptors_costs_no_attempt() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let none_for_a_while: Method = |clip, map, params, progress| {
        if CALLS.fetch_add(1, Ordering::SeqCst) < 6 {
            return Err(unreadable(Errno::MFILE));
        }
        align_clip(clip, map, params, progress)
    };
    let server = server(none_for_a_while).await;
    let clip = upload(&server).await;
    assert_eq!(outcome(&server.settled(&clip).await), ("aligned", 1));
    assert_eq!(CALLS.load(Ordering::SeqCst), 7);
}

/// Otherwise a machine with a full disk takes all jobs, faster than those that could do them.
#[tokio::test]
async fn a_worker_rests_after_a_fault() {
    const REST: Duration = Duration::from_secs(2);
    static CALLS: Mutex<Vec<Instant>> = Mutex::new(Vec::new());
    let never: Method = |_, _, _, _| {
        CALLS.lock().unwrap().push(Instant::now());
        Err(unreadable(Errno::NOSPC))
    };
    let server = Server::with(|params| {
        params.worker.method = never;
        params.worker.retry = RetryPolicy { first_delay: REST, ..RetryPolicy::default() };
    })
    .await;
    for _ in 0..2 {
        upload(&server).await;
    }
    let calls = eventually("two jobs were tried", || async {
        let calls = CALLS.lock().unwrap().clone();
        (calls.len() > 1).then_some(calls)
    })
    .await;
    assert!(calls[1].duration_since(calls[0]) >= REST);
}

/// The job of a removed clip finds no file, which is no fault of the machine.
#[tokio::test]
async fn a_worker_does_not_rest_after_a_removed_clip() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    static IS_REMOVED: AtomicBool = AtomicBool::new(false);
    let first_is_removed: Method = |clip, map, params, progress| {
        if CALLS.fetch_add(1, Ordering::SeqCst) > 0 {
            return align_clip(clip, map, params, progress);
        }
        wait_for(&IS_REMOVED);
        Err(unreadable(Errno::NOENT))
    };
    let server = Server::with(|params| {
        params.worker.method = first_is_removed;
        params.worker.retry =
            RetryPolicy { first_delay: Duration::from_secs(3600), ..RetryPolicy::default() };
    })
    .await;
    let removed = upload(&server).await;
    until("its job has begun", async || CALLS.load(Ordering::SeqCst) > 0).await;
    server.delete(&removed).await.ok(204);
    IS_REMOVED.store(true, Ordering::SeqCst);
    let clip = upload(&server).await;
    assert_eq!(outcome(&server.settled(&clip).await), ("aligned", 1));
}

#[tokio::test]
async fn a_clip_whose_blob_is_away_for_a_while_is_aligned() {
    let server = server(align_clip).await;
    let home = server.make_home("h").await;
    let clip = server.film(&home, 12).await;
    let blob = server.blobs().into_iter().find(|path| path.ends_with("file")).unwrap();
    let away = blob.parent().unwrap().with_file_name("away");
    std::fs::rename(&blob, &away).unwrap();
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    eventually("more than three attempts came to nothing", || async {
        let clip = server.get(&clip).await.ok(200);
        let code = clip["reasons"].get(0).map(|reason| reason["code"].clone());
        // The job changes three times in each.
        let is_later = clip["job"]["version"].as_i64() > Some(3 * 5);
        (code == Some("storage_fault".into()) && is_later)
            .then(|| assert_eq!(clip["state"], "queued", "{clip:#}"))
    })
    .await;
    std::fs::rename(&away, &blob).unwrap();
    assert_eq!(outcome(&server.settled(&clip).await), ("aligned", 1));
}

#[tokio::test]
async fn a_long_job_keeps_its_lease() {
    let long: Method = |clip, map, params, progress| {
        let until = Instant::now() + Duration::from_millis(2500);
        progress.enter(Stage::Decode);
        while Instant::now() < until {
            check(progress).map_err(|_| AlignJobError::Cancelled)?;
            std::thread::sleep(Duration::from_millis(1));
        }
        align_clip(clip, map, params, progress)
    };
    // Two workers: the second would take the job as soon as the first lost it.
    let server = Server::with(|params| {
        params.workers = 2;
        params.worker.method = long;
        params.worker.lease = Duration::from_secs(1);
    })
    .await;
    let clip = upload(&server).await;
    assert_eq!(outcome(&server.settled(&clip).await), ("aligned", 1));
}

#[tokio::test]
async fn a_method_that_does_not_hear_cannot_hold_the_server() {
    static RUNS: AtomicBool = AtomicBool::new(false);
    static LET_GO: AtomicBool = AtomicBool::new(false);
    let deaf: Method = |_, _, _, _| {
        RUNS.store(true, Ordering::SeqCst);
        wait_for(&LET_GO);
        Err(AlignJobError::Cancelled)
    };
    let server = server(deaf).await;
    upload(&server).await;
    until("the method runs", async || RUNS.load(Ordering::SeqCst)).await;
    let begun = Instant::now();
    server.stop().await;
    // Less than the lease, and more than a busy machine needs.
    assert!(begun.elapsed() < Duration::from_secs(20));
    LET_GO.store(true, Ordering::SeqCst);
}

/// A heartbeat may wait for ten seconds.
#[tokio::test]
async fn a_heartbeat_that_waits_for_the_database_does_not_hold_up_the_job() {
    static RUNS: AtomicBool = AtomicBool::new(false);
    static IS_LOCKED: AtomicBool = AtomicBool::new(false);
    static HEARD: AtomicBool = AtomicBool::new(false);
    let hears: Method = |_, _, _, progress| {
        RUNS.store(true, Ordering::SeqCst);
        wait_for(&IS_LOCKED);
        // A new stage is worth a heartbeat.
        progress.enter(Stage::Label);
        while check(progress).is_ok() {
            std::thread::sleep(Duration::from_millis(1));
        }
        HEARD.store(true, Ordering::SeqCst);
        Err(AlignJobError::Cancelled)
    };
    let server = server(hears).await;
    upload(&server).await;
    until("the method runs", async || RUNS.load(Ordering::SeqCst)).await;
    let lock = server.lock_jobs().await;
    IS_LOCKED.store(true, Ordering::SeqCst);
    tokio::time::sleep(Duration::from_secs(1)).await;
    let begun = Instant::now();
    let stopped = tokio::spawn(server.stop());
    until("the method is asked to stop", async || HEARD.load(Ordering::SeqCst)).await;
    assert!(begun.elapsed() < Duration::from_secs(5));
    drop(lock);
    stopped.await.unwrap();
}

#[tokio::test]
async fn an_early_pose_is_shown_while_the_job_runs() {
    static LET_GO: AtomicBool = AtomicBool::new(false);
    const POSE: EarlyPose = EarlyPose {
        level: LevelName::MAIN,
        map_from_clip: Pose2 { x_m: 1.5, y_m: -2.0, yaw_rad: 0.25 },
        probability: 0.95,
    };
    let early: Method = |clip, map, params, progress| {
        assert!(progress.wants_early_pose());
        progress.enter(Stage::Label);
        progress.early_pose(POSE);
        while !LET_GO.load(Ordering::SeqCst) {
            check(progress).map_err(|_| AlignJobError::Cancelled)?;
            std::thread::sleep(Duration::from_millis(1));
        }
        align_clip(clip, map, params, progress)
    };
    let server = server(early).await;
    let path = upload(&server).await;
    let clip = eventually("the pose is shown", || async {
        let clip = server.get(&path).await.ok(200);
        (!clip["job"]["early_pose"].is_null()).then_some(clip)
    })
    .await;
    // It is no answer: the clip is still being aligned.
    assert_eq!((&clip["state"], &clip["alignment"]), (&"aligning".into(), &Value::Null));
    let pose = json!({
        "level": "main", "map_from_clip": { "x_m": 1.5, "y_m": -2.0, "yaw_rad": 0.25 }, "probability": 0.95,
    });
    assert_eq!(clip["job"]["early_pose"], pose);
    LET_GO.store(true, Ordering::SeqCst);
    let clip = server.settled(&path).await;
    assert_eq!((&clip["state"], &clip["job"]["early_pose"]), (&"aligned".into(), &Value::Null));
}

/// A merge ends at its limit of time, and is repeated like one that failed.
#[tokio::test]
async fn a_map_whose_merges_take_too_long_is_failing() {
    let limits = JobLimitParams { merge_time: Duration::ZERO, ..JobLimitParams::default() };
    let server = Server::with(|params| params.worker.limits = limits).await;
    let clip = upload(&server).await;
    assert_eq!(server.settled(&clip).await["state"], "aligned");
    let home = clip.split("/clips/").next().unwrap();
    until("two merges have failed", async || {
        // The pauses between them are short here.
        server.execute("UPDATE homes SET map_due_at = 0").await;
        server.get(home).await.ok(200)["map_state"] == "failing"
    })
    .await;
    server.get(&format!("{home}/map")).await.problem(404, "map-not-found");
}
