//! Refusals that need no file: every one is a problem document with a stable type.

use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};

const ID: &str = "01a1f766-7a97-7747-9dbb-391e0eeccb64";

/// Checks that each of these requests is refused with a code and the name of the field.
async fn refused(server: &Server, code: &str, cases: &[(Method, &str, &str)]) {
    for (method, path, field) in cases {
        println!("{method} {path}");
        let problem = server.send(server.request(method.clone(), path)).await.problem(400, code);
        assert_eq!(problem["field"], *field, "{path}");
    }
}

#[tokio::test]
async fn bad_requests_are_told_apart() {
    let server = Server::start().await;
    server.make_home("h").await;
    let long = "x".repeat(65);
    let job = format!("/v1/jobs/{ID}");
    let cases: [(Method, &str, u16, &str); 12] = [
        (Method::GET, "/nothing/here", 404, "route-not-found"),
        (Method::GET, "/v1/homes/", 404, "route-not-found"),
        (Method::POST, "/healthz", 405, "method-not-allowed"),
        (Method::PATCH, "/v1/homes/h", 405, "method-not-allowed"),
        (Method::GET, &format!("/v1/homes/h/clips/{ID}"), 404, "clip-not-found"),
        (Method::GET, &format!("/v1/homes/none/clips/{ID}"), 404, "home-not-found"),
        (Method::POST, "/v1/homes/none/clips", 404, "home-not-found"),
        (Method::GET, &job, 404, "job-not-found"),
        (Method::GET, &format!("{job}/events"), 404, "job-not-found"),
        (Method::POST, &format!("{job}/cancel"), 404, "job-not-found"),
        (Method::GET, "/v1/homes/none/events", 404, "home-not-found"),
        (Method::GET, "/v1/homes/none/clips?state=failed", 404, "home-not-found"),
    ];
    for (method, path, status, code) in cases {
        println!("{method} {path}");
        let problem = server.send(server.request(method, path)).await.problem(status, code);
        assert_eq!(problem["field"], Value::Null, "{path}");
    }
    let paths: [(Method, &str, &str); 10] = [
        (Method::PUT, &format!("/v1/homes/{long}"), "home"),
        (Method::PUT, "/v1/homes/a%20b", "home"),
        (Method::PUT, "/v1/homes/a%2Fb", "home"),
        (Method::PUT, "/v1/homes/%2e%2e%2fetc", "home"),
        (Method::PUT, "/v1/homes/a%00", "home"),
        (Method::PUT, "/v1/homes/%ff", "home"),
        (Method::GET, "/v1/homes/h/clips/7", "clip"),
        (Method::GET, "/v1/jobs/seven", "job"),
        // PostgreSQL fails on a text with a NUL.
        (Method::GET, "/v1/homes/h/map/objects/sofa-1%00", "object"),
        (Method::PATCH, "/v1/homes/h/map/rooms/%00", "room"),
    ];
    refused(&server, "invalid-path", &paths).await;
    let queries: [(Method, &str, &str); 21] = [
        // The cursor has a NUL.
        (Method::GET, "/v1/objects?after=L3YxL29iamVjdHMgaCBhAA", "after"),
        (Method::POST, "/v1/homes/h/clips?title=%20", "title"),
        (Method::POST, "/v1/homes/h/clips?filename=%0A", "filename"),
        (Method::PUT, "/v1/homes/h/lidar-map?filename=%C2%A0", "filename"),
        (Method::GET, "/v1/homes?limit=0", "limit"),
        (Method::GET, "/v1/homes?limit=201", "limit"),
        (Method::GET, "/v1/homes?limit=-1", "limit"),
        (Method::GET, "/v1/homes?limit=ten", "limit"),
        (Method::GET, "/v1/homes?limit=1&limit=2", "limit"),
        (Method::GET, "/v1/homes?after=*", "after"),
        (Method::GET, "/v1/homes?after=Li4", "after"),
        (Method::GET, "/v1/homes/h/clips?after=Li4", "after"),
        (Method::GET, "/v1/homes?updated_after=now", "updated_after"),
        (Method::GET, "/v1/homes?updated_after=", "updated_after"),
        (Method::GET, "/v1/homes/h/clips?updated_after=7", "updated_after"),
        (Method::GET, "/v1/homes/h/clips?state=", "state"),
        (Method::GET, "/v1/homes/h/clips?state=done", "state"),
        (Method::GET, "/v1/homes/h/clips?state=failed,", "state"),
        (Method::GET, "/v1/homes/h/clips?state=Failed", "state"),
        (Method::GET, "/v1/homes/h/clips?state=failed&state=queued", "state"),
        (Method::GET, "/v1/homes/h/lidar-map/revisions?after=Li4", "after"),
    ];
    refused(&server, "invalid-query", &queries).await;
}

#[tokio::test]
async fn bad_json_is_told_apart() {
    let server = Server::start().await;
    let name = |name: &str| json!({"name": name}).to_string();
    let json_type = "application/json";
    let cases = [
        (json_type, "{".to_owned(), 400, "malformed-json", None),
        (json_type, "{} {}".to_owned(), 400, "malformed-json", None),
        (json_type, r#"{"name": "a", "name": "b"}"#.to_owned(), 400, "malformed-json", Some("name")),
        (json_type, r#"{"name": "a", "n\u0061me": "a"}"#.to_owned(), 400, "malformed-json", Some("name")),
        (json_type, r#"{"name": {"x": 1, "x": 2}}"#.to_owned(), 400, "malformed-json", Some("name.x")),
        (json_type, r#"{"name": 7}"#.to_owned(), 422, "invalid-body", Some("name")),
        (json_type, r#"{"nam": "x"}"#.to_owned(), 422, "invalid-body", Some("nam")),
        (json_type, "{\"name\":".repeat(5_000), 400, "malformed-json", None),
        (json_type, r#"["x"]"#.to_owned(), 422, "invalid-body", None),
        (json_type, "7".to_owned(), 422, "invalid-body", None),
        (json_type, name(""), 422, "invalid-body", Some("name")),
        (json_type, name(" \u{3000}"), 422, "invalid-body", Some("name")),
        (json_type, name("a\u{7}"), 422, "invalid-body", Some("name")),
        (json_type, name(&"n".repeat(201)), 422, "invalid-body", Some("name")),
        (json_type, name(&"n".repeat(100_000)), 413, "body-too-large", None),
        ("text/plain", "{}".to_owned(), 415, "unsupported-media-type", Some("Content-Type")),
        ("", name("x"), 415, "unsupported-media-type", Some("Content-Type")),
    ];
    for (media_type, body, status, code, field) in cases {
        let what = body.chars().take(20).collect::<String>();
        let request = server.request(Method::PUT, "/v1/homes/h");
        let request =
            if media_type.is_empty() { request } else { request.header("content-type", media_type) };
        let request = request.body(body);
        let problem = server.send(request).await.problem(status, code);
        assert_eq!(problem["field"].as_str(), field, "{what}: {problem}");
    }
    server.get("/v1/homes/h").await.problem(404, "home-not-found");
    let missing = server.send_json(Method::PUT, "/v1/session", &json!({})).await;
    assert_eq!(missing.problem(422, "invalid-body")["field"], "key");
    // A body of no bytes is absent.
    let empty = server.request(Method::PUT, "/v1/homes/h").header("content-type", json_type).body("");
    server.send(empty).await.ok(201);
}

#[tokio::test]
async fn a_request_id_comes_back_when_it_is_harmless() {
    let server = Server::start().await;
    let given =
        |id: &'static str| server.send(server.request(Method::GET, "/healthz").header("x-request-id", id));
    assert_eq!(given("abc-1.2_3").await.header("x-request-id"), "abc-1.2_3");
    for bad in ["a b", "{\"a\":1}", "", &*"x".repeat(129).leak()] {
        let answer = given(bad).await;
        let id = answer.header("x-request-id");
        assert!(id != bad && id.len() == 36, "{id}");
    }
}

#[tokio::test]
async fn the_service_says_how_it_is() {
    let server = Server::start().await;
    assert_eq!(server.get("/healthz").await.ok(200)["status"], "ok");
    assert_eq!(server.get("/readyz").await.ok(200)["status"], "ok");
    server.stop().await;
}
