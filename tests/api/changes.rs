//! The changes feed, as the mirror of a fleet's operator reads it.

use crate::server::Server;
use base64::Engine;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use viola_testing::client::id_of;
use viola_testing::{eventually, room};

/// Returns home, kind, and revision, state or `deleted` of each item.
fn told(page: &Value) -> Vec<(String, String, Value)> {
    let items = page["items"].as_array().unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    items
        .iter()
        .map(|item| {
            let more = [&item["revision"], &item["state"]].into_iter().find(|value| !value.is_null());
            let more = if item["deleted"] == true { &json!("deleted") } else { more.unwrap_or(&Value::Null) };
            (text(&item["home"]), text(&item["kind"]), more.clone())
        })
        .collect()
}

fn row(home: &str, kind: &str, more: Value) -> (String, String, Value) {
    (home.to_owned(), kind.to_owned(), more)
}

/// Returns the data of all events of a home's stream, which must end.
async fn watched(response: reqwest::Response) -> Vec<Value> {
    assert_eq!(
        (response.status().as_u16(), &response.headers()["content-type"]),
        (200, &"text/event-stream".parse().unwrap())
    );
    // nginx would collect the events in a buffer.
    assert_eq!(response.headers()["x-accel-buffering"], "no");
    let text = response.text().await.unwrap();
    let data = text.lines().filter_map(|line| line.strip_prefix("data: "));
    data.map(|data| serde_json::from_str(data).unwrap()).collect()
}

#[tokio::test]
async fn a_home_is_watched_until_it_is_removed() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let events = format!("{home}/events");
    let first = server.watch(&events, None).await;
    server.make_home("other").await;
    server.film(&home, 2).await;
    // A client that comes back has missed the clip; one with a number that this feed never had is told everything.
    let back = server.watch(&events, Some("1")).await;
    let ahead = server.watch(&events, Some("1000000")).await;
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    server.delete(&home).await.ok(204);
    let feed = server.get("/v1/changes?limit=9").await.ok(200)["items"].clone();
    let last = feed.as_array().unwrap().iter().rfind(|item| item["home"] == "h").unwrap();
    assert_eq!((&last["kind"], &last["deleted"]), (&json!("home"), &json!(true)));
    for stream in [first, back, ahead] {
        let changes = watched(stream).await;
        assert!(changes.iter().all(|change| change["home"] == "h"), "{changes:?}");
        assert_eq!(changes.last(), Some(last));
        assert!(changes.iter().any(|change| change["kind"] == "lidar_map"), "{changes:?}");
        let numbers: Vec<_> = changes.iter().map(|change| change["seq"].as_i64()).collect();
        assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");
    }
}

/// A client that lost its stream before the first event once missed everything until it was back.
#[tokio::test]
async fn a_quiet_stream_resumes_where_it_began() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let events = format!("{home}/events");
    let mut quiet = server.watch(&events, None).await;
    let begin = quiet.chunk().await.unwrap().unwrap();
    let begin = std::str::from_utf8(&begin).unwrap();
    let id = begin.strip_prefix("id: ").and_then(|id| id.strip_suffix("\n\n"));
    let id = id.unwrap_or_else(|| panic!("{begin}"));
    drop(quiet);
    let clip = server.film(&home, 2).await;
    let mut back = server.watch(&events, Some(id)).await;
    let mut text = String::new();
    while !text.contains("\"kind\":\"clip\"") {
        text.push_str(std::str::from_utf8(&back.chunk().await.unwrap().unwrap()).unwrap());
    }
    assert!(text.contains(id_of(&clip)), "{text}");
}

#[tokio::test]
async fn a_mirror_follows_the_feed() {
    let server = Server::without_workers().await;
    let empty = server.get("/v1/changes").await.ok(200);
    assert_eq!((&empty["items"], &empty["more"]), (&json!([]), &json!(false)));
    let home = server.make_home("h").await;
    let clip = server.film(&home, 2).await;
    server.make_home("i").await;
    // Pages from the beginning, then again from the end.
    let first = server.get("/v1/changes?limit=2").await.ok(200);
    assert_eq!(told(&first), [row("h", "home", Value::Null), row("h", "clip", json!("uploaded"))]);
    assert_eq!((&first["more"], &first["items"][1]["clip"]), (&json!(true), &json!(id_of(&clip))));
    let after = |page: &Value| format!("/v1/changes?limit=2&after={}", page["next"].as_str().unwrap());
    let second = server.get(&after(&first)).await.ok(200);
    assert_eq!((told(&second), &second["more"]), (vec![row("i", "home", Value::Null)], &json!(false)));
    assert_eq!(server.get(&after(&second)).await.ok(200)["items"], json!([]));
    assert_eq!(told(&server.get(&after(&empty)).await.ok(200)), told(&first));

    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let third = server.get(&after(&second)).await.ok(200);
    assert_eq!(told(&third), [row("h", "clip", json!("queued")), row("h", "lidar_map", json!(1))]);
    server.delete(&home).await.ok(204);
    let last = server.get(&after(&third).replace("limit=2", "limit=9")).await.ok(200);
    let gone = ["clip", "lidar_map", "home"].map(|kind| row("h", kind, json!("deleted")));
    assert_eq!(told(&last), gone);
    let items =
        [&first, &second, &third, &last].into_iter().flat_map(|page| page["items"].as_array().unwrap());
    let numbers: Vec<i64> = items.map(|item| item["seq"].as_i64().unwrap()).collect();
    assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");
}

#[tokio::test]
async fn a_clip_and_the_map_it_becomes_are_told() {
    let server = Server::start().await;
    let home = server.make_room("h").await;
    server.film(&home, 24).await;
    let (map, page) = eventually("the map is told", || async {
        let page = server.get("/v1/changes").await.ok(200);
        told(&page).into_iter().find(|(_, kind, _)| kind == "map").map(|told| (told, page))
    })
    .await;
    assert_eq!(map, row("h", "map", json!(1)));
    assert!(told(&page).contains(&row("h", "clip", json!("aligned"))));
    let next = page["next"].as_str().unwrap().to_owned();

    // A request that waits at the end gets the next change at once.
    let waiting = tokio::spawn({
        let client = (*server).clone();
        async move { client.get(&format!("/v1/changes?after={next}&wait=30")).await.ok(200) }
    });
    server.make_home("later").await;
    assert_eq!(told(&waiting.await.unwrap()), [row("later", "home", Value::Null)]);
}

#[tokio::test]
async fn a_server_that_stops_does_not_wait_for_changes() {
    let server = Server::start().await;
    let waiting = tokio::spawn({
        let client = (*server).clone();
        async move { client.request(reqwest::Method::GET, "/v1/changes?wait=30").send().await }
    });
    server.lives().await;
    let begun = Instant::now();
    server.stop().await;
    assert!(begun.elapsed() < Duration::from_secs(8));
    // If the stop comes before the request, there is no answer at all.
    if let Ok(answer) = waiting.await.unwrap() {
        assert_eq!(answer.status(), 200);
    }
}

#[tokio::test]
async fn cursors_and_waits_that_are_refused() {
    let server = Server::start().await;
    let cursor = |text: &str| BASE64_URL_SAFE_NO_PAD.encode(text);
    let cases = [
        ("limit=0".to_owned(), "limit"),
        ("limit=201".to_owned(), "limit"),
        ("wait=31".to_owned(), "wait"),
        ("wait=-1".to_owned(), "wait"),
        ("wait=soon".to_owned(), "wait"),
        ("after=*".to_owned(), "after"),
        (format!("after={}", cursor("7")), "after"),
        (format!("after={}", cursor("-1.0")), "after"),
        (format!("after={}", cursor("0.99999999999999999999")), "after"),
    ];
    for (query, field) in cases {
        println!("{query}");
        let problem = server.get(&format!("/v1/changes?{query}")).await.problem(400, "invalid-query");
        assert_eq!(problem["field"], field);
    }
    // At the end of the feed in 1970.
    server.get(&format!("/v1/changes?after={}", cursor("0.0"))).await.problem(410, "cursor-expired");
}
