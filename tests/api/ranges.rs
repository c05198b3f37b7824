//! Range requests: parts of files, as RFC 9110, section 14, has them.

use crate::server::Server;
use reqwest::Method;
use viola_testing::room;

/// Requests a file with headers; returns status, `Content-Range` and body.
async fn ask(server: &Server, path: &str, headers: &[(&str, &str)]) -> (u16, Option<String>, Vec<u8>) {
    let mut request = server.request(Method::GET, path);
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    let answer = request.send().await.unwrap();
    let range = answer.headers().get("content-range").map(|range| range.to_str().unwrap().to_owned());
    (answer.status().as_u16(), range, answer.bytes().await.unwrap().to_vec())
}

#[tokio::test]
async fn a_part_of_a_file_is_served() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.post(&format!("{home}/clips"), crate::clips::small_clip()).await;
    let clip = clip.header("location").to_owned();
    server.settled(&clip).await;
    let path = format!("{clip}/thumbnail.jpg");
    let whole = server.request(Method::GET, &path).send().await.unwrap();
    assert_eq!(whole.status(), 200);
    assert_eq!(whole.headers()["accept-ranges"], "bytes");
    let tag = whole.headers()["etag"].to_str().unwrap().to_owned();
    let whole = whole.bytes().await.unwrap().to_vec();
    let (length, stale) = (whole.len(), "\"another\"");
    let last = length - 1;
    for (headers, status, range, body) in [
        (vec![("range", "bytes=10-19")], 206, Some(format!("bytes 10-19/{length}")), &whole[10..20]),
        (vec![("range", "bytes=10-")], 206, Some(format!("bytes 10-{last}/{length}")), &whole[10..]),
        (vec![("range", "bytes=-1")], 206, Some(format!("bytes {last}-{last}/{length}")), &whole[last..]),
        (
            vec![("range", "bytes=0-0"), ("if-range", tag.as_str())],
            206,
            Some(format!("bytes 0-0/{length}")),
            &whole[..1],
        ),
        // The file has changed since, several parts, and no range.
        (vec![("range", "bytes=0-0"), ("if-range", stale)], 200, None, &whole[..]),
        (vec![("range", "bytes=0-0,5-6")], 200, None, &whole[..]),
        (vec![("range", "pages=1")], 200, None, &whole[..]),
        (vec![("range", "bytes=0-0"), ("if-none-match", tag.as_str())], 304, None, &[][..]),
    ] {
        assert_eq!(ask(&server, &path, &headers).await, (status, range, body.to_vec()), "{headers:?}");
    }
    let behind = format!("bytes={length}-");
    let (status, range, body) = ask(&server, &path, &[("range", &behind)]).await;
    assert_eq!((status, range), (416, Some(format!("bytes */{length}"))));
    let problem: serde_json::Value = serde_json::from_slice(&body).unwrap();
    assert_eq!(problem["type"], "urn:viola:problem:range-not-satisfiable");
}

/// The document lists ranges of files only, and a part of a JSON document is no document.
#[tokio::test]
async fn json_comes_whole_and_with_conditions() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let whole = server.get(&home).await;
    assert_eq!((whole.status, whole.header("accept-ranges")), (200, ""));
    for range in ["bytes=0-0", "bytes=100000-"] {
        assert_eq!(
            ask(&server, &home, &[("range", range)]).await,
            (200, None, whole.bytes.clone()),
            "{range}"
        );
    }
    let tag = whole.header("etag");
    for (header, value, status) in
        [("if-none-match", tag, 304), ("if-match", tag, 200), ("if-match", "\"another\"", 412)]
    {
        assert_eq!(ask(&server, &home, &[(header, value)]).await.0, status, "{header}: {value}");
    }
}
