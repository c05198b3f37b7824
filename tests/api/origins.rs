//! A service without keys answers only to this machine's names and to its own pages.

use crate::server::Server;
use reqwest::{Method, RequestBuilder};
use viola_storage::Role;

async fn refused(server: &Server, request: RequestBuilder, code: &str) {
    server.send(request).await.problem(403, code);
}

#[tokio::test]
async fn another_sites_name_leads_nowhere() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let under = |path: &str| server.request(Method::GET, path).header("host", "evil.example");
    for path in ["/", "/v1/homes", "/v1/homes/h/events", "/openapi.json", "/metrics", "/none"] {
        refused(&server, under(path), "foreign-host").await;
    }
    let sign_in = server.request(Method::PUT, "/v1/session").header("host", "evil.example");
    refused(&server, sign_in, "foreign-host").await;
    let port = server.base.rsplit(':').next().unwrap();
    for host in [format!("localhost:{port}"), format!("127.0.0.1:{port}"), format!("[::1]:{port}")] {
        server.get_with("/v1/homes", "host", &host).await.ok(200);
    }
}

#[tokio::test]
async fn another_sites_page_can_do_nothing() {
    let server =
        Server::with(|params| params.cors_origins = vec!["https://app.example".parse().unwrap()]).await;
    let from =
        |method: Method, path: &str, origin: &str| server.request(method, path).header("origin", origin);
    let homes = "/v1/homes/h";
    for origin in ["https://evil.example", "null", "http://localhost:3000"] {
        refused(&server, from(Method::PUT, homes, origin), "foreign-origin").await;
        // As a form would be sent, which needs no preflight.
        let form =
            from(Method::POST, "/v1/homes/h/clips", origin).header("content-type", "text/plain").body("x");
        refused(&server, form, "foreign-origin").await;
        refused(&server, from(Method::GET, "/v1/changes", origin), "foreign-origin").await;
        // An event stream.
        let events = from(Method::GET, "/v1/homes/h/events", origin).header("accept", "text/event-stream");
        refused(&server, events, "foreign-origin").await;
    }
    server.get(homes).await.problem(404, "home-not-found");
    let own = server.base.clone();
    for origin in [own.as_str(), "https://app.example"] {
        let answer = server.send(from(Method::PUT, homes, origin)).await;
        assert!([200, 201].contains(&answer.status), "{origin}");
    }
    // With keys, who has one may call from anywhere.
    let admin = server.client("default", Role::Admin, None).await;
    let request = admin.request(Method::GET, homes).header("origin", "https://evil.example");
    admin.send(request.header("host", "viola.example")).await.ok(200);
}
