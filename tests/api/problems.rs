//! Refusals that need no file: every one is a problem document with a stable type.

use crate::server::Server;
use reqwest::Method;
use serde_json::json;

const ID: &str = "01a1f766-7a97-7747-9dbb-391e0eeccb64";

#[tokio::test]
async fn bad_requests_are_told_apart() {
    let server = Server::start().await;
    server.make_home("h").await;
    let long = "x".repeat(65);
    let job = format!("/v1/jobs/{ID}");
    let cases = [
        (Method::GET, "/nothing/here".to_owned(), 404, "route-not-found", None),
        (Method::GET, "/v1/homes/".to_owned(), 404, "route-not-found", None),
        (Method::POST, "/healthz".to_owned(), 405, "method-not-allowed", None),
        (Method::PATCH, "/v1/homes/h".to_owned(), 405, "method-not-allowed", None),
        (Method::PUT, format!("/v1/homes/{long}"), 400, "invalid-path", Some("home")),
        (Method::PUT, "/v1/homes/a%20b".to_owned(), 400, "invalid-path", Some("home")),
        (Method::PUT, "/v1/homes/a%2Fb".to_owned(), 400, "invalid-path", Some("home")),
        (Method::PUT, "/v1/homes/%2e%2e%2fetc".to_owned(), 400, "invalid-path", Some("home")),
        (Method::PUT, "/v1/homes/a%00".to_owned(), 400, "invalid-path", Some("home")),
        (Method::PUT, "/v1/homes/%ff".to_owned(), 400, "invalid-path", Some("home")),
        (Method::GET, "/v1/homes/h/clips/7".to_owned(), 400, "invalid-path", Some("clip")),
        (Method::GET, "/v1/jobs/seven".to_owned(), 400, "invalid-path", Some("job")),
        // PostgreSQL fails on a text with a NUL.
        (Method::GET, "/v1/homes/h/map/objects/sofa-1%00".to_owned(), 400, "invalid-path", Some("object")),
        (Method::PATCH, "/v1/homes/h/map/rooms/%00".to_owned(), 400, "invalid-path", Some("room")),
        (
            Method::GET,
            "/v1/objects?after=L3YxL29iamVjdHMgaCBhAA".to_owned(),
            400,
            "invalid-query",
            Some("after"),
        ),
        (Method::GET, format!("/v1/homes/h/clips/{ID}"), 404, "clip-not-found", None),
        (Method::GET, format!("/v1/homes/none/clips/{ID}"), 404, "home-not-found", None),
        (Method::POST, "/v1/homes/none/clips".to_owned(), 404, "home-not-found", None),
        (Method::GET, job.clone(), 404, "job-not-found", None),
        (Method::GET, format!("{job}/events"), 404, "job-not-found", None),
        (Method::POST, format!("{job}/cancel"), 404, "job-not-found", None),
        (Method::GET, "/v1/homes/none/events".to_owned(), 404, "home-not-found", None),
        (Method::POST, "/v1/homes/h/clips?title=%20".to_owned(), 400, "invalid-query", Some("title")),
        (Method::POST, "/v1/homes/h/clips?filename=%0A".to_owned(), 400, "invalid-query", Some("filename")),
        (
            Method::PUT,
            "/v1/homes/h/lidar-map?filename=%C2%A0".to_owned(),
            400,
            "invalid-query",
            Some("filename"),
        ),
        (Method::GET, "/v1/homes?limit=0".to_owned(), 400, "invalid-query", Some("limit")),
        (Method::GET, "/v1/homes?limit=201".to_owned(), 400, "invalid-query", Some("limit")),
        (Method::GET, "/v1/homes?limit=-1".to_owned(), 400, "invalid-query", Some("limit")),
        (Method::GET, "/v1/homes?limit=ten".to_owned(), 400, "invalid-query", Some("limit")),
        (Method::GET, "/v1/homes?limit=1&limit=2".to_owned(), 400, "invalid-query", Some("limit")),
        (Method::GET, "/v1/homes?after=*".to_owned(), 400, "invalid-query", Some("after")),
        (Method::GET, "/v1/homes?after=Li4".to_owned(), 400, "invalid-query", Some("after")),
        (Method::GET, "/v1/homes/h/clips?after=Li4".to_owned(), 400, "invalid-query", Some("after")),
        (Method::GET, "/v1/homes?updated_after=now".to_owned(), 400, "invalid-query", Some("updated_after")),
        (Method::GET, "/v1/homes?updated_after=".to_owned(), 400, "invalid-query", Some("updated_after")),
        (
            Method::GET,
            "/v1/homes/h/clips?updated_after=7".to_owned(),
            400,
            "invalid-query",
            Some("updated_after"),
        ),
        (Method::GET, "/v1/homes/h/clips?state=".to_owned(), 400, "invalid-query", Some("state")),
        (Method::GET, "/v1/homes/h/clips?state=done".to_owned(), 400, "invalid-query", Some("state")),
        (Method::GET, "/v1/homes/h/clips?state=failed,".to_owned(), 400, "invalid-query", Some("state")),
        (Method::GET, "/v1/homes/h/clips?state=Failed".to_owned(), 400, "invalid-query", Some("state")),
        (
            Method::GET,
            "/v1/homes/h/clips?state=failed&state=queued".to_owned(),
            400,
            "invalid-query",
            Some("state"),
        ),
        (Method::GET, "/v1/homes/none/clips?state=failed".to_owned(), 404, "home-not-found", None),
        (
            Method::GET,
            "/v1/homes/h/lidar-map/revisions?after=Li4".to_owned(),
            400,
            "invalid-query",
            Some("after"),
        ),
    ];
    for (method, path, status, code, field) in cases {
        println!("{method} {path}");
        let problem = server.send(server.request(method, &path)).await.problem(status, code);
        assert_eq!(problem["field"].as_str(), field, "{path}");
    }
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
    let missing = server.send(server.request(Method::PUT, "/v1/session").json(&json!({}))).await;
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
