//! Clips that arrive in parts: the protocol, each of its extensions, and the refusals.

use crate::clips::small_clip;
use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use sha1::{Digest, Sha1};
use std::time::Duration;
use viola_storage::Role;
use viola_testing::tus::{BYTES, encoded, metadata, sha256};
use viola_testing::{room, until};

const ID: &str = "01a1f766-7a97-7747-9dbb-391e0eeccb64";
const UPLOADS: &str = "/v1/uploads";

/// Checks that the clip at `path` is the file, byte for byte, and returns it.
async fn check_clip(server: &Server, path: &str, bytes: &[u8]) -> Value {
    let clip = server.get(path).await.ok(200);
    assert_eq!((&clip["sha256"], &clip["size_bytes"]), (&json!(sha256(bytes)), &json!(bytes.len())));
    clip
}

async fn check_refused(request: reqwest::RequestBuilder, status: u16, code: &str, field: &str) {
    let answer = viola_testing::client::Client::read(request.send().await.unwrap()).await;
    assert_eq!(answer.header("tus-resumable"), "1.0.0", "{code}");
    let problem = answer.problem(status, code);
    assert_eq!(problem["field"].as_str().unwrap_or_default(), field, "{problem}");
}

#[tokio::test]
async fn a_clip_arrives_in_two_parts() {
    let server = Server::without_workers().await;
    server.make_room("h").await;
    let clip = small_clip();
    let (first, rest) = clip.split_at(clip.len() / 3);
    let upload = server.begin("h", clip.len()).await;
    let answer = server.send(server.patch(&upload, 0, first)).await;
    assert_eq!((answer.status, answer.header("upload-offset")), (204, &*first.len().to_string()));
    assert!(answer.header("upload-expires").ends_with(" GMT") && answer.header("viola-clip").is_empty());

    let head = server.head(&upload).await;
    assert_eq!((head.status, head.header("cache-control")), (200, "no-store"));
    assert_eq!(head.header("upload-offset"), first.len().to_string());
    assert_eq!(head.header("upload-length"), clip.len().to_string());
    let sent = metadata(&[("home", "h"), ("filename", "a clip.zip")]);
    assert_eq!(head.header("upload-metadata"), sent);
    let told = server.get(&upload).await.ok(200);
    let expected = json!(["whole", "arriving", "h", "a clip.zip", first.len(), null, null]);
    let names = ["kind", "state", "home", "filename", "received_bytes", "clip", "job"];
    assert_eq!(json!(names.map(|name| told[name].clone())), expected);

    let last = server.send(server.patch(&upload, first.len(), rest)).await;
    assert_eq!((last.status, last.header("upload-offset")), (204, &*clip.len().to_string()));
    assert!(last.header("upload-expires").is_empty());
    let made = check_clip(&server, last.header("viola-clip"), &clip).await;
    assert_eq!(last.header("viola-job"), format!("/v1/jobs/{}", made["job"]["id"].as_str().unwrap()));
    assert_eq!(server.get(last.header("viola-job")).await.ok(200)["state"], "queued");

    // A client that lost the last answer finds the clip, and may repeat the last request.
    let empty = server.send(server.patch(&upload, clip.len(), b"")).await;
    for again in [server.head(&upload).await, empty] {
        assert_eq!(again.header("upload-offset"), clip.len().to_string());
        assert_eq!(again.header("viola-clip"), last.header("viola-clip"));
        assert_eq!(again.header("viola-job"), last.header("viola-job"));
    }
    let told = server.get(&upload).await.ok(200);
    assert_eq!((&told["state"], &told["clip"]), (&json!("finished"), &json!(last.header("viola-clip"))));
    // The map's two files, and the clip: nothing is left of the parts.
    assert_eq!(server.blobs().len(), 3);
    server.delete(last.header("viola-clip")).await.ok(204);
    server.get(&upload).await.problem(404, "upload-not-found");
}

#[tokio::test]
async fn options_tell_what_is_served() {
    let server = Server::with(|params| params.max_upload_bytes = 12_345).await;
    server.make_home("h").await;
    for path in [UPLOADS.to_owned(), server.begin("h", 10).await] {
        // OPTIONS needs no version.
        let asked = server.request(Method::OPTIONS, &path).header("Tus-Resumable", "0.2.2");
        let answer = server.send(asked).await;
        let told =
            ["tus-resumable", "tus-version", "tus-max-size", "tus-checksum-algorithm", "tus-extension"];
        let expected = [
            "1.0.0",
            "1.0.0",
            "12345",
            "sha1,sha256",
            "creation,creation-with-upload,creation-defer-length,checksum,expiration,termination,concatenation",
        ];
        assert_eq!((answer.status, told.map(|name| answer.header(name))), (204, expected));
    }
}

#[tokio::test]
async fn creation_is_refused_for_a_reason() {
    let server = Server::with(|params| params.max_upload_bytes = 1000).await;
    server.make_home("h").await;
    let good = metadata(&[("home", "h")]);
    let good = good.as_str();
    let elsewhere = format!("final;/elsewhere/{ID}");
    let bad_id = format!("final;{UPLOADS}/7");
    let once = format!("final;{UPLOADS}/{ID}");
    let twice = format!("{once} {UPLOADS}/{ID}");
    // Headers, and the status, problem and field of the answer.
    type Case<'a> = (&'a [(&'a str, &'a str)], u16, &'a str, &'a str);
    let cases: [Case<'_>; 18] = [
        (&[("Upload-Metadata", good)], 400, "invalid-header", "Upload-Length"),
        (&[("Upload-Length", "5")], 400, "invalid-header", "Upload-Metadata"),
        (&[("Upload-Length", "+5")], 400, "invalid-header", "Upload-Length"),
        (&[("Upload-Length", "-5")], 400, "invalid-header", "Upload-Length"),
        (&[("Upload-Length", "5.0")], 400, "invalid-header", "Upload-Length"),
        (&[("Upload-Length", "18446744073709551615")], 400, "invalid-header", "Upload-Length"),
        (&[("Upload-Length", "5"), ("Upload-Length", "6")], 400, "invalid-header", "Upload-Length"),
        (&[("Upload-Length", "1001"), ("Upload-Metadata", good)], 413, "body-too-large", "Upload-Length"),
        (&[("Upload-Length", "0"), ("Upload-Metadata", good)], 422, "body-empty", "Upload-Length"),
        (
            &[("Upload-Length", "5"), ("Upload-Defer-Length", "1")],
            400,
            "invalid-header",
            "Upload-Defer-Length",
        ),
        (&[("Upload-Defer-Length", "2")], 400, "invalid-header", "Upload-Defer-Length"),
        (&[("Upload-Concat", "part")], 400, "invalid-header", "Upload-Concat"),
        (&[("Upload-Concat", "final;")], 400, "invalid-header", "Upload-Concat"),
        (&[("Upload-Concat", &elsewhere)], 400, "invalid-header", "Upload-Concat"),
        (&[("Upload-Concat", &bad_id)], 400, "invalid-header", "Upload-Concat"),
        (&[("Upload-Concat", &twice)], 400, "invalid-header", "Upload-Concat"),
        (&[("Upload-Concat", &once)], 400, "invalid-header", "Upload-Metadata"),
        (&[("Upload-Concat", &once), ("Upload-Metadata", good)], 404, "upload-not-found", "Upload-Concat"),
    ];
    for (headers, status, code, field) in cases {
        println!("{headers:?}");
        let request = server.tus(Method::POST, UPLOADS);
        let request = headers.iter().fold(request, |request, (name, value)| request.header(*name, *value));
        check_refused(request, status, code, field).await;
    }
    check_refused(server.announce(5, &[("home", "none")]), 404, "home-not-found", "").await;
    let and = |name: &str, value: &str| format!("{good},{}", metadata(&[(name, value)]));
    let bad_metadata = [
        metadata(&[("home", "../h")]),
        metadata(&[("filename", "a")]),
        and("title", " "),
        and("filename", "\u{a0} "),
        "home".to_owned(),
        "home !".to_owned(),
        format!("home {}", encoded(b"\xff")),
        format!("{good},{good}"),
        and("filename", "a\nb"),
        and("filename", &"x".repeat(256)),
        and("recorded_at", "yesterday"),
        and("scale", "metres"),
        and("recorded_at", "1999-12-31T23:59:59Z"),
        and("idempotency_key", ""),
        and("idempotency_key", "a b"),
        and("note", &"x".repeat(4000)),
    ];
    for sent in bad_metadata {
        println!("{sent}");
        let request = server.tus(Method::POST, UPLOADS).header("Upload-Length", 5);
        check_refused(request.header("Upload-Metadata", sent), 400, "invalid-header", "Upload-Metadata")
            .await;
    }
    // Metadata under other names belongs to the client and is kept.
    let sent = format!("{},is_confidential", and("type", "application/zip"));
    let request = server.tus(Method::POST, UPLOADS).header("Upload-Length", 5);
    let begun = server.send(request.header("Upload-Metadata", &sent)).await;
    assert_eq!(server.head(begun.header("location")).await.header("upload-metadata"), sent);
    assert_eq!(server.blobs().len(), 0);
}

#[tokio::test]
async fn going_on_is_refused_for_a_reason() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let upload = &server.begin("h", 100).await;
    server.send(server.patch(upload, 0, &[7; 10])).await.ok(204);
    let typed = |kind: &str| server.tus(Method::PATCH, upload).header("Content-Type", kind);
    let at = |offset: &str| typed(BYTES).header("Upload-Offset", offset);
    let untyped = server.tus(Method::PATCH, upload).header("Upload-Offset", 10);
    let sum = |sum: &str| server.patch(upload, 10, b"x").header("Upload-Checksum", sum);
    let sha1 = encoded(Sha1::digest(b"y"));
    let none = format!("{UPLOADS}/{ID}");
    let bare = |method: Method| server.request(method, upload);
    let overridden = server.tus(Method::POST, upload).header("X-HTTP-Method-Override", "PUT");
    let cases = [
        (server.patch(upload, 0, b"x"), 409, "upload-offset-mismatch", "Upload-Offset"),
        (server.patch(upload, 9, b"x"), 409, "upload-offset-mismatch", "Upload-Offset"),
        (server.patch(upload, 11, b"x"), 409, "upload-offset-mismatch", "Upload-Offset"),
        (server.patch(upload, 100, b""), 409, "upload-offset-mismatch", "Upload-Offset"),
        (server.patch(upload, 10, &[7; 91]), 413, "body-too-large", "Upload-Length"),
        (at("-1"), 400, "invalid-header", "Upload-Offset"),
        (at("+10"), 400, "invalid-header", "Upload-Offset"),
        (at("ten"), 400, "invalid-header", "Upload-Offset"),
        (at("10").header("Upload-Offset", "10"), 400, "invalid-header", "Upload-Offset"),
        (typed(BYTES), 400, "invalid-header", "Upload-Offset"),
        (at("10").header("Upload-Length", 99), 400, "invalid-header", "Upload-Length"),
        (untyped, 415, "unsupported-media-type", "Content-Type"),
        (typed("application/zip").body("x"), 415, "unsupported-media-type", "Content-Type"),
        (sum("crc32 AAAAAA=="), 400, "unknown-checksum-algorithm", "Upload-Checksum"),
        (sum(&format!("SHA1 {sha1}")), 400, "unknown-checksum-algorithm", "Upload-Checksum"),
        (sum("sha1"), 400, "invalid-header", "Upload-Checksum"),
        (sum("sha1 AAAA"), 400, "invalid-header", "Upload-Checksum"),
        (sum(&format!("sha256 {sha1}")), 400, "invalid-header", "Upload-Checksum"),
        (sum(&format!("sha1 {sha1}")), 460, "checksum-mismatch", "Upload-Checksum"),
        (server.patch(&none, 0, b"x"), 404, "upload-not-found", ""),
        (server.tus(Method::DELETE, &none), 404, "upload-not-found", ""),
        (server.tus(Method::GET, &none), 404, "upload-not-found", ""),
        (server.patch(&format!("{UPLOADS}/7"), 0, b"x"), 400, "invalid-path", "upload"),
        (bare(Method::PATCH), 400, "invalid-header", "Tus-Resumable"),
        (bare(Method::PATCH).header("Tus-Resumable", "1"), 400, "invalid-header", "Tus-Resumable"),
        (server.tus(Method::OPTIONS, &none), 404, "upload-not-found", ""),
        (
            bare(Method::DELETE).header("Tus-Resumable", "0.2.2"),
            412,
            "tus-version-unsupported",
            "Tus-Resumable",
        ),
        (server.tus(Method::POST, upload), 400, "invalid-header", "X-HTTP-Method-Override"),
        (overridden, 400, "invalid-header", "X-HTTP-Method-Override"),
    ];
    for (request, status, code, field) in cases {
        println!("{request:?}");
        check_refused(request, status, code, field).await;
    }
    // A HEAD's refusal has no body.
    let head = server.head(&none).await;
    assert_eq!((head.status, head.header("upload-offset")), (404, ""));
    let other = server.send(bare(Method::HEAD).header("Tus-Resumable", "2.0.0")).await;
    assert_eq!((other.status, other.header("tus-version")), (412, "1.0.0"));
    let none = server.send(bare(Method::HEAD)).await;
    assert_eq!((none.status, none.header("tus-version")), (400, "1.0.0"));
    // None of these requests took effect.
    assert_eq!(server.offset(upload).await, 10);
    assert_eq!(server.blobs().len(), 1);
}

#[tokio::test]
async fn a_body_beyond_the_length_is_refused_where_it_is_not_announced() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let upload = server.begin("h", 100).await;
    let chunks = (0..30).map(|_| Ok::<_, std::io::Error>(vec![7u8; 10]));
    let body = reqwest::Body::wrap_stream(futures::stream::iter(chunks));
    check_refused(server.patch(&upload, 0, b"").body(body), 413, "body-too-large", "Upload-Length").await;
    assert!(server.offset(&upload).await <= 100);
}

#[tokio::test]
async fn a_file_that_is_no_clip_is_refused_with_its_last_byte() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let upload = server.begin("h", 300).await;
    server.send(server.patch(&upload, 0, &[b'x'; 200])).await.ok(204);
    let refused = server.send(server.patch(&upload, 200, &[b'x'; 100])).await;
    let refused = refused.problem(415, "unknown-layout");
    let told = server.get(&upload).await.ok(200);
    assert_eq!((&told["state"], &told["problem"]), (&json!("refused"), &refused));
    let head = server.head(&upload).await;
    assert_eq!((head.status, head.header("upload-offset")), (410, ""));
    server.send(server.patch(&upload, 300, b"")).await.problem(410, "upload-gone");
    assert_eq!(server.blobs().len(), 0);
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 0);
}

#[tokio::test]
async fn bytes_come_with_the_creation() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let clip = small_clip();
    let create = |bytes: &[u8]| {
        let request = server.announce(clip.len(), &[("home", "h")]);
        request.header("Content-Type", BYTES).body(bytes.to_vec())
    };
    let begun = server.send(create(&clip[..100])).await;
    assert_eq!((begun.status, begun.header("upload-offset")), (201, "100"));
    let last = server.go_on(begun.header("location"), &clip).await;
    check_clip(&server, last.header("viola-clip"), &clip).await;

    let whole = server.send(create(&clip)).await;
    assert_eq!((whole.status, whole.header("upload-offset")), (201, &*clip.len().to_string()));
    check_clip(&server, whole.header("viola-clip"), &clip).await;
    assert_eq!(whole.json()["clip"], whole.header("viola-clip"));

    let kept = server.blobs().len();
    let sum = |bytes: &[u8]| format!("sha1 {}", encoded(Sha1::digest(bytes)));
    let damaged = create(b"x").header("Upload-Checksum", sum(b"y"));
    check_refused(damaged, 460, "checksum-mismatch", "Upload-Checksum").await;
    check_refused(create(&[clip.clone(), vec![0]].concat()), 413, "body-too-large", "Upload-Length").await;
    let form = server.announce(5, &[("home", "h")]).body("x");
    check_refused(form, 415, "unsupported-media-type", "Content-Type").await;
    assert_eq!(server.blobs().len(), kept);
}

/// Begins an upload whose length is told later, sends its first bytes, and returns its address.
async fn begin_deferred(server: &Server, bytes: &[u8]) -> String {
    let begun = server.tus(Method::POST, UPLOADS).header("Upload-Defer-Length", 1);
    let begun = server.send(begun.header("Upload-Metadata", metadata(&[("home", "h")]))).await;
    let upload = begun.header("location");
    server.send(server.patch(upload, 0, bytes)).await.ok(204);
    upload.to_owned()
}

#[tokio::test]
async fn a_length_may_be_told_later() {
    let server = Server::with(|params| {
        params.workers = 0;
        params.max_upload_bytes = 100_000;
    })
    .await;
    server.make_home("h").await;
    let clip = small_clip();
    let upload = &begin_deferred(&server, &clip[..50]).await;
    let head = server.head(upload).await;
    assert_eq!((head.header("upload-defer-length"), head.header("upload-length")), ("1", ""));
    let with = |length: usize| server.patch(upload, 50, &clip[50..60]).header("Upload-Length", length);
    check_refused(with(49), 400, "invalid-header", "Upload-Length").await;
    check_refused(with(100_001), 413, "body-too-large", "Upload-Length").await;
    server.send(with(clip.len())).await.ok(204);
    // Whether the body fits into the file or not.
    for body in [&b"x"[..], &clip] {
        let other = server.patch(upload, 60, body).header("Upload-Length", 1000);
        check_refused(other, 400, "invalid-header", "Upload-Length").await;
    }
    let last = server.send(server.patch(upload, 60, &clip[60..])).await;
    check_clip(&server, last.header("viola-clip"), &clip).await;
}

/// A refused request once set the length all the same: 50 bytes were a whole file then.
#[tokio::test]
async fn a_refused_body_sets_no_length() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let clip = small_clip();
    let upload = &begin_deferred(&server, &clip[..50]).await;
    for length in [50, 55] {
        let larger = server.patch(upload, 50, &clip[50..60]).header("Upload-Length", length);
        check_refused(larger, 413, "body-too-large", "Upload-Length").await;
        let head = server.head(upload).await;
        let told = ["upload-offset", "upload-defer-length", "upload-length"].map(|name| head.header(name));
        assert_eq!(told, ["50", "1", ""], "{length}");
    }
    let last = server.patch(upload, 50, &clip[50..]).header("Upload-Length", clip.len());
    let last = server.send(last).await;
    check_clip(&server, last.header("viola-clip"), &clip).await;
}

#[tokio::test]
async fn sums_are_checked() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let clip = small_clip();
    let upload = server.begin("h", clip.len()).await;
    let (first, rest) = clip.split_at(1000);
    let sha1 = format!("sha1 {}", encoded(Sha1::digest(first)));
    server.send(server.patch(&upload, 0, first).header("Upload-Checksum", sha1)).await.ok(204);
    let sum = |bytes| format!("sha256 {}", encoded(sha2::Sha256::digest(bytes)));
    let damaged = server.patch(&upload, 1000, rest).header("Upload-Checksum", sum(first));
    check_refused(damaged, 460, "checksum-mismatch", "Upload-Checksum").await;
    assert_eq!(server.offset(&upload).await, 1000);
    let last = server.send(server.patch(&upload, 1000, rest).header("Upload-Checksum", sum(rest))).await;
    check_clip(&server, last.header("viola-clip"), &clip).await;
}

#[tokio::test]
async fn every_refusal_names_the_version() {
    let server = Server::without_workers().await;
    let begin = |path: &str| server.tus(Method::POST, path);
    check_refused(begin("/v1/uploads?x=1"), 400, "invalid-query", "x").await;
    let packed = begin(UPLOADS).header("Content-Encoding", "gzip").body("x");
    check_refused(packed, 415, "unsupported-media-type", "Content-Encoding").await;
    server.key("acme", Role::Admin, None).await;
    check_refused(begin(UPLOADS), 401, "key-missing", "").await;
}

#[tokio::test]
async fn an_upload_is_given_up() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let upload = server.begin("h", 100).await;
    server.send(server.patch(&upload, 0, &[7; 10])).await.ok(204);
    assert_eq!(server.blobs().len(), 1);
    server.send(server.tus(Method::DELETE, &upload)).await.ok(204);
    server.send(server.tus(Method::DELETE, &upload)).await.problem(404, "upload-not-found");
    assert_eq!((server.head(&upload).await.status, server.blobs().len()), (404, 0));
    // Deletion by clients that can only POST; a clip outlives its upload.
    let clip = small_clip();
    let upload = server.begin("h", clip.len()).await;
    let post =
        |method: &'static str| server.tus(Method::POST, &upload).header("X-HTTP-Method-Override", method);
    let last = post("PATCH").header("Upload-Offset", 0).header("Content-Type", BYTES).body(clip.clone());
    let last = server.send(last).await;
    assert_eq!(last.status, 204);
    server.send(post("DELETE")).await.ok(204);
    assert_eq!(server.head(&upload).await.status, 404);
    check_clip(&server, last.header("viola-clip"), &clip).await;
    // The deletion of a home deletes its uploads.
    let upload = server.begin("h", 100).await;
    server.send(server.patch(&upload, 0, &[7; 10])).await.ok(204);
    server.delete("/v1/homes/h").await.ok(204);
    assert_eq!((server.head(&upload).await.status, server.blobs().len()), (404, 0));
}

#[tokio::test]
async fn parts_are_joined() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let clip = small_clip();
    let mut parts = Vec::new();
    for piece in [&clip[..700], &clip[700..1500], &clip[1500..]] {
        let begun = server.tus(Method::POST, UPLOADS).header("Upload-Concat", "partial");
        let begun = server.send(begun.header("Upload-Length", piece.len())).await;
        parts.push((begun.header("location").to_owned(), piece));
    }
    let join = |paths: &[&str]| {
        let list = format!("final;{}", paths.join(" "));
        let request = server.tus(Method::POST, UPLOADS).header("Upload-Concat", list);
        request.header("Upload-Metadata", metadata(&[("home", "h")]))
    };
    let [a, b, c] = [0, 1, 2].map(|part| parts[part].0.as_str());
    let absolute = format!("{}{b}", server.base);
    for (path, piece) in &parts {
        check_refused(join(&[a, &absolute, c]), 409, "upload-unfinished", "Upload-Concat").await;
        let answer = server.send(server.patch(path, 0, piece)).await;
        assert_eq!((answer.status, answer.header("viola-clip")), (204, ""));
        assert_eq!(server.head(path).await.header("upload-concat"), "partial");
    }
    let whole = server.begin("h", 5).await;
    check_refused(join(&[a, b, &whole]), 400, "invalid-header", "Upload-Concat").await;
    check_refused(join(&[a]).header("Upload-Length", 5), 403, "upload-final", "").await;
    let joined = server.send(join(&[a, &absolute, c])).await;
    assert_eq!((joined.status, joined.header("upload-length")), (201, &*clip.len().to_string()));
    check_clip(&server, joined.header("viola-clip"), &clip).await;
    let upload = joined.header("location");
    let head = server.head(upload).await;
    assert_eq!(head.header("upload-concat"), format!("final;{a} {absolute} {c}"));
    assert_eq!(head.header("upload-offset"), head.header("upload-length"));
    check_refused(server.patch(upload, clip.len(), b""), 403, "upload-final", "").await;
    // Each part goes into one file, once; a client that lost the answer may repeat the request.
    assert_eq!(server.head(a).await.status, 410);
    check_refused(join(&[a, c]), 410, "upload-gone", "Upload-Concat").await;
    let again = server.send(join(&[a, &absolute, c])).await;
    assert_eq!((again.status, again.header("location")), (201, upload));
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 1);
    assert_eq!(server.blobs().len(), 1);
}

#[tokio::test]
async fn abandoned_uploads_expire() {
    let server = Server::with(|params| {
        params.workers = 0;
        params.uploads.clean_every = Duration::from_millis(50);
    })
    .await;
    server.make_home("h").await;
    let clip = small_clip();
    let finished = server.begin("h", clip.len()).await;
    let last = server.go_on(&finished, &clip).await;
    let upload = server.begin("h", 100).await;
    server.send(server.patch(&upload, 0, &[7; 10])).await.ok(204);
    server.execute("UPDATE uploads SET expires_at = 0 WHERE state = 'arriving'").await;
    until("the upload is gone", async || {
        let status = server.head(&upload).await.status;
        assert!([200, 410, 404].contains(&status));
        status == 404
    })
    .await;
    server.send(server.patch(&upload, 10, b"x")).await.problem(404, "upload-not-found");
    until("its bytes are gone", async || server.blobs().len() == 1).await;
    // The record of a finished upload is kept for longer.
    assert_eq!(server.head(&finished).await.header("viola-clip"), last.header("viola-clip"));
}

/// 4096 empty uploads of one tenant once made all others wait for a day.
#[tokio::test]
async fn only_so_many_may_be_unfinished() {
    let server = Server::with(|params| {
        params.workers = 0;
        params.uploads.limits.in_home = 2;
        params.uploads.limits.in_tenant = 3;
        params.uploads.limits.pieces = 3;
    })
    .await;
    for home in ["a", "b"] {
        server.make_home(home).await;
    }
    let begin = |home| server.announce(10, &[("home", home)]);
    let partial = || {
        let request = server.tus(Method::POST, UPLOADS).header("Upload-Length", 10);
        request.header("Upload-Concat", "partial")
    };
    let first = server.begin("a", 10).await;
    server.begin("a", 10).await;
    check_refused(begin("a"), 429, "too-many-uploads", "").await;
    // A partial upload is of no home, but of the tenant.
    server.send(partial()).await.ok(201);
    check_refused(begin("b"), 429, "too-many-uploads", "").await;
    check_refused(partial(), 429, "too-many-uploads", "").await;
    for offset in 0..3 {
        server.send(server.patch(&first, offset, b"x")).await.ok(204);
    }
    check_refused(server.patch(&first, 3, b"x"), 413, "too-many-pieces", "").await;
    server.send(server.tus(Method::DELETE, &first)).await.ok(204);
    server.send(begin("b")).await.ok(201);
    // The uploads of one tenant lock out no other.
    check_refused(partial(), 429, "too-many-uploads", "").await;
    let other = server.client("bolt", Role::Admin, None).await;
    other.make_home("h").await;
    let upload = other.begin("h", small_clip().len()).await;
    assert_eq!(other.go_on(&upload, &small_clip()).await.status, 204);
    let usage = other.get("/v1/usage").await.ok(200);
    assert_eq!((&usage["uploads"], &usage["max_uploads"]), (&0.into(), &3.into()));
    let for_one_home = server.client("bolt", Role::Reader, Some("h")).await;
    for_one_home.get("/v1/usage").await.problem(403, "forbidden");
}

#[tokio::test]
async fn metadata_tells_of_the_clip() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let upload = |bytes: Vec<u8>| {
        let told = [("home", "h"), ("recorded_at", "2026-03-14T17:09:26+02:00"), ("idempotency_key", "k")];
        server.send(server.announce(bytes.len(), &told).header("Content-Type", BYTES).body(bytes))
    };
    let first = upload(small_clip()).await;
    let clip = check_clip(&server, first.header("viola-clip"), &small_clip()).await;
    assert_eq!(clip["recorded_at"], "2026-03-14T15:09:26Z");
    let again = upload(small_clip()).await;
    assert_eq!(again.header("viola-clip"), first.header("viola-clip"));
    let other = viola_testing::zips::zip(&room::clip(3));
    let reused = upload(other).await.problem(422, "idempotency-key-reused");
    assert_eq!(reused["field"], "Upload-Metadata", "the key came there, and not in a header of its own");
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 1);
    assert_eq!(server.blobs().len(), 1);
}

#[tokio::test]
async fn a_repeated_beginning_returns_the_upload_without_bytes() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    server.make_home("other").await;
    let begin = async |told: &[(&str, &str)], length: usize| {
        let begun = server.send(server.announce(length, told)).await;
        assert_eq!(begun.status, 201);
        begun.header("location").to_owned()
    };
    let clip = small_clip();
    let told = [("home", "h"), ("idempotency_key", "k")];
    let first = begin(&told, clip.len()).await;
    assert_eq!(begin(&told, clip.len()).await, first);
    let others: [(&[(&str, &str)], usize); 4] = [
        (&told, clip.len() + 1),
        (&[("home", "other"), told[1]], clip.len()),
        (&[told[0], ("idempotency_key", "l")], clip.len()),
        (&told[..1], clip.len()),
    ];
    for (told, length) in others {
        assert_ne!(begin(told, length).await, first, "{told:?}");
    }
    assert_ne!(begin(&told[..1], clip.len()).await, begin(&told[..1], clip.len()).await, "without a key");
    server.send(server.patch(&first, 0, &clip[..9])).await.ok(204);
    assert_ne!(begin(&told, clip.len()).await, first, "another sender has begun");
}

/// A phone repeats a request that it believes lost while the service still works on it.
#[tokio::test]
async fn equal_beginnings_at_once_have_one_upload() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let clip = small_clip();
    let sum = sha256(&clip);
    for named in [("sha256", sum.as_str()), ("idempotency_key", "k")] {
        let begin = || server.send(server.announce(clip.len(), &[("home", "h"), named]));
        let answers = futures::future::join_all((0..16).map(|_| begin())).await;
        let paths: Vec<&str> = answers.iter().map(|answer| answer.header("location")).collect();
        assert!(paths.iter().all(|path| !path.is_empty() && *path == paths[0]), "{named:?}: {paths:?}");
        assert_eq!(server.get("/v1/usage").await.ok(200)["uploads"], 1, "{named:?}");
        server.send(server.tus(Method::DELETE, paths[0])).await.ok(204);
    }
}

/// An app that lost the answer to its POST sends it again, whatever has arrived meanwhile.
#[tokio::test]
async fn the_same_file_has_one_upload_by_its_sha256() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    server.make_home("other").await;
    let clip = small_clip();
    let sum = sha256(&clip);
    let request = |told: &[(&str, &str)]| server.announce(clip.len(), told);
    let begin = async |told: &[(&str, &str)]| {
        let begun = server.send(request(told)).await;
        assert_eq!(begun.status, 201);
        (begun.header("location").to_owned(), begun.header("upload-offset").parse::<usize>().unwrap())
    };
    let told = [("home", "h"), ("sha256", sum.as_str()), ("filename", "a.zip")];
    let (upload, _) = begin(&told).await;
    let upper = sum.to_uppercase();
    let (key, other_key) = (("idempotency_key", "k"), ("idempotency_key", "l"));
    assert_eq!(
        begin(&[told[0], ("sha256", upper.as_str()), ("title", "Kitchen")]).await,
        (upload.clone(), 0)
    );
    let keyed = begin(&[told[0], told[1], key]).await.0;
    let others = [upload.clone(), keyed.clone()];
    assert_ne!(keyed, upload, "its sender tells it apart");
    for told in [&[told[0], told[1], other_key][..], &[("home", "other"), told[1]], &told[..1]] {
        assert!(!others.contains(&begin(told).await.0), "{told:?}");
    }
    server.send(server.patch(&upload, 0, &clip[..100])).await.ok(204);
    assert_eq!(begin(&told).await, (upload.clone(), 100));
    // Bytes that come with the repetition are not added.
    let with_body = request(&told).header("Content-Type", BYTES).body(clip.clone());
    let again = server.send(with_body).await;
    assert_eq!((again.header("location"), again.header("upload-offset")), (&*upload, "100"));
    let last = server.go_on(&upload, &clip).await;
    let made = last.header("viola-clip").to_owned();
    check_clip(&server, &made, &clip).await;
    let again = server.send(request(&told)).await;
    assert_eq!((again.status, again.header("location"), again.header("viola-clip")), (201, &*upload, &*made));
    assert_eq!(server.get("/v1/homes/h").await.ok(200)["clips"], 1);

    // Its record is gone; the file still makes no second clip.
    server.send(server.tus(Method::DELETE, &upload)).await.ok(204);
    let (later, offset) = begin(&told).await;
    assert_eq!((offset, later == upload), (0, false));
    assert_eq!(server.go_on(&later, &clip).await.header("viola-clip"), made);
    // Once the clip is removed, the file makes one again.
    server.delete(&made).await.ok(204);
    let (anew, _) = begin(&told).await;
    let anew = server.go_on(&anew, &clip).await.header("viola-clip").to_owned();
    assert_ne!(anew, made);
    check_clip(&server, &anew, &clip).await;
}

#[tokio::test]
async fn a_file_without_its_sha256_is_refused() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let clip = small_clip();
    let sum = sha256(&viola_testing::zips::zip(&room::clip(3)));
    let request = |sum: &str| server.announce(clip.len(), &[("home", "h"), ("sha256", sum)]);
    let upload = server.send(request(&sum)).await.header("location").to_owned();
    let refused = server.send(server.patch(&upload, 0, &clip)).await.problem(422, "checksum-mismatch");
    assert_eq!(refused["field"], "Upload-Metadata");
    assert_eq!(server.get(&upload).await.ok(200)["state"], "refused");
    assert_eq!(server.blobs().len(), 0);
    // The right bytes get a new upload.
    let again = server.send(request(&sum)).await;
    assert_eq!((again.status, again.header("location") == upload), (201, false));
    for bad in ["", "x", &sum[1..], &"g".repeat(64)] {
        check_refused(request(bad), 400, "invalid-header", "Upload-Metadata").await;
    }
}
