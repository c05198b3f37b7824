//! A database that does not answer: its host is gone, or the network loses all packets.

use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use viola_testing::eventually;
use viola_testing::postgres::Schema;
use viola_testing::process::{Process, viola};

/// Forwards bytes while the state is true; then it keeps them, and the connections stay open.
async fn forward(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, mut forwards: watch::Receiver<bool>) {
    let mut bytes = [0; 8192];
    while let Ok(read @ 1..) = from.read(&mut bytes).await {
        if forwards.wait_for(|forwards| *forwards).await.is_err()
            || to.write_all(&bytes[..read]).await.is_err()
        {
            return;
        }
    }
}

/// Starts a proxy to a target; returns its address and the state that it follows.
async fn proxy(target: String) -> (SocketAddr, watch::Sender<bool>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (state, follows) = watch::channel(true);
    tokio::spawn(async move {
        while let Ok((client, _)) = listener.accept().await {
            let Ok(server) = TcpStream::connect(&target).await else { continue };
            let ((from_client, to_client), (from_server, to_server)) =
                (client.into_split(), server.into_split());
            tokio::spawn(forward(from_client, to_server, follows.clone()));
            tokio::spawn(forward(from_server, to_client, follows.clone()));
        }
    });
    (address, state)
}

/// The test's thread waits for the process, so the proxy has threads of its own.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn readiness_is_told_while_the_database_hangs() {
    let Some(schema) = Schema::new().await else { return };
    let mut url: reqwest::Url = schema.url().parse().unwrap();
    let Some(host) = url.host_str().map(str::to_owned) else { return };
    let (address, state) = proxy(format!("{host}:{}", url.port().unwrap_or(5432))).await;
    url.set_host(Some("127.0.0.1")).unwrap();
    url.set_port(Some(address.port())).unwrap();
    let data = TempDir::new().unwrap();
    let server = Process::serve_with(data.path(), &[("VIOLA_DATABASE_URL", url.as_str())]);
    let ready = async || server.client.get("/readyz").await;
    ready().await.ok(200);
    state.send(false).unwrap();
    for _ in 0..2 {
        let begun = Instant::now();
        let answer = ready().await;
        let took = begun.elapsed();
        assert_eq!(answer.problem(503, "not-ready")["field"], "database");
        assert!(took < Duration::from_secs(3), "{took:?}");
    }
    state.send(true).unwrap();
    eventually("the database answers again", || async { (ready().await.status == 200).then_some(()) }).await;
    assert!(server.stop("TERM").success());
    schema.remove().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_start_that_waits_for_the_database_can_be_stopped() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("postgres://viola@{}/viola", listener.local_addr().unwrap());
    let data = TempDir::new().unwrap();
    let mut command = viola();
    command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(data.path());
    command.env("VIOLA_DATABASE_URL", url).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    // It is accepted, and nothing answers.
    let connection = listener.accept().await.unwrap();
    assert!(Command::new("kill").args(["-s", "TERM", &child.id().to_string()]).status().unwrap().success());
    // Without the signal it ends with an error, as for a database that is not there.
    assert!(child.wait().unwrap().success());
    drop(connection);
}
