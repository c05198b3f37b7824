//! HEAD has the headers of GET, and no others (RFC 9110, section 9.3.2).

use crate::map::merged;
use crate::server::Server;
use reqwest::Method;
use viola_testing::{room, zips};

const ID: &str = "01a1f766-7a97-7747-9dbb-391e0eeccb64";

/// Headers that describe the body.
const NAMES: [&str; 5] = ["content-type", "content-length", "content-encoding", "accept-ranges", "etag"];

/// Ends of paths whose files are made for a request. HEAD does not make them, and does not tell their lengths.
const MADE: [&str; 3] = ["/map/mesh", "/map/recording", "/cloud.ply"];

/// Returns the status of an answer and the headers that describe its body, which is not read.
async fn head_of(
    server: &Server,
    method: Method,
    path: &str,
    coding: Option<&str>,
) -> (u16, [Option<String>; 5]) {
    let mut request = server.request(method, path);
    if let Some(coding) = coding {
        request = request.header("accept-encoding", coding);
    }
    let answer = request.send().await.unwrap();
    let header = |name: &str| answer.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
    (answer.status().as_u16(), NAMES.map(header))
}

#[tokio::test]
async fn every_route_answers_head_with_the_headers_of_get() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.post(&format!("{home}/clips"), zips::zip(&room::clip(24))).await.ok(201);
    merged(&server, &home, &[&clip["id"]]).await;
    let id = |value: &serde_json::Value| value.as_str().unwrap_or("1").to_owned();
    let rooms = server.get(&format!("{home}/map/rooms")).await.ok(200);
    let objects = server.get(&format!("{home}/map/objects")).await.ok(200);
    let values = [
        ("{home}", "h".to_owned()),
        ("{clip}", id(&clip["id"])),
        ("{job}", id(&clip["job"]["id"])),
        ("{level}", "main".to_owned()),
        ("{revision}", "1".to_owned()),
        ("{room}", id(&rooms["rooms"][0]["id"])),
        ("{object}", id(&objects["objects"][0]["id"])),
        ("{webhook}", ID.to_owned()),
        ("{delivery}", ID.to_owned()),
    ];
    let document: serde_json::Value = serde_json::from_str(&viola::api::document_json()).unwrap();
    let (mut routes, mut streams) = (0, 0);
    for (path, methods) in document["paths"].as_object().unwrap() {
        // HEAD of an upload is an operation of tus.
        if !methods["get"].is_object() || path.starts_with("/v1/uploads") {
            continue;
        }
        // Metrics and free disk space differ from request to request.
        if ["/metrics", "/readyz"].contains(&path.as_str()) {
            continue;
        }
        let path = values.iter().fold(path.clone(), |path, (name, value)| path.replace(name, value));
        for coding in [None, Some("gzip")] {
            // The answer may change between two requests.
            let mut before = head_of(&server, Method::GET, &path, coding).await;
            let head = head_of(&server, Method::HEAD, &path, coding).await;
            let mut after = head_of(&server, Method::GET, &path, coding).await;
            if MADE.iter().any(|made| path.ends_with(made)) && head.1[1].is_none() {
                (before.1[1], after.1[1]) = (None, None);
            }
            assert!(
                head == before || head == after,
                "{path} {coding:?}: {NAMES:?}\n{head:?}\n{before:?}\n{after:?}"
            );
            streams += usize::from(head.0 == 200 && coding.is_none() && head.1[1].is_none());
        }
        routes += 1;
    }
    assert!(routes > 40, "{routes}");
    for made in [
        "map/points?format=e57",
        "map/points?format=laz",
        "map/recording",
        "map/mesh?triangles=1000",
        &format!("clips/{}/cloud.ply", id(&clip["id"])),
    ] {
        let path = format!("{home}/{made}");
        let mut got = head_of(&server, Method::GET, &path, None).await;
        assert!(got.0 == 200 && got.1[1].take().is_some(), "{made}");
        assert_eq!(head_of(&server, Method::HEAD, &path, None).await, got, "{made} is not made for HEAD");
    }
    // The export, and the events of the home and of the job.
    assert!(streams >= 3, "{streams} answers of unknown length");
    let export = head_of(&server, Method::HEAD, &format!("{home}/export"), None).await;
    assert_eq!((export.0, export.1[1].as_deref()), (200, None));
}
