//! Exports: their limit, slow clients, and their use of threads. The map's tests check their content.

use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use std::io::{Cursor, ErrorKind};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use viola::api::ConnectionParams;
use viola_storage::SweepLimit;
use viola_testing::client::id_of;
use viola_testing::{eventually, room, until, zips};

/// Timeout for a client that reads slowly.
const LIMIT: Duration = Duration::from_secs(1);
/// Timeout for clients that read nothing: none is cut off while the test takes all places.
const LONG_LIMIT: Duration = Duration::from_secs(5);
/// More than the system buffers for a connection that nobody reads.
const RECORDING_BYTES: usize = 3 << 20;

async fn server(limit: Duration) -> Server {
    Server::with(|params| {
        params.workers = 0;
        params.connections = ConnectionParams { write: limit, ..ConnectionParams::default() };
    })
    .await
}

/// Creates a home with a large recording; returns its path and that of the job.
async fn home_with_recording(server: &Server) -> (String, String) {
    let home = server.make_room("h").await;
    let clip = server.add_clip(&home, zips::zip_of_size(&room::clip(2), RECORDING_BYTES)).await;
    let job = server.job_of(&clip).await;
    (home, job)
}

/// Requests an export and reads only the status of the answer.
async fn ask(server: &Server, home: &str) -> (u16, TcpStream) {
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(16 << 10).unwrap();
    let address = server.base.strip_prefix("http://").unwrap().parse().unwrap();
    let mut connection = socket.connect(address).await.unwrap();
    let request = format!("GET {home}/export HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
    connection.write_all(request.as_bytes()).await.unwrap();
    let mut status = [0; 12];
    connection.read_exact(&mut status).await.unwrap();
    let status = status.strip_prefix(b"HTTP/1.1 ").unwrap();
    (std::str::from_utf8(status).unwrap().parse().unwrap(), connection)
}

#[tokio::test]
async fn clients_that_do_not_read_are_cut_off_and_free_their_places() {
    let server = server(LONG_LIMIT).await;
    let (home, job) = home_with_recording(&server).await;
    // The job does not change, so its events are a connection that is silent for long.
    let mut events = server.watch(&format!("{job}/events"), None).await;
    assert!(events.chunk().await.unwrap().is_some());

    let mut silent = Vec::new();
    loop {
        let (status, connection) = ask(&server, &home).await;
        if status == 503 {
            break;
        }
        silent.push(connection);
        assert!(silent.len() < 100, "exports at once are not bounded");
    }
    let refused = server.get(&format!("{home}/export")).await;
    assert!(refused.header("retry-after").parse::<u64>().unwrap() >= 1);
    refused.problem(503, "too-many-exports");
    server.get(&home).await.ok(200);

    // The same number finds a place at once: none of the first still has one.
    until("all places are free again", async || {
        let asked = futures::future::join_all(silent.iter().map(|_| ask(&server, &home))).await;
        asked.iter().all(|(status, _)| *status == 200)
    })
    .await;
    let whole = eventually("clients that hang up free their places", || async {
        let answer = server.get(&format!("{home}/export")).await;
        (answer.status == 200).then_some(answer.bytes)
    })
    .await;
    zip::ZipArchive::new(Cursor::new(&whole)).unwrap();
    for mut connection in silent {
        let mut rest = Vec::new();
        // A reset is an end too.
        let ended = connection.read_to_end(&mut rest).await;
        assert!(ended.is_ok() || ended.is_err_and(|error| error.kind() == ErrorKind::ConnectionReset));
        assert!(rest.len() < whole.len() / 2, "{} bytes of {}", rest.len(), whole.len());
    }
    server.post(&format!("{job}/cancel"), "").await.ok(200);
    let end = events.chunk().await.unwrap().expect("silent listeners are not cut off");
    assert!(end.starts_with(b"event: end"), "{end:?}");
}

#[tokio::test]
async fn a_client_that_reads_slowly_gets_all() {
    let server = server(LIMIT).await;
    let (home, _) = home_with_recording(&server).await;
    let (status, mut connection) = ask(&server, &home).await;
    assert_eq!(status, 200);
    let begun = tokio::time::Instant::now();
    let (mut answer, mut part) = (Vec::new(), vec![0; 128 << 10]);
    loop {
        let read = connection.read(&mut part).await.unwrap();
        if read == 0 {
            break;
        }
        answer.extend_from_slice(&part[..read]);
        // 1 MB/s: the whole export takes several times the limit.
        tokio::time::sleep_until(begun + Duration::from_micros(answer.len() as u64)).await;
    }
    assert!(begun.elapsed() > 2 * LIMIT, "{:?}", begun.elapsed());
    assert!(answer.len() > RECORDING_BYTES && answer.ends_with(b"\r\n0\r\n\r\n"), "{}", answer.len());
}

/// Returns the body of an answer that came in chunks (RFC 9112, section 7.1), from anywhere in its head on.
fn body_of(answer: &[u8]) -> Vec<u8> {
    let head = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let (mut rest, mut body) = (&answer[head + 4..], Vec::new());
    loop {
        let digits = rest.windows(2).position(|two| two == b"\r\n").unwrap();
        let size = std::str::from_utf8(&rest[..digits]).unwrap();
        let (begin, size) = (digits + 2, usize::from_str_radix(size, 16).unwrap());
        if size == 0 {
            return body;
        }
        body.extend_from_slice(&rest[begin..begin + size]);
        rest = &rest[begin + size + 2..];
    }
}

/// An export once had the state in which a clip was when the export began, and the files of a later one, or none.
#[tokio::test]
async fn a_clip_is_exported_as_it_is_when_its_turn_comes() {
    let server = Server::without_workers().await;
    let (home, _) = home_with_recording(&server).await;
    let later = [server.film(&home, 3).await, server.film(&home, 4).await];
    let (status, mut connection) = ask(&server, &home).await;
    assert_eq!(status, 200);
    // The first recording is on its way, and does not come further until it is read.
    let (mut answer, mut part): (Vec<u8>, Vec<u8>) = (Vec::new(), vec![0; 4 << 10]);
    while !answer.windows(10).any(|name| name == b"/recording") {
        let read = connection.read(&mut part).await.unwrap();
        assert!(read > 0, "{}", String::from_utf8_lossy(&answer));
        answer.extend_from_slice(&part[..read]);
    }
    server.delete(&later[0]).await.ok(204);
    server.send_json(Method::PATCH, &later[1], &json!({"title": "Kitchen"})).await.ok(200);
    connection.read_to_end(&mut answer).await.unwrap();

    let mut zip = zip::ZipArchive::new(Cursor::new(body_of(&answer))).unwrap();
    let [removed, titled] = later.each_ref().map(|clip| id_of(clip));
    assert!(!zip.file_names().any(|name| name.unwrap().contains(removed)), "it was removed");
    let clip = zip.by_name(&format!("clips/{titled}/clip.json")).unwrap();
    let clip: Value = serde_json::from_reader(clip).unwrap();
    assert_eq!(clip["title"], "Kitchen");
}

#[test]
fn everything_works_with_one_blocking_thread() {
    let runtime = tokio::runtime::Builder::new_multi_thread();
    let runtime = { runtime }.worker_threads(2).max_blocking_threads(1).enable_all().build().unwrap();
    let flow = async {
        let server = Server::start().await;
        let home = server.make_room("h").await;
        let clip = server.film(&home, 24).await;
        assert_eq!(server.settled(&clip).await["state"], "aligned");
        until("the map is merged", async || server.get(&format!("{home}/map")).await.status == 200).await;
        let path = format!("{home}/export");
        let exports = (0..8).map(|_| server.get(&path));
        for export in futures::future::join_all(exports).await {
            assert_eq!(export.status, 200);
            let zip = zip::ZipArchive::new(Cursor::new(export.bytes)).unwrap();
            assert!(zip.file_names().any(|name| name.unwrap().ends_with("/recording")));
        }
        let made = ["map/points?format=e57", "map/points?format=laz", "map/recording", "map/mesh"];
        let made = made.map(|path| format!("{home}/{path}"));
        for file in futures::future::join_all(made.iter().map(|path| server.get(path))).await {
            assert_eq!(file.status, 200);
        }
        let storage = server.administer().await;
        assert_eq!(storage.sweep(jiff::Timestamp::now(), SweepLimit::Leftovers).await.unwrap(), 0);
        storage.close().await;
        server.stop().await;
    };
    let ended = runtime.block_on(async { tokio::time::timeout(Duration::from_secs(60), flow).await });
    // Deadlocked threads must not block the shutdown.
    runtime.shutdown_background();
    ended.expect("work that waits for a second thread never ends");
}
