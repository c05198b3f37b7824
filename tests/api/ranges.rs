//! Range requests: parts of files, as RFC 9110, section 14, has them.

use crate::server::Server;
use reqwest::Method;

/// Requests a file with headers; returns status, `Content-Range` and body.
async fn ask(server: &Server, path: &str, headers: &[(&str, &str)]) -> (u16, Option<String>, Vec<u8>) {
    let mut request = server.request(Method::GET, path);
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    let answer = server.send(request).await;
    let range = answer.headers.get("content-range").map(|range| range.to_str().unwrap().to_owned());
    (answer.status, range, answer.bytes)
}

#[tokio::test]
async fn a_part_of_a_file_is_served() {
    let server = Server::start().await;
    let home = server.make_room("h").await;
    let clip = server.film(&home, 2).await;
    server.settled(&clip).await;
    let path = format!("{clip}/thumbnail.jpg");
    let whole = server.get(&path).await;
    assert_eq!((whole.status, whole.header("accept-ranges")), (200, "bytes"));
    let (tag, whole) = (whole.header("etag").to_owned(), whole.bytes);
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
    let behind = server.get_with(&path, "range", &format!("bytes={length}-")).await;
    assert_eq!(behind.header("content-range"), format!("bytes */{length}"));
    behind.problem(416, "range-not-satisfiable");
}

/// The document lists ranges of files only, and a part of a JSON document is no document.
#[tokio::test]
async fn json_comes_whole_and_with_conditions() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let whole = server.get(&home).await;
    assert_eq!((whole.status, whole.header("accept-ranges")), (200, ""));
    for range in ["bytes=0-0", "bytes=100000-"] {
        let answer = ask(&server, &home, &[("range", range)]).await;
        assert_eq!(answer, (200, None, whole.bytes.clone()), "{range}");
    }
    let tag = whole.header("etag");
    for (header, value, status) in
        [("if-none-match", tag, 304), ("if-match", tag, 200), ("if-match", "\"another\"", 412)]
    {
        assert_eq!(server.get_with(&home, header, value).await.status, status, "{header}: {value}");
    }
}
