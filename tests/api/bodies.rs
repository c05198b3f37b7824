//! Bodies that are not as their headers say: encoded ones, damaged ones, and those of another media type.

use crate::clips::small_clip;
use crate::server::Server;
use reqwest::Method;
use serde_json::json;
use sha2::{Digest, Sha256};
use viola_testing::room;
use viola_testing::tus::{BYTES, encoded};

fn digest_of(bytes: &[u8]) -> String {
    format!("sha-256=:{}:", encoded(Sha256::digest(bytes)))
}

/// Returns requests with a body, one of each kind, and the body.
async fn requests(server: &Server) -> Vec<(&'static str, reqwest::RequestBuilder)> {
    let home = server.make_home("h").await;
    let upload = server.begin("h", small_clip().len()).await;
    let name = json!({"name": "Elm"}).to_string();
    let create = server.announce(small_clip().len(), &[("home", "h")]).header("content-type", BYTES);
    vec![
        ("a clip", server.request(Method::POST, &format!("{home}/clips")).body(small_clip())),
        ("a map", server.request(Method::PUT, &format!("{home}/lidar-map")).body(room::lidar_csv())),
        ("an upload", create.body(small_clip())),
        ("a part", server.patch(&upload, 0, &small_clip())),
        ("json", server.request(Method::PUT, &home).header("content-type", "application/json").body(name)),
        ("a session", server.request(Method::PUT, "/v1/session").json(&json!({"key": "x"}))),
    ]
}

#[tokio::test]
async fn encoded_bodies_are_refused_in_words() {
    let server = Server::without_workers().await;
    for (what, request) in requests(&server).await {
        for coding in ["gzip", "identity, br", "x-unknown"] {
            let answer = server.send(request.try_clone().unwrap().header("content-encoding", coding)).await;
            assert_eq!(answer.header("accept-encoding"), "identity", "{what}");
            let problem = answer.problem(415, "unsupported-media-type");
            assert_eq!(problem["field"], "Content-Encoding", "{what}");
            let name = coding.rsplit(", ").next().unwrap();
            assert!(problem["detail"].as_str().unwrap().contains(name), "{what}: {problem}");
        }
    }
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 0);
    assert_eq!(server.blobs().len(), 0);
    // The name of no encoding, and an encoding of no body.
    let plain = server.request(Method::POST, "/v1/homes/h/clips").header("content-encoding", "identity");
    server.send(plain.body(small_clip())).await.ok(201);
    server.get_with("/v1/homes", "content-encoding", "gzip").await.ok(200);
}

#[tokio::test]
async fn the_digest_of_a_file_is_verified() {
    let server = Server::without_workers().await;
    let (clip, map) = (small_clip(), room::lidar_csv());
    let other = digest_of(b"another file");
    for (what, request) in requests(&server).await.into_iter().take(4) {
        let good = digest_of(if what == "a map" { map.as_bytes() } else { &clip });
        let before = server.blobs().len();
        for field in ["content-digest", "repr-digest"] {
            let send = |digest: &str| server.send(request.try_clone().unwrap().header(field, digest));
            let mut problems = vec![send(&other).await.problem(400, "digest-mismatch")];
            for malformed in ["sha-256", "sha-256=:AAAA:", &good[..good.len() - 1]] {
                problems.push(send(malformed).await.problem(400, "invalid-header"));
            }
            for problem in problems {
                assert!(problem["field"].as_str().unwrap().eq_ignore_ascii_case(field), "{what}: {problem}");
            }
        }
        assert_eq!(server.blobs().len(), before, "{what}: nothing is kept");
        let both = request.header("content-digest", &good).header("repr-digest", &good);
        let answer = server.send(both).await;
        assert!((200..300).contains(&answer.status), "{what}: {answer:?}");
    }
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 3);
    // Another algorithm is ignored.
    let sha_512 =
        server.request(Method::POST, "/v1/homes/h/clips").header("content-digest", "sha-512=:AAAA:");
    server.send(sha_512.body(clip)).await.ok(201);
}

#[tokio::test]
async fn a_wrong_media_type_is_told_the_right_one() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clip = server.film(&home, 2).await;
    let upload = server.begin("h", 100).await;
    let form = "multipart/form-data; boundary=x";
    let octets = "application/octet-stream";
    let part = server.tus(Method::PATCH, &upload).header("upload-offset", 0);
    let cases = [
        (server.request(Method::POST, &format!("{home}/clips")), form, octets),
        (server.request(Method::POST, &format!("{home}/clips")), "application/json", octets),
        (server.request(Method::POST, &format!("{home}/clips")), "Application/JSON; charset=utf-8", octets),
        (server.request(Method::PUT, &format!("{home}/lidar-map")), form, octets),
        (server.request(Method::PUT, &format!("{home}/lidar-maps/upper")), "Multipart/Mixed", octets),
        (part, "application/octet-stream", BYTES),
        (server.request(Method::PUT, &home), form, "application/json"),
        (server.request(Method::PUT, &home), "text/plain", "application/json"),
        (server.request(Method::PATCH, &clip), "application/x-www-form-urlencoded", "application/json"),
        (server.request(Method::POST, "/v1/webhooks"), octets, "application/json"),
    ];
    for (request, sent, expected) in cases {
        let answer = server.send(request.header("content-type", sent).body("{}")).await;
        let problem = answer.problem(415, "unsupported-media-type");
        assert!(problem["detail"].as_str().unwrap().contains(expected), "{sent}: {problem}");
    }
    // Files are known by their content, whatever curl calls them; a map may be JSON.
    let post = server.request(Method::POST, &format!("{home}/clips"));
    let post = post.header("content-type", "application/x-www-form-urlencoded").body(small_clip());
    server.send(post).await.ok(201);
    let map =
        server.request(Method::PUT, &format!("{home}/lidar-map")).header("content-type", "application/json");
    server.send(map.body(room::lidar_csv())).await.ok(201);
}
