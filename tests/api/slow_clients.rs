//! Clients that hold connections without using them: they are cut off, and others are served meanwhile.

use crate::attacks::{connect, until_closed};
use crate::server::Server;
use futures::stream::FuturesUnordered;
use futures::{FutureExt, StreamExt, stream};
use reqwest::{Body, Method};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;
use tokio::io::AsyncReadExt;
use viola::api::ConnectionParams;
use viola_testing::until;

/// A request whose body never comes, without a key.
const STALLED: &[u8] = b"PUT /v1/session HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\n\
    content-length: 100\r\n\r\n{";

fn stalled(server: &Server) -> TcpStream {
    let mut connection = connect(server);
    connection.write_all(STALLED).unwrap();
    connection
}

/// Waits for the first bytes of an answer; none if the connection is reset.
async fn end(connection: TcpStream) -> Option<usize> {
    connection.set_nonblocking(true).unwrap();
    let mut connection = tokio::net::TcpStream::from_std(connection).unwrap();
    connection.read(&mut [0; 100]).await.ok()
}

#[tokio::test]
async fn a_json_body_that_stalls_is_refused() {
    let server = Server::with(|params| params.bodies.json = Duration::from_millis(100)).await;
    let connections: Vec<TcpStream> = (0..50).map(|_| stalled(&server)).collect();
    server.lives().await;
    for connection in connections {
        let answer = until_closed(connection).await;
        assert!(answer.starts_with("HTTP/1.1 408 ") && answer.contains("body-stalled"), "{answer}");
    }
}

#[tokio::test]
async fn a_file_that_drips_is_refused() {
    let server = Server::with(|params| params.bodies.window = Duration::from_millis(300)).await;
    let home = server.make_home("h").await;
    // Never silent for long, and far too slow.
    let drip = stream::unfold(tokio::time::interval(Duration::from_millis(10)), |mut clock| async {
        clock.tick().await;
        Some((Ok::<_, std::io::Error>(vec![b'x']), clock))
    });
    let request = server.request(Method::POST, &format!("{home}/clips")).body(Body::wrap_stream(drip));
    server.send(request).await.problem(408, "body-stalled");
    until("what came is removed", async || server.blobs().is_empty()).await;
}

#[tokio::test]
async fn an_address_with_too_many_connections_displaces_its_own() {
    let most_of_network = 8;
    let server = Server::with(|params| {
        params.connections = ConnectionParams { most_of_network, ..ConnectionParams::default() };
    })
    .await;
    let neighbour = reqwest::Client::builder().no_proxy().local_address("127.0.0.2".parse().ok());
    let neighbour = neighbour.build().unwrap();
    let health = format!("{}/healthz", server.base);
    assert_eq!(neighbour.get(&health).send().await.unwrap().status(), 200);
    let held: Vec<TcpStream> = (0..3 * most_of_network).map(|_| stalled(&server)).collect();
    // A newcomer is served, and has the place of one of them.
    server.lives().await;
    let displaced = held.len() + 1 - most_of_network;
    let mut ends: FuturesUnordered<_> = held.into_iter().map(end).collect();
    for _ in 0..displaced {
        assert!(ends.next().await.unwrap().is_none_or(|bytes| bytes == 0), "it is closed without an answer");
    }
    assert!(ends.next().now_or_never().is_none(), "the others still wait");
    // The other address still has its idle connection.
    assert_eq!(neighbour.get(&health).send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn if_all_connections_are_taken_a_newcomer_is_still_served() {
    let most = 8;
    let server =
        Server::with(|params| params.connections = ConnectionParams { most, ..ConnectionParams::default() })
            .await;
    let held: Vec<TcpStream> = (0..100).map(|_| stalled(&server)).collect();
    server.lives().await;
    drop(held);
}

/// A client that sends its whole body before it reads once saw a broken connection in place of the refusal.
#[tokio::test]
async fn an_early_refusal_reaches_a_client_that_still_sends() {
    const BODY: usize = 32 << 20;
    let server = Server::without_workers().await;
    let connection = connect(&server);
    let sent = tokio::task::spawn_blocking(move || {
        let mut connection = connection;
        let head = format!(
            "POST /v1/homes/none/clips HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-length: {BODY}\r\n\r\n"
        );
        connection.write_all(head.as_bytes())?;
        connection.write_all(&vec![7; BODY])?;
        let mut answer = String::new();
        connection.read_to_string(&mut answer)?;
        Ok::<_, std::io::Error>(answer)
    });
    let answer = sent.await.unwrap().unwrap();
    assert!(answer.starts_with("HTTP/1.1 404 ") && answer.contains("home-not-found"), "{answer}");
}

/// A client that waits to be asked for its body sends none of it.
#[tokio::test]
async fn a_body_that_is_refused_is_not_asked_for() {
    let server = Server::without_workers().await;
    let mut connection = connect(&server);
    let head = b"POST /v1/homes/none/clips HTTP/1.1\r\nhost: localhost\r\ncontent-length: 100\r\nexpect: 100-continue\r\n\r\n";
    connection.write_all(head).unwrap();
    let answer = until_closed(connection).await;
    assert!(answer.starts_with("HTTP/1.1 404 "), "{answer}");
}
