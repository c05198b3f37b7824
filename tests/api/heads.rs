//! HEAD has the headers of GET, and no others (RFC 9110, section 9.3.2).

use crate::document::{document, operations};
use crate::map::home_of_one_clip;
use crate::server::Server;
use reqwest::Method;
use viola_testing::client::id_of;

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
    let (server, home, clip, _) = home_of_one_clip().await;
    let job = server.job_of(&clip).await;
    let rooms = server.get(&format!("{home}/map/rooms")).await.ok(200);
    let objects = server.get(&format!("{home}/map/objects")).await.ok(200);
    let values = [
        ("{home}", "h"),
        ("{clip}", id_of(&clip)),
        ("{job}", id_of(&job)),
        ("{level}", "main"),
        ("{revision}", "1"),
        ("{room}", rooms["rooms"][0]["id"].as_str().unwrap_or("1")),
        ("{object}", objects["objects"][0]["id"].as_str().unwrap_or("1")),
        ("{webhook}", ID),
        ("{delivery}", ID),
    ];
    let (mut routes, mut streams) = (0, 0);
    for (method, path, _) in operations(&document()) {
        // HEAD of an upload is an operation of tus.
        if method != "get" || path.starts_with("/v1/uploads") {
            continue;
        }
        // Metrics and free disk space differ from request to request.
        if ["/metrics", "/readyz"].contains(&path) {
            continue;
        }
        let path = values.iter().fold(path.to_owned(), |path, (name, value)| path.replace(name, value));
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
        &format!("clips/{}/cloud.ply", id_of(&clip)),
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
