//! Entity tags of documents and files, and changes that depend on them.

use crate::clips::small_clip;
use crate::server::Server;
use reqwest::Method;
use serde_json::json;
use viola_testing::client::Answer;
use viola_testing::room;

/// Sends a request with a header and a JSON body.
async fn with(
    server: &Server,
    method: Method,
    path: &str,
    header: (&str, &str),
    body: &serde_json::Value,
) -> Answer {
    server.send(server.request(method, path).header(header.0, header.1).json(body)).await
}

#[tokio::test]
async fn every_document_has_a_tag_that_changes_with_it() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.post(&format!("{home}/clips"), small_clip()).await.ok(201);
    let clip = format!("{home}/clips/{}", clip["id"].as_str().unwrap());
    let paths = [
        "/v1/homes",
        "/v1/jobs",
        "/v1/webhooks",
        "/v1/classes",
        "/v1/objects",
        "/openapi.json",
        &home,
        &clip,
        &format!("{home}/clips"),
        &format!("{home}/lidar-map"),
        &format!("{home}/lidar-maps"),
        &format!("{home}/lidar-map/revisions"),
        &format!("{home}/lidar-map/image.png"),
        &format!("{home}/lidar-maps/main/revisions/1/file"),
        &format!("{home}/map/corrections"),
        &format!("{clip}/recording"),
    ];
    for path in paths {
        let first = server.get(path).await;
        assert_eq!(first.status, 200, "{path}");
        let (tag, caching) = (first.header("etag").to_owned(), first.header("cache-control"));
        assert!(tag.starts_with('"') && caching.starts_with("private, "), "{path}: {tag} {caching}");
        let known = server.send(server.request(Method::GET, path).header("if-none-match", &tag)).await;
        assert_eq!((known.status, known.header("etag"), known.bytes.len()), (304, &*tag, 0), "{path}");
        let head = server.send(server.request(Method::HEAD, path)).await;
        assert_eq!((head.status, head.header("etag"), head.bytes.len()), (200, &*tag, 0), "HEAD {path}");
        assert_eq!(head.header("content-length"), first.bytes.len().to_string(), "HEAD {path}");
        let other = server.send(server.request(Method::GET, path).header("if-none-match", "\"x\"")).await;
        assert_eq!((other.status, other.bytes.len()), (200, first.bytes.len()), "{path}");
    }
    // The cursor of the feed names the hour, which may end between two requests.
    let mut statuses = Vec::new();
    for _ in 0..2 {
        let tag = server.get("/v1/changes").await.header("etag").to_owned();
        let request = server.request(Method::GET, "/v1/changes").header("if-none-match", &tag);
        statuses.push(server.send(request).await.status);
    }
    assert!(statuses.contains(&304), "{statuses:?}");
    let before = server.get(&home).await.header("etag").to_owned();
    server.send(server.request(Method::PUT, &home).json(&json!({"name": "Elm"}))).await.ok(200);
    assert_ne!(server.get(&home).await.header("etag"), before);
}

#[tokio::test]
async fn a_change_of_an_old_state_is_refused() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let name = json!({"name": "Elm"});
    let new_only = with(&server, Method::PUT, &home, ("if-none-match", "*"), &name).await;
    let refused = new_only.problem(412, "changed-meanwhile");
    assert_eq!(refused["field"], "If-None-Match");
    assert!(refused["detail"].as_str().unwrap().contains("exists already"), "{refused}");
    with(&server, Method::PUT, "/v1/homes/i", ("if-none-match", "*"), &name).await.ok(201);
    let absent = with(&server, Method::PUT, "/v1/homes/j", ("if-match", "*"), &name).await;
    assert_eq!(absent.problem(412, "changed-meanwhile")["field"], "If-Match");
    let old = server.get(&home).await.header("etag").to_owned();
    with(&server, Method::PUT, &home, ("if-match", &old), &name).await.ok(200);
    // The answer was lost: the repetition changes nothing.
    with(&server, Method::PUT, &home, ("if-match", &old), &name).await.ok(200);
    with(&server, Method::PUT, &home, ("if-match", &old), &json!({})).await.problem(412, "changed-meanwhile");
    assert_eq!(server.get(&home).await.ok(200)["name"], "Elm");

    let map = format!("{home}/lidar-map");
    let put = |header: &'static str, tag: String, file: String| {
        server.send(server.request(Method::PUT, &map).header(header, tag).body(file))
    };
    let other = format!("{}1,1\n", room::lidar_csv());
    put("if-match", "*".into(), room::lidar_csv()).await.problem(412, "changed-meanwhile");
    put("if-none-match", "*".into(), room::lidar_csv()).await.ok(201);
    put("if-none-match", "*".into(), other.clone()).await.problem(412, "changed-meanwhile");
    let old = server.get(&map).await.header("etag").to_owned();
    put("if-match", old.clone(), other.clone()).await.ok(201);
    put("if-match", old.clone(), other.clone()).await.ok(200);
    put("if-none-match", "*".into(), other).await.problem(412, "changed-meanwhile");
    put("if-match", old, room::lidar_csv()).await.problem(412, "changed-meanwhile");
    assert_eq!(server.get(&map).await.ok(200)["revision"], 2);

    let clip = server.post(&format!("{home}/clips"), small_clip()).await.ok(201);
    let clip = format!("{home}/clips/{}", clip["id"].as_str().unwrap());
    let old = server.get(&clip).await.header("etag").to_owned();
    let title = json!({"title": "Kitchen"});
    // The tag of a compressed answer is weak.
    for tag in [format!("W/{old}"), old.clone()] {
        with(&server, Method::PATCH, &clip, ("if-match", &tag), &title).await.ok(200);
    }
    with(&server, Method::PATCH, &clip, ("if-match", &old), &json!({"title": null}))
        .await
        .problem(412, "changed-meanwhile");
    let pose = json!({"map_from_clip": {"x_m": 1, "y_m": 1, "yaw_rad": 0}});
    let alignment = format!("{clip}/alignment");
    with(&server, Method::PUT, &alignment, ("if-match", &old), &pose).await.problem(412, "changed-meanwhile");
    let new = server.get(&clip).await.header("etag").to_owned();
    for _ in 0..2 {
        with(&server, Method::PUT, &alignment, ("if-match", &new), &pose).await.ok(200);
    }
    with(&server, Method::DELETE, &alignment, ("if-match", &new), &json!({}))
        .await
        .problem(412, "changed-meanwhile");
    with(&server, Method::DELETE, &alignment, ("if-match", "*"), &json!({})).await.ok(200);
    with(&server, Method::DELETE, &alignment, ("if-match", &new), &json!({})).await.ok(200);
    for path in [&clip, &home] {
        let refused = with(&server, Method::DELETE, path, ("if-match", &old), &json!({})).await;
        assert_eq!(refused.problem(412, "changed-meanwhile")["field"], "If-Match", "{path}");
        let new = server.get(path).await.header("etag").to_owned();
        with(&server, Method::DELETE, path, ("if-match", &new), &json!({})).await.ok(204);
        assert_eq!(with(&server, Method::DELETE, path, ("if-match", &new), &json!({})).await.status, 404);
    }
}
