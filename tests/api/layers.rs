//! Compression, and pages of other origins.

use crate::server::Server;
use flate2::read::GzDecoder;
use reqwest::Method;
use std::io::Read;

#[tokio::test]
async fn text_is_compressed_for_those_who_accept_it() {
    let server = Server::start().await;
    let plain = server.get("/openapi.json").await;
    assert_eq!(plain.header("content-encoding"), "");
    for encoding in ["gzip", "br", "zstd"] {
        let packed = server.get_with("/openapi.json", "accept-encoding", encoding).await;
        assert_eq!(packed.header("content-encoding"), encoding);
        // Each encoding has other bytes, so the tag is weak.
        let tag = packed.header("etag").to_owned();
        assert_eq!(tag, format!("W/{}", plain.header("etag")), "{encoding}");
        let known = server.request(Method::GET, "/openapi.json").header("if-none-match", &tag);
        assert_eq!(server.send(known.header("accept-encoding", encoding)).await.status, 304);
        // Its gzip is made once.
        let length = if encoding == "gzip" { packed.bytes.len().to_string() } else { String::new() };
        assert_eq!(packed.header("content-length"), length, "{encoding}");
        let vary: Vec<_> = packed.headers.get_all("vary").iter().collect();
        assert!(vary.iter().any(|names| *names == "accept-encoding"), "{encoding}: {vary:?}");
        let (packed_bytes, plain_bytes) = (packed.bytes.len(), plain.bytes.len());
        assert!(4 * packed_bytes < plain_bytes, "{encoding}: {packed_bytes} of {plain_bytes} bytes");
        let mut text = Vec::new();
        match encoding {
            "gzip" => drop(GzDecoder::new(packed.bytes.as_slice()).read_to_end(&mut text).unwrap()),
            "zstd" => {
                let mut decoder = ruzstd::decoding::StreamingDecoder::new(packed.bytes.as_slice()).unwrap();
                decoder.read_to_end(&mut text).unwrap();
            }
            _ => continue,
        }
        assert_eq!(text, plain.bytes, "{encoding}");
    }
    let short = server.get_with("/healthz", "accept-encoding", "gzip").await;
    assert_eq!(short.header("content-encoding"), "");
}

/// A change was made and then answered by 406.
#[tokio::test]
async fn a_client_that_forbids_plain_answers_gets_one() {
    let server = Server::without_workers().await;
    for (encoding, packed) in [("identity;q=0", ""), ("*;q=0", ""), ("gzip, identity; q=0.0", "gzip")] {
        let answer = server.get_with("/openapi.json", "accept-encoding", encoding).await;
        assert_eq!((answer.status, answer.header("content-encoding")), (200, packed), "{encoding}");
    }
}

#[tokio::test]
async fn pages_of_named_origins_may_call_and_no_others() {
    let server =
        Server::with(|params| params.cors_origins = vec!["https://app.example".parse().unwrap()]).await;
    let preflight = |origin: &'static str| {
        let request = server.request(Method::OPTIONS, "/v1/uploads").header("origin", origin);
        let request = request.header("access-control-request-method", "PATCH");
        server.send(request.header("access-control-request-headers", "authorization,upload-offset"))
    };
    let allowed = preflight("https://app.example").await;
    assert_eq!(allowed.header("access-control-allow-origin"), "https://app.example");
    assert_eq!(allowed.header("access-control-allow-headers"), "authorization,upload-offset");
    assert!(allowed.header("access-control-allow-methods").contains("PATCH"));
    // Without a method to ask for it is no preflight, but the question of tus.
    let asked = server.request(Method::OPTIONS, "/v1/uploads").header("origin", "https://app.example");
    for asked in [server.request(Method::OPTIONS, "/v1/uploads"), asked] {
        let told = server.send(asked).await;
        assert_eq!((told.status, told.header("tus-version")), (204, "1.0.0"));
    }
    assert_eq!(preflight("https://evil.example").await.header("access-control-allow-origin"), "");

    let answer = server.get_with("/v1/homes/none", "origin", "https://app.example").await;
    assert!(answer.header("access-control-expose-headers").contains("upload-offset"));
    answer.problem(404, "home-not-found");

    for wrong in ["app.example", "https://app.example/path", "*", "null", ""] {
        assert!(wrong.parse::<viola::api::Origin>().is_err(), "{wrong}");
    }
}
