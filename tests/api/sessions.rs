//! Sessions of browsers, and the limit of failed keys.

use crate::server::{Server, Store};
use jiff::Timestamp;
use reqwest::Method;
use serde_json::json;
use std::time::Duration;
use viola::api::FailedKeyParams;
use viola_storage::Role;
use viola_testing::client::Answer;

async fn sign_in(server: &Server, key: &str) -> Answer {
    server.send_json(Method::PUT, "/v1/session", &json!({"key": key})).await
}

/// Returns the `NAME=VALUE` of the cookie that an answer sets.
fn cookie(answer: &Answer) -> String {
    answer.header("set-cookie").split(';').next().unwrap().to_owned()
}

async fn with_cookie(server: &Server, method: Method, cookie: &str) -> Answer {
    server.send(server.request(method, "/v1/session").header("cookie", format!("a=b; {cookie}"))).await
}

#[tokio::test]
async fn a_browser_has_a_session_of_its_own() {
    let server = Server::without_workers().await;
    let (key, secret) = server.key("acme", Role::Reader, None).await;
    sign_in(&server, "viola_0").await.problem(401, "key-invalid");
    sign_in(&server, &format!("viola_{}", "0".repeat(64))).await.problem(401, "key-invalid");
    // Without a key, none is blamed.
    let no_body = server.send(server.request(Method::PUT, "/v1/session")).await;
    assert_eq!(no_body.problem(422, "invalid-body")["field"], "key");
    let (first, second) = (sign_in(&server, secret.show()).await, sign_in(&server, secret.show()).await);
    let set = first.header("set-cookie").to_owned();
    for part in ["HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=43200"] {
        assert!(set.contains(part), "{set}");
    }
    assert!(!set.contains("Secure"), "a service on loopback has no TLS");
    let (first, second) = (cookie(&first), cookie(&second));
    assert_ne!(first, second);
    assert!(!first.contains(&secret.show()[6..]), "the cookie is not the key");
    assert_eq!(with_cookie(&server, Method::GET, &first).await.ok(200)["tenant"], "acme");
    // The key is no session, and the session no key.
    let raw = format!("viola_session={}", secret.show());
    with_cookie(&server, Method::GET, &raw).await.problem(401, "session-ended");
    let token = first.split_once('=').unwrap().1;
    let bearer = server.get_with("/v1/session", "authorization", &format!("Bearer {token}")).await;
    bearer.problem(401, "key-invalid");
    // Signing out ends the session at the service, and no other.
    let out = with_cookie(&server, Method::DELETE, &first).await;
    assert!(out.status == 204 && out.header("set-cookie").contains("Max-Age=0"));
    with_cookie(&server, Method::GET, &first).await.problem(401, "session-ended");
    with_cookie(&server, Method::GET, &second).await.ok(200);
    server.administer().await.revoke_key(key.id, Timestamp::now()).await.unwrap();
    with_cookie(&server, Method::GET, &second).await.problem(401, "session-ended");
}

/// A browser that had signed in to another service of the same machine was once asked for a key that does not exist.
#[tokio::test]
async fn a_service_without_keys_has_no_use_for_the_cookie_of_another_one() {
    let every = Duration::from_secs(3600);
    let server = Server::with(|params| params.failed_keys = FailedKeyParams { burst: 1, every }).await;
    let cookies = ["0".repeat(64), "x".to_owned()].map(|token| format!("viola_session={token}"));
    for cookie in cookies.iter().cycle().take(6) {
        let session = with_cookie(&server, Method::GET, cookie).await.ok(200);
        assert_eq!(session, json!({"tenant": "default", "role": "admin", "with_key": false}), "{cookie}");
    }
    server.key("acme", Role::Reader, None).await;
    for cookie in &cookies {
        with_cookie(&server, Method::GET, cookie).await.problem(401, "session-ended");
    }
}

/// Streams once went on after their key was revoked.
#[tokio::test]
async fn event_streams_end_with_their_key_or_session() {
    let often = Duration::from_millis(5);
    let server = Server::with(|params| {
        params.workers = 0;
        params.bodies.credentials = often;
    })
    .await;
    let admin = server.client("acme", Role::Admin, None).await;
    let home = admin.make_room("h").await;
    let clip = admin.film(&home, 2).await;
    let job = format!("{}/events", admin.job_of(&clip).await);
    let (key, secret) = server.key("acme", Role::Reader, None).await;
    let (_, other) = server.key("acme", Role::Reader, None).await;
    let session = cookie(&sign_in(&server, other.show()).await);
    let watch = |path: &str, header: (&'static str, String)| {
        server.request(Method::GET, path).header(header.0, header.1).send()
    };
    let bearer = || ("authorization", format!("Bearer {}", secret.show()));
    let of_key = [watch("/v1/homes/h/events", bearer()).await.unwrap(), watch(&job, bearer()).await.unwrap()];
    let of_session = watch("/v1/homes/h/events", ("cookie", session.clone())).await.unwrap();
    server.administer().await.revoke_key(key.id, Timestamp::now()).await.unwrap();
    for stream in of_key {
        stream.text().await.unwrap();
    }
    with_cookie(&server, Method::DELETE, &session).await;
    of_session.text().await.unwrap();
}

#[tokio::test]
async fn cookies_are_for_tls_only_beside_loopback() {
    let server = Server::without_workers().await;
    let (_, secret) = server.key("acme", Role::Reader, None).await;
    let proxied = server.request(Method::PUT, "/v1/session").json(&json!({"key": secret.show()}));
    let proxied = server.send(proxied.header("x-forwarded-proto", "https")).await;
    assert!(proxied.header("set-cookie").ends_with("; Secure"));
    if Store::of_this_run() != Store::Embedded {
        return;
    }
    // A service that other machines reach needs a key before it starts: this one keeps the first one's database.
    let open = server.restart_on("0.0.0.0:0").await;
    let base = open.base.replace("0.0.0.0", "127.0.0.1");
    let request = open.http.put(format!("{base}/v1/session")).json(&json!({"key": secret.show()}));
    assert!(open.send(request).await.header("set-cookie").ends_with("; Secure"));
}

#[tokio::test]
async fn keys_cannot_be_tried_without_end() {
    let every = Duration::from_secs(3600);
    let server = Server::with(|params| params.failed_keys = FailedKeyParams { burst: 5, every }).await;
    let (_, secret) = server.key("acme", Role::Reader, None).await;
    let from = |address: &str, key: &str| {
        let request = server.request(Method::GET, "/v1/session").header("x-forwarded-for", address);
        server.send(request.header("authorization", format!("Bearer {key}")))
    };
    let wrong = |number: u32| format!("viola_{number:064x}");
    from("192.0.2.1", secret.show()).await.ok(200);
    for number in 0..5 {
        from("192.0.2.1", &wrong(number)).await.problem(401, "key-invalid");
    }
    let refused = from("192.0.2.1", &wrong(5)).await;
    let wait: u64 = refused.header("retry-after").parse().unwrap();
    assert!((1..=3601).contains(&wait), "{wait}");
    refused.problem(429, "too-many-failed-keys");
    // Neither cookies nor the sign-in are a way around.
    let session = format!("viola_session={}", "0".repeat(64));
    let request = server.request(Method::GET, "/v1/session").header("x-forwarded-for", "192.0.2.1");
    server.send(request.header("cookie", session)).await.problem(429, "too-many-failed-keys");
    let request = server.request(Method::PUT, "/v1/session").header("x-forwarded-for", "192.0.2.1");
    server.send(request.json(&json!({"key": wrong(6)}))).await.problem(429, "too-many-failed-keys");
    let out = |address: &str, session: String| {
        let request = server.request(Method::DELETE, "/v1/session").header("x-forwarded-for", address);
        server.send(request.header("cookie", session))
    };
    out("192.0.2.1", format!("viola_session={}", "0".repeat(64))).await.problem(429, "too-many-failed-keys");
    // A key that works goes on working, and other addresses are not affected.
    from("192.0.2.1", secret.show()).await.ok(200);
    from("192.0.2.2", &wrong(7)).await.problem(401, "key-invalid");
    // Signing out of sessions that do not exist counts, and signing out of one that was used is always possible.
    let session = cookie(&sign_in(&server, secret.show()).await);
    with_cookie(&server, Method::GET, &session).await.ok(200);
    for number in 0..5 {
        assert_eq!(out("192.0.2.3", format!("viola_session={number:064x}")).await.status, 204);
    }
    let refused = out("192.0.2.3", format!("viola_session={:064x}", 5)).await;
    refused.problem(429, "too-many-failed-keys");
    assert_eq!(out("192.0.2.3", session.clone()).await.status, 204);
    with_cookie(&server, Method::GET, &session).await.problem(401, "session-ended");
}
