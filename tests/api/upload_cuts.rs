//! Connections that break, stall, lie and race: no acknowledged byte is lost or changed.

use crate::attacks::connect;
use crate::clips::small_clip;
use crate::server::Server;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use serde_json::json;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;
use viola_testing::tus::{metadata, sha256};
use viola_testing::{eventually, until};

async fn check_made(server: &Server, clip: &str, bytes: &[u8]) {
    assert_eq!(server.get(clip).await.ok(200)["sha256"], json!(sha256(bytes)));
    // A request that was cut off or overtaken may still be cleaning up.
    until("nothing is left but the clip", async || server.blobs().len() == 1).await;
}

/// Begins an upload of a clip; returns the clip and the upload's path.
async fn begun(server: &Server) -> (Vec<u8>, String) {
    server.make_home("h").await;
    let clip = small_clip();
    let upload = server.begin("h", clip.len()).await;
    (clip, upload)
}

/// Returns the beginning of the answer on a connection.
async fn answer_of(mut connection: TcpStream) -> String {
    let read = tokio::task::spawn_blocking(move || {
        let mut answer = [0; 4000];
        let length = connection.read(&mut answer).unwrap();
        String::from_utf8_lossy(&answer[..length]).into_owned()
    });
    read.await.unwrap()
}

#[test]
fn any_cuts_resume_to_the_same_bytes() {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let clip = small_clip();
    // Fractions of the missing bytes that arrive before each cut, and the size of pieces within a request.
    let cuts =
        (proptest::collection::vec(0.0..1.0f64, 0..8), prop_oneof![Just(1u64), 500..5000u64, Just(1 << 20)]);
    let config = Config { cases: 16, failure_persistence: None, ..Config::default() };
    TestRunner::new(config)
        .run(&cuts, |(cuts, piece_bytes)| {
            runtime.block_on(async {
                let server = Server::with(|params| {
                    params.workers = 0;
                    params.uploads.piece_bytes = piece_bytes;
                })
                .await;
                server.make_home("h").await;
                let upload = server.begin("h", clip.len()).await;
                let mut acknowledged = 0;
                for share in cuts {
                    let offset = server.offset(&upload).await;
                    assert!(
                        offset >= acknowledged,
                        "{acknowledged} bytes were acknowledged, {offset} are there"
                    );
                    acknowledged = offset;
                    let sent = (share * (clip.len() - offset) as f64) as usize;
                    drop(server.patch_partly(&upload, offset, &clip, sent));
                }
                let last = server.go_on(&upload, &clip).await;
                assert_eq!(last.status, 204, "{last:?}");
                check_made(&server, last.header("viola-clip"), &clip).await;
                server.stop().await;
            });
            Ok(())
        })
        .unwrap();
}

#[tokio::test]
async fn what_arrived_on_a_broken_connection_is_kept() {
    let server = Server::without_workers().await;
    let (clip, upload) = begun(&server).await;
    drop(server.patch_partly(&upload, 0, &clip, 1234));
    until("the bytes are kept", async || server.offset(&upload).await == 1234).await;
    // A checksum covers the whole body or nothing.
    let mut connection = connect(&server);
    write!(
        connection,
        "PATCH {upload} HTTP/1.1\r\nhost: localhost\r\ntus-resumable: 1.0.0\r\nupload-offset: 1234\r\n\
         content-type: application/offset+octet-stream\r\nupload-checksum: sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0=\r\n\
         content-length: 11\r\n\r\nhello"
    )
    .unwrap();
    until("half of the body has arrived", async || server.blobs().len() == 2).await;
    drop(connection);
    until("it is gone", async || server.blobs().len() == 1).await;
    assert_eq!(server.offset(&upload).await, 1234);
}

#[tokio::test]
async fn a_silent_client_is_told_and_loses_nothing() {
    let server = Server::with(|params| {
        params.workers = 0;
        params.bodies.window = Duration::from_millis(200);
    })
    .await;
    let (clip, upload) = begun(&server).await;
    let mut connection = server.patch_partly(&upload, 0, &clip, 777);
    let answer = tokio::task::spawn_blocking(move || {
        let mut answer = String::new();
        connection.read_to_string(&mut answer).map(|_| answer)
    });
    let answer = answer.await.unwrap().unwrap();
    // Clients of tus give up at 408.
    assert!(answer.starts_with("HTTP/1.1 503 ") && answer.contains("body-stalled"), "{answer}");
    assert!(answer.contains("retry-after: 1\r\n"), "{answer}");
    assert_eq!(server.offset(&upload).await, 777);
}

#[tokio::test]
async fn a_slow_client_is_acknowledged_on_its_way() {
    let server = Server::with(|params| {
        params.workers = 0;
        params.uploads.piece_age = Duration::ZERO;
    })
    .await;
    let (clip, upload) = begun(&server).await;
    let mut connection = server.patch_partly(&upload, 0, &clip, 100);
    until("it is acknowledged", async || server.offset(&upload).await == 100).await;
    connection.write_all(&clip[100..]).unwrap();
    until("the clip is made", async || !server.head(&upload).await.header("viola-clip").is_empty()).await;
    check_made(&server, server.head(&upload).await.header("viola-clip"), &clip).await;
}

/// The bytes before a pause of the network are durable before the next ones come.
#[tokio::test]
async fn a_paused_client_is_acknowledged_in_its_pause() {
    let server = Server::with(|params| {
        params.workers = 0;
        params.uploads.piece_age = Duration::from_millis(50);
    })
    .await;
    let (clip, upload) = begun(&server).await;
    let connection = server.patch_partly(&upload, 0, &clip, 100);
    until("it is acknowledged", async || server.offset(&upload).await == 100).await;
    drop(connection);
}

#[tokio::test]
async fn the_newer_of_two_writers_goes_on() {
    let server = Server::without_workers().await;
    let (clip, upload) = begun(&server).await;
    // Other bytes from an old connection that is still open.
    let mut old = server.patch_partly(&upload, 0, &vec![7; clip.len()], 2000);
    until("its bytes have arrived", async || server.blobs().len() == 1).await;
    let half = clip.len() / 2;
    server.send(server.patch(&upload, 0, &clip[..half])).await.ok(204);
    old.write_all(&vec![7; clip.len() - 2000]).unwrap();
    let told = answer_of(old).await;
    assert!(told.starts_with("HTTP/1.1 409 ") && told.contains("upload-offset-mismatch"), "{told}");
    assert_eq!(server.offset(&upload).await, half);
    let last = server.send(server.patch(&upload, half, &clip[half..])).await;
    check_made(&server, last.header("viola-clip"), &clip).await;
}

/// A request that was refused for its size once stopped the one that went on.
#[tokio::test]
async fn a_refused_request_stops_no_other() {
    let server = Server::without_workers().await;
    let (clip, upload) = begun(&server).await;
    let mut running = server.patch_partly(&upload, 0, &clip, 1000);
    until("its bytes have arrived", async || server.blobs().len() == 1).await;
    let larger = server.send(server.patch(&upload, 0, &vec![7; clip.len() + 1])).await;
    larger.problem(413, "body-too-large");
    running.write_all(&clip[1000..]).unwrap();
    let told = answer_of(running).await;
    assert!(told.starts_with("HTTP/1.1 204 "), "{told}");
    check_made(&server, server.head(&upload).await.header("viola-clip"), &clip).await;
}

/// A phone whose POST hangs asks for its upload by a second POST, and sends the bytes by PATCH.
#[tokio::test]
async fn a_post_that_was_overtaken_deletes_nothing() {
    let clip = small_clip();
    let sum = sha256(&clip);
    for named in [("sha256", sum.as_str()), ("idempotency_key", "k")] {
        let server = Server::without_workers().await;
        server.make_home("h").await;
        let told = metadata(&[("home", "h"), named]);
        let mut first = connect(&server);
        write!(
            first,
            "POST /v1/uploads HTTP/1.1\r\nhost: localhost\r\ntus-resumable: 1.0.0\r\nupload-length: {length}\r\n\
             upload-metadata: {told}\r\ncontent-type: application/offset+octet-stream\r\n\
             content-length: {length}\r\n\r\n",
            length = clip.len()
        )
        .unwrap();
        first.write_all(&clip[..1000]).unwrap();
        until("its bytes have arrived", async || server.blobs().len() == 1).await;
        let again = server.send(server.announce(clip.len(), &[("home", "h"), named])).await;
        assert_eq!((again.status, again.header("upload-offset")), (201, "0"), "{named:?}");
        let (upload, half) = (again.header("location").to_owned(), clip.len() / 2);
        server.send(server.patch(&upload, 0, &clip[..half])).await.ok(204);
        first.write_all(&clip[1000..]).unwrap();
        let told = answer_of(first).await;
        assert!(told.starts_with("HTTP/1.1 409 "), "{named:?}: {told}");
        assert_eq!(server.offset(&upload).await, half, "{named:?}");
        let last = server.go_on(&upload, &clip).await;
        check_made(&server, last.header("viola-clip"), &clip).await;
        server.stop().await;
    }
}

#[tokio::test]
async fn many_writers_at_once_make_one_clip() {
    let server = Server::without_workers().await;
    let (clip, upload) = begun(&server).await;
    let many = (0..8).map(|_| server.go_on(&upload, &clip));
    for answer in futures::future::join_all(many).await {
        assert_eq!((answer.status, answer.header("upload-offset")), (204, &*clip.len().to_string()));
    }
    let made = eventually("the clip is made", || async {
        let made = server.head(&upload).await.header("viola-clip").to_owned();
        (!made.is_empty()).then_some(made)
    })
    .await;
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 1);
    check_made(&server, &made, &clip).await;
}

#[tokio::test]
async fn a_server_that_stops_keeps_what_arrived() {
    let server = Server::without_workers().await;
    let (clip, upload) = begun(&server).await;
    let mut connection = server.patch_partly(&upload, 0, &clip, 500);
    until("its bytes have arrived", async || server.blobs().len() == 1).await;
    server.stop().await;
    let mut answer = String::new();
    connection.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 503 ") && answer.contains("problem:stopping"), "{answer}");
    assert!(answer.contains("retry in a few seconds"), "{answer}");
}
