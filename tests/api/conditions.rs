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
    let home = server.make_room("h").await;
    let clip = server.film(&home, 2).await;
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
        let known = server.get_with(path, "if-none-match", &tag).await;
        assert_eq!((known.status, known.header("etag"), known.bytes.len()), (304, &*tag, 0), "{path}");
        let head = server.send(server.request(Method::HEAD, path)).await;
        assert_eq!((head.status, head.header("etag"), head.bytes.len()), (200, &*tag, 0), "HEAD {path}");
        assert_eq!(head.header("content-length"), first.bytes.len().to_string(), "HEAD {path}");
        let other = server.get_with(path, "if-none-match", "\"x\"").await;
        assert_eq!((other.status, other.bytes.len()), (200, first.bytes.len()), "{path}");
    }
    // The cursor of the feed names the hour, which may end between two requests.
    let mut statuses = Vec::new();
    for _ in 0..2 {
        let tag = server.get("/v1/changes").await.header("etag").to_owned();
        statuses.push(server.get_with("/v1/changes", "if-none-match", &tag).await.status);
    }
    assert!(statuses.contains(&304), "{statuses:?}");
    let before = server.get(&home).await.header("etag").to_owned();
    server.send_json(Method::PUT, &home, &json!({"name": "Elm"})).await.ok(200);
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

    let clip = server.film(&home, 2).await;
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

/// A client changes a resource twice without reading it in between.
#[tokio::test]
async fn the_answer_to_a_change_has_the_tag_of_the_next() {
    let server = Server::without_workers().await;
    let home = "/v1/homes/h";
    let named = |name: &str| json!({"name": name});
    let send = async |method: Method, path: &str, tag: Option<&str>, body: &serde_json::Value| {
        let mut request = server.request(method, path).json(body);
        if let Some(tag) = tag {
            request = request.header("if-match", tag);
        }
        server.send(request).await
    };
    // Returns the tag of an answer that is the one of GET.
    let tag = async |answer: &Answer, path: &str| {
        assert!((200..300).contains(&answer.status), "{path}: {answer:?}");
        let tag = answer.header("etag").to_owned();
        assert_eq!(server.get(path).await.header("etag"), tag, "{path}");
        tag
    };
    let made = tag(&send(Method::PUT, home, None, &named("Elm")).await, home).await;
    let renamed = tag(&send(Method::PUT, home, Some(&made), &named("Oak")).await, home).await;
    send(Method::PUT, home, Some(&made), &named("Ash")).await.problem(412, "changed-meanwhile");
    tag(&send(Method::PUT, home, Some(&renamed), &named("Oak")).await, home).await;

    let map = format!("{home}/lidar-map");
    let put = async |tag: Option<&str>, more: &str| {
        let mut request = server.request(Method::PUT, &map).body(format!("{}{more}", room::lidar_csv()));
        if let Some(tag) = tag {
            request = request.header("if-match", tag);
        }
        server.send(request).await
    };
    let first = tag(&put(None, "").await, &map).await;
    let second = tag(&put(Some(&first), "1,1\n").await, &map).await;
    put(Some(&first), "2,2\n").await.problem(412, "changed-meanwhile");
    assert_eq!(tag(&put(Some(&second), "1,1\n").await, &map).await, second);
    let restore = format!("{home}/lidar-maps/main/revisions/1/restore");
    let restored = tag(&send(Method::POST, &restore, Some(&second), &json!({})).await, &map).await;
    // The map has the file already, so the repetition of a request with a lost answer changes nothing.
    let again = send(Method::POST, &restore, Some(&second), &json!({})).await;
    assert_eq!((again.status, tag(&again, &map).await), (200, restored.clone()));
    tag(&put(Some(&restored), "3,3\n").await, &map).await;
    let dry = server.put(&format!("{map}?dry_run=true"), room::lidar_csv()).await;
    assert_eq!((dry.status, dry.header("etag")), (200, ""), "a report is no resource");

    let answer = server.post(&format!("{home}/clips"), small_clip()).await;
    let clip = answer.header("location").to_owned();
    let mut last = tag(&answer, &clip).await;
    let alignment = format!("{clip}/alignment");
    let pose = |x_m: f64| json!({"map_from_clip": {"x_m": x_m, "y_m": 1.0, "yaw_rad": 0.0}});
    for (method, path, body) in [
        (Method::PATCH, &clip, json!({"title": "Kitchen"})),
        (Method::PUT, &alignment, pose(1.0)),
        (Method::PUT, &alignment, pose(2.0)),
        (Method::DELETE, &alignment, json!({})),
        (Method::PATCH, &clip, json!({"recorded_at": "2026-03-14T15:09:26Z"})),
    ] {
        let changed = tag(&send(method.clone(), path, Some(&last), &body).await, &clip).await;
        assert_ne!(changed, last, "{method} {path}");
        last = changed;
    }
    let job = server.job_of(&clip).await;
    tag(&server.post(&format!("{job}/cancel"), "").await, &job).await;
    tag(&server.post(&format!("{clip}/align"), "").await, &clip).await;
}

#[tokio::test]
async fn a_condition_that_cannot_be_read_is_told_from_one_that_is_not_met() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let map = format!("{home}/lidar-map");
    server.put(&map, room::lidar_csv()).await.ok(201);
    let clip = server.film(&home, 2).await;
    let tag = server.get(&clip).await.header("etag").to_owned();
    let paths = [
        (Method::PUT, home.clone()),
        (Method::DELETE, home.clone()),
        (Method::PUT, map.clone()),
        (Method::PATCH, clip.clone()),
        (Method::DELETE, clip.clone()),
        (Method::DELETE, format!("{clip}/alignment")),
        (Method::GET, format!("{clip}/recording")),
    ];
    let unquoted = tag.trim_matches('"');
    for (method, path) in paths {
        for bad in ["", "x", unquoted, "\"x", "\"x\" \"y\"", "*, \"x\"", "'x'"] {
            let request = server.request(method.clone(), &path).header("if-match", bad);
            let problem = server.send(request).await.problem(400, "invalid-header");
            assert_eq!(problem["field"], "If-Match", "{method} {path} {bad}");
        }
    }
    let change = json!({"title": "Kitchen"});
    for (good, status) in [("\"x\"", 412), ("W/\"x\", \"y\"", 412), (&*format!("\"x\",{tag}"), 200)] {
        assert_eq!(
            with(&server, Method::PATCH, &clip, ("if-match", good), &change).await.status,
            status,
            "{good}"
        );
    }
}
