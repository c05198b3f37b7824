//! Attacks other than those by files (`hostile`) and on other tenants (`access`).

use crate::server::{Server, Store};
use reqwest::Method;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use viola::api::ConnectionParams;
use viola_storage::Role;

pub fn connect(server: &Server) -> TcpStream {
    TcpStream::connect(server.base.strip_prefix("http://").unwrap()).unwrap()
}

/// Returns the bytes received until the server closes the connection.
pub async fn until_closed(mut connection: TcpStream) -> String {
    connection.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let read = tokio::task::spawn_blocking(move || {
        let mut answer = Vec::new();
        // A reset is an end too.
        let _ = connection.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    });
    read.await.unwrap()
}

#[tokio::test]
async fn who_trickles_a_request_is_hung_up_on() {
    let head = Duration::from_millis(200);
    let server =
        Server::with(|params| params.connections = ConnectionParams { head, ..ConnectionParams::default() })
            .await;
    let begun = Instant::now();
    let mut slow: Vec<TcpStream> = (0..50).map(|_| connect(&server)).collect();
    for connection in &mut slow {
        connection.write_all(b"GET /v1/homes HTTP/1.1\r\nhost: localhost\r\nx-slow: ").unwrap();
    }
    // Others are served meanwhile.
    server.lives().await;
    for connection in slow {
        until_closed(connection).await;
    }
    assert!(begun.elapsed() >= head);
}

#[tokio::test]
async fn heads_are_bounded() {
    let server = Server::start().await;
    let bomb =
        format!("GET /healthz HTTP/1.1\r\nhost: localhost\r\nx-large: {}\r\n\r\n", "a".repeat(200 << 10));
    let many: String = (0..500).map(|n| format!("x-{n}: a\r\n")).collect();
    let many = format!("GET /healthz HTTP/1.1\r\nhost: localhost\r\n{many}\r\n");
    for attack in [bomb, many] {
        let mut connection = connect(&server);
        // The server may close the connection before all of it is sent.
        let _ = connection.write_all(attack.as_bytes());
        let answer = until_closed(connection).await;
        assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 431"), "{answer}");
    }
    server.lives().await;
}

#[tokio::test]
async fn a_request_names_one_host() {
    let server = Server::start().await;
    for hosts in ["", "host: localhost\r\nhost: localhost\r\n"] {
        let mut connection = connect(&server);
        let request = format!("GET /healthz HTTP/1.1\r\n{hosts}connection: close\r\n\r\n");
        connection.write_all(request.as_bytes()).unwrap();
        let answer = until_closed(connection).await;
        assert!(answer.starts_with("HTTP/1.1 400 ") && answer.contains("\"Host\""), "{answer}");
    }
}

#[tokio::test]
async fn json_bombs_are_refused() {
    let server = Server::start().await;
    let deep = "[".repeat(60_000);
    let deep_object = "{\"name\":".repeat(6_000);
    let wide = format!("{{\"name\": \"x\", {}\"y\": 1}}", "\"name\": \"x\", ".repeat(4_000));
    let large = format!("{{\"name\": \"{}\"}}", "x".repeat(100 << 10));
    for (body, status) in [(deep, 422), (deep_object, 400), (wide, 400), (large, 413)] {
        let request = server.request(Method::PUT, "/v1/homes/h").header("content-type", "application/json");
        let answer = server.send(request.body(body)).await;
        assert_eq!(answer.status, status, "{}", String::from_utf8_lossy(&answer.bytes));
    }
    server.lives().await;
}

#[tokio::test]
async fn tricks_in_paths_and_names_lead_nowhere() {
    let server = Server::start().await;
    server.make_home("h").await;
    let tricks = [
        "/v1/homes/..%2f..%2fetc%2fpasswd",
        "/v1/homes/%2e%2e",
        "/v1/homes/h%00",
        "/v1/homes/h%0a",
        "/v1/homes/acme%2fh",
        "/v1/homes/h/clips/..%2f..%2f..%2fviola.sqlite",
        "/v1/homes/h/clips/%00/cloud.ply",
        "/assets/..%2f..%2fviola.sqlite",
        "/docs/..%2f..%2fviola.sqlite",
        "/v1/uploads/..%2fviola.sqlite",
        "/v1/homes/\u{202e}h",
        "/v1/homes/h%ff",
    ];
    for path in tricks {
        let answer = server.get(path).await;
        assert!([400, 404].contains(&answer.status), "{path}: {}", answer.status);
        assert!(!answer.bytes.starts_with(b"SQLite"), "{path}");
    }
    // A statement in a parameter is text.
    let cursors = [
        "/v1/homes?after=J2g",
        "/v1/objects?class='%3B%20DROP%20TABLE%20homes",
        "/v1/changes?after=JyBPUiAx",
    ];
    for path in cursors {
        server.get(path).await.problem(400, "invalid-query");
    }
    server.get("/v1/homes/h").await.ok(200);
}

#[tokio::test]
async fn ten_thousand_homes_are_listed_by_a_reader() {
    const HOMES: usize = 10_000;
    let server = Server::without_workers().await;
    let reader = server.client("acme", Role::Reader, None).await;
    let (numbers, name) = match Store::of_this_run() {
        Store::Embedded => (
            format!(
                "WITH RECURSIVE numbers(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < {HOMES}) "
            ),
            "printf('%05d', n)",
        ),
        _ => (format!("WITH numbers AS (SELECT generate_series(1, {HOMES}) AS n) "), "lpad(n::text, 5, '0')"),
    };
    let fill = "SELECT 'acme/home-' || NAME, 'acme', 0, 0 FROM numbers".replace("NAME", name);
    server.execute(&format!("{numbers} INSERT INTO homes (id, tenant, created_at, updated_at) {fill}")).await;
    let (mut seen, mut after, mut times) = (0, String::new(), Vec::new());
    loop {
        let begun = Instant::now();
        let page = reader.get(&format!("/v1/homes?limit=200{after}")).await.ok(200);
        times.push(begun.elapsed());
        seen += page["items"].as_array().unwrap().len();
        let Some(next) = page["next"].as_str() else { break };
        after = format!("&after={next}");
    }
    assert_eq!(seen, HOMES);
    // A page is read from an index, for any number of homes: under a second on the slowest machine. A scan would slow all.
    times.sort_unstable();
    assert!(times[times.len() / 2] < Duration::from_secs(1), "{times:?}");
    reader.get("/v1/homes?limit=10000").await.problem(400, "invalid-query");
}
