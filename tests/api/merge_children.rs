//! Merges in processes of their own.

use crate::children::{VIOLA, is_gone, script, upload};
use crate::server::Server;
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use std::time::Duration;
use viola::jobs::{ChildParams, JobLimitParams};
use viola_testing::{eventually, room, zips};

const ROUTES: [&str; 4] = ["points?format=ply", "objects", "rooms", "plan?format=svg"];

/// Starts a server whose merges run in children.
async fn server(program: PathBuf, limits: JobLimitParams) -> Server {
    Server::with(|params| {
        params.worker.limits = limits;
        params.worker.merge_child = Some(ChildParams {
            program,
            arguments: vec!["merge-home".into()],
            environment: vec![("PATH".into(), "/usr/bin:/bin".into())],
        });
    })
    .await
}

/// Uploads a clip; returns its home when it is aligned.
async fn home_of_a_clip(server: &Server) -> String {
    let clip = upload(server, &["a.txt"]).await.remove(0);
    assert_eq!(server.settled(&clip).await["state"], "aligned");
    clip.split("/clips/").next().unwrap().to_owned()
}

/// Waits for a state of the home's map.
async fn in_state(server: &Server, home: &str, state: &str) -> Value {
    eventually(state, || async {
        // The pauses after failed merges are short here.
        server.execute("UPDATE homes SET map_due_at = 0 WHERE map_due_at IS NOT NULL").await;
        let told = server.get(home).await.ok(200);
        (told["map_state"] == state).then_some(told)
    })
    .await
}

#[tokio::test]
async fn a_child_makes_the_same_map() {
    let apart = server(VIOLA.into(), JobLimitParams::default()).await;
    let here = Server::start().await;
    let mut maps = Vec::new();
    for server in [&apart, &here] {
        let home = home_of_a_clip(server).await;
        in_state(server, &home, "current").await;
        // The second merge continues from the files of the first.
        let second = server.post(&format!("{home}/clips"), zips::zip(&room::clip(9))).await.ok(201);
        assert_eq!(
            server.settled(&format!("{home}/clips/{}", second["id"].as_str().unwrap())).await["state"],
            "aligned"
        );
        in_state(server, &home, "current").await;
        let clips = server.get(&format!("{home}/clips")).await.ok(200);
        let ids: Vec<&str> =
            clips["items"].as_array().unwrap().iter().map(|clip| clip["id"].as_str().unwrap()).collect();
        let mut map = Vec::new();
        for route in ROUTES {
            let file = server.get(&format!("{home}/map/{route}")).await;
            assert_eq!(file.status, 200, "{route}");
            // Each server gives its clips other ids.
            let text = String::from_utf8_lossy(&file.bytes).into_owned();
            map.push(ids.iter().fold(text, |text, id| text.replace(id, "CLIP")));
        }
        assert_eq!(ids.len(), 2);
        maps.push(map);
    }
    for (number, route) in ROUTES.iter().enumerate() {
        assert!(maps[0][number] == maps[1][number], "{route}");
    }
    let left = apart.blobs().into_iter().filter(|path| path.to_string_lossy().contains("/job-"));
    assert_eq!(left.count(), 0, "a merge has no folder");
}

#[tokio::test]
async fn a_merge_that_needs_too_much_memory_fails_alone() {
    let limits = JobLimitParams { merge_memory_bytes: 1 << 20, ..JobLimitParams::default() };
    let server = server(VIOLA.into(), limits).await;
    let home = home_of_a_clip(&server).await;
    in_state(&server, &home, "failing").await;
    server.get(&format!("{home}/map")).await.problem(404, "map-not-found");
    server.lives().await;
}

/// A killed process, one that could not start, and nonsense.
#[tokio::test]
async fn a_merge_whose_process_dies_is_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let lines = format!(
        "case $tries in 1) kill -KILL $$;; 2) exit 1;; 3) exec cat /dev/zero;; esac\nexec {VIOLA} \"$@\""
    );
    let server = server(script(&folder, &lines), JobLimitParams::default()).await;
    let home = home_of_a_clip(&server).await;
    in_state(&server, &home, "current").await;
    assert_eq!(fs::read_to_string(folder.path().join("tries")).unwrap().lines().count(), 4);
}

/// A service manager, or Ctrl-C, may ask all processes of a service to stop.
#[tokio::test]
async fn a_merge_whose_process_is_asked_to_stop_is_repeated_at_once_and_has_not_failed() {
    let folder = tempfile::tempdir().unwrap();
    // A shell without a terminal starts `make test &` with SIGINT ignored, so the test does not rely on it.
    let lines = "case $tries in 1 | 2) kill -TERM $$;; esac\nexec tail -f /dev/null";
    let server = server(script(&folder, lines), JobLimitParams::default()).await;
    let home = home_of_a_clip(&server).await;
    eventually("the third process", || async {
        let tries = fs::read_to_string(folder.path().join("tries")).ok()?;
        (tries.lines().count() == 3).then_some(())
    })
    .await;
    assert_eq!(server.get(&home).await.ok(200)["map_state"], "due");
    server.stop().await;
}

#[tokio::test]
async fn a_merge_that_takes_too_long_or_is_given_up_ends_its_process() {
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("pid");
    let lines = format!("echo $$ > {0}.part; mv {0}.part {0}; exec tail -f /dev/null", told.display());
    let limits = JobLimitParams { merge_time: Duration::from_millis(500), ..JobLimitParams::default() };
    let began = || {
        eventually("a child is at work", || async {
            fs::read_to_string(&told).ok()?.trim().parse::<i32>().ok()
        })
    };
    let short = server(script(&folder, &lines), limits).await;
    let home = home_of_a_clip(&short).await;
    is_gone(began().await).await;
    in_state(&short, &home, "failing").await;
    short.stop().await;

    let _ = fs::remove_file(&told);
    let server = server(script(&folder, &lines), JobLimitParams::default()).await;
    home_of_a_clip(&server).await;
    let process = began().await;
    server.stop().await;
    is_gone(process).await;
}
