//! Keys, roles and tenants: none can change, see or guess the resources of another.

use crate::clips::{TOO_FEW_FRAMES, small_clip};
use crate::document::{document, operations};
use crate::server::Server;
use jiff::{SignedDuration, Timestamp};
use reqwest::Method;
use serde_json::json;
use std::num::NonZeroU32;
use viola::api::LimitParams;
use viola_storage::{NewKey, Role, TenantLimits};
use viola_testing::client::{Answer, Client, id_of};
use viola_testing::room;

#[tokio::test]
async fn without_keys_everybody_on_this_machine_may_do_everything() {
    let server = Server::without_workers().await;
    server.make_home("h").await;
    let session = server.get("/v1/session").await.ok(200);
    assert_eq!(session, json!({"tenant": "default", "role": "admin", "with_key": false}));
    // After the first key, every request needs one.
    let admin = server.client("default", Role::Admin, None).await;
    let problem = server.get("/v1/homes").await;
    assert_eq!(problem.header("www-authenticate"), "Bearer realm=\"viola\"");
    problem.problem(401, "key-missing");
    assert_eq!(admin.get("/v1/homes").await.ok(200)["items"][0]["id"], "h");
    // The probe of life, the page and the document need none.
    for path in ["/healthz", "/", "/openapi.json"] {
        assert_eq!(server.get(path).await.status, 200, "{path}");
    }
    for path in ["/readyz", "/metrics"] {
        server.get(path).await.problem(401, "key-missing");
        assert_eq!(admin.get(path).await.status, 200, "{path}");
    }
}

#[tokio::test]
async fn only_valid_keys_pass() {
    let server = Server::without_workers().await;
    let (key, secret) = server.key("acme", Role::Admin, None).await;
    let good = format!("Bearer {}", secret.show());
    let mut other = secret.show().to_owned();
    let last = if other.pop() == Some('0') { '1' } else { '0' };
    other.push(last);
    let cases = [
        (good.as_str(), 200),
        (&good.replace("Bearer", "bearer"), 200),
        (&format!("Bearer {other}"), 401),
        (&good.replace("Bearer", "Basic"), 401),
        (secret.show(), 401),
        ("Bearer", 401),
        ("Bearer ", 401),
        ("Bearer viola_", 401),
        ("Bearer ' OR 1=1 --", 401),
        (&format!("Bearer {}", "a".repeat(5000)), 401),
    ];
    let ask = async |authorization: &str| {
        let request = server.request(Method::GET, "/v1/session").header("authorization", authorization);
        server.send(request).await
    };
    for (authorization, status) in cases {
        let answer = ask(authorization).await;
        assert_eq!(answer.status, status, "{authorization}");
        if status == 401 {
            answer.problem(401, "key-invalid");
        }
    }
    let storage = server.administer().await;
    storage.revoke_key(key.id, Timestamp::now()).await.unwrap();
    ask(&good).await.problem(401, "key-invalid");
    let expires_at = Some(Timestamp::now() - SignedDuration::from_secs(1));
    let new = NewKey { tenant: key.tenant, role: Role::Admin, home: None, label: String::new(), expires_at };
    let (_, expired) = storage.create_key(new, Timestamp::now()).await.unwrap();
    ask(&format!("Bearer {}", expired.show())).await.problem(401, "key-invalid");
}

/// A home with a map, a clip with its job, and an unfinished upload.
struct Belongings {
    home: String,
    clip: String,
    job: String,
    upload: String,
    webhook: String,
    delivery: String,
}

async fn belongings(client: &Client, home: &str) -> Belongings {
    let home = client.make_room(home).await;
    let clip = client.film(&home, 2).await;
    let job = client.job_of(&clip).await;
    let upload = client.begin(id_of(&home), 100).await;
    let address = json!({"url": "https://fleet.example/"});
    let webhook = client.send_json(Method::POST, "/v1/webhooks", &address).await.ok(201);
    let webhook = format!("/v1/webhooks/{}", webhook["id"].as_str().unwrap());
    let delivery = client.post(&format!("{webhook}/test"), "").await.ok(201);
    let delivery = delivery["id"].as_str().unwrap().to_owned();
    Belongings { home, clip, job, upload, webhook, delivery }
}

/// Returns every route of the document with these belongings in it, for every method.
fn every_route(of: &Belongings) -> Vec<(Method, String)> {
    let values = [
        ("{home}", id_of(&of.home)),
        ("{clip}", id_of(&of.clip)),
        ("{job}", id_of(&of.job)),
        ("{upload}", id_of(&of.upload)),
        ("{webhook}", id_of(&of.webhook)),
        ("{delivery}", of.delivery.as_str()),
        ("{object}", "chair-1"),
        ("{room}", "1"),
        ("{level}", "main"),
        ("{revision}", "1"),
    ];
    let mut routes = Vec::new();
    for (method, path, _) in operations(&document()) {
        let filled = values.iter().fold(path.to_owned(), |path, (name, value)| path.replace(name, value));
        assert!(!filled.contains('{'), "{path} names something that this test does not know");
        routes.push((method.to_uppercase().parse().unwrap(), filled));
    }
    routes
}

/// Sends a request with a valid body, so that only the key can be the reason of a refusal.
async fn send(client: &Client, method: &Method, path: &str) -> Answer {
    let request = client.request(method.clone(), path).header("tus-resumable", "1.0.0");
    let request = match (method.as_str(), path) {
        ("PUT", path) if path.ends_with("/alignment") => {
            request.json(&json!({"map_from_clip": {"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0}}))
        }
        ("PATCH", path) if path.contains("/map/") => request
            .header("content-type", "application/merge-patch+json")
            .body(json!({"name": "Chair by the window"}).to_string()),
        ("PUT", path) if path.contains("/lidar-map") => request.body(room::lidar_csv()),
        ("POST", path) if path.ends_with("/clips") => request.body(small_clip()),
        ("PATCH" | "POST", path) if path.starts_with("/v1/uploads/") => request
            .header("x-http-method-override", "PATCH")
            .header("upload-offset", "0")
            .header("content-type", "application/offset+octet-stream")
            .body("x"),
        _ => request,
    };
    if path.ends_with("/events") {
        // Events of a queued job never end.
        let response = request.send().await.unwrap();
        let (status, headers) = (response.status().as_u16(), response.headers().clone());
        return Answer { status, headers, bytes: vec![] };
    }
    client.send(request).await
}

#[tokio::test]
async fn another_tenants_ids_are_nobodys_in_every_route() {
    let server = Server::without_workers().await;
    let acme = server.client("acme", Role::Admin, None).await;
    let bolt = server.client("bolt", Role::Admin, None).await;
    // Both tenants use one id, only the first one uses the other.
    let own = belongings(&acme, "shared").await;
    belongings(&bolt, "shared").await;
    let secret = belongings(&acme, "secret").await;
    let before = (acme.get(&own.clip).await.ok(200), acme.get(&secret.home).await.ok(200));
    for of in [&own, &secret] {
        for (method, path) in every_route(of) {
            let names = ["clips/", "/v1/jobs/", "/v1/uploads/", "/v1/webhooks/", "homes/secret"];
            let makes_a_home = method == Method::PUT && path == "/v1/homes/secret";
            if !names.iter().any(|name| path.contains(name)) || makes_a_home || method == Method::OPTIONS {
                continue;
            }
            let answer = send(&bolt, &method, &path).await;
            assert!(
                answer.status == 404,
                "{method} {path}: {} {}",
                answer.status,
                String::from_utf8_lossy(&answer.bytes)
            );
        }
    }
    // The requests changed nothing, and no list shows anything of it.
    assert_eq!((acme.get(&own.clip).await.ok(200), acme.get(&secret.home).await.ok(200)), before);
    assert_eq!(acme.get(&own.upload).await.ok(200)["received_bytes"], 0);
    for path in [
        "/v1/homes",
        "/v1/homes?updated_after=2000-01-01T00:00:00Z",
        "/v1/clips",
        "/v1/changes",
        "/v1/objects",
        "/v1/jobs",
    ] {
        let text = String::from_utf8(bolt.get(path).await.bytes).unwrap();
        assert!(!text.contains("secret") && !text.contains(id_of(&own.clip)), "{path}");
    }
}

#[tokio::test]
async fn a_role_allows_what_it_says() {
    let server = Server::without_workers().await;
    let admin = server.client("acme", Role::Admin, None).await;
    let reader = server.client("acme", Role::Reader, None).await;
    let uploader = server.client("acme", Role::Uploader, None).await;
    let of = belongings(&admin, "h").await;
    for (method, path) in every_route(&of) {
        let reads = [Method::GET, Method::HEAD, Method::OPTIONS].contains(&method);
        let is_open = ["/healthz", "/v1/session"].contains(&path.as_str());
        let is_secret = path.starts_with("/v1/webhooks");
        let answer = send(&reader, &method, &path).await;
        assert_eq!(
            answer.status == 403,
            (!reads || is_secret) && !is_open,
            "reader: {method} {path}: {}",
            answer.status
        );
        // (An uploader may remove uploads, so it comes after the reader.)
        let uploads = path.starts_with("/v1/uploads")
            || (method == Method::POST && path.ends_with("/clips"))
            || (method == Method::GET
                && ([of.home.as_str(), of.clip.as_str(), "/v1/classes"].contains(&path.as_str())
                    || ["/thumbnail.jpg", "/frames.jpg"].iter().any(|name| path.ends_with(name))
                    || path.starts_with("/v1/jobs/")));
        let answer = send(&uploader, &method, &path).await;
        assert_eq!(
            answer.status == 403,
            !uploads && !is_open,
            "uploader: {method} {path}: {}",
            answer.status
        );
    }
    // No forbidden request took effect.
    assert_eq!(admin.get(&of.home).await.ok(200)["lidar_map_revision"], 1);
    admin.get(&of.clip).await.ok(200);
}

#[tokio::test]
async fn a_refusal_names_the_role_that_is_needed_and_the_one_that_the_key_has() {
    let server = Server::without_workers().await;
    let admin = server.client("acme", Role::Admin, None).await;
    let of = belongings(&admin, "h").await;
    let overlay = format!("{}/overlay.png", of.clip);
    let clips = format!("{}/clips", of.home);
    let cases: [(Role, Method, &str, &str); 7] = [
        (Role::Uploader, Method::GET, "/v1/homes", "`reader` or `admin`"),
        (Role::Uploader, Method::GET, &overlay, "`reader` or `admin`"),
        (Role::Uploader, Method::DELETE, &of.clip, "`admin`"),
        (Role::Uploader, Method::GET, "/v1/webhooks", "`admin`"),
        (Role::Reader, Method::POST, &clips, "`uploader` or `admin`"),
        (Role::Reader, Method::PATCH, &of.clip, "`admin`"),
        (Role::Reader, Method::GET, "/v1/webhooks", "`admin`"),
    ];
    for (role, method, path, needed) in cases {
        let client = server.client("acme", role, None).await;
        let problem = send(&client, &method, path).await.problem(403, "forbidden");
        let detail = problem["detail"].as_str().unwrap();
        let (needs, has) = detail.split_once("; this key has the role ").unwrap();
        assert!(needs.ends_with(&format!("the role {needed}")), "{method} {path}: {detail}");
        assert!(has.starts_with(&format!("`{}`", role.name())), "{method} {path}: {detail}");
    }
}

/// An app shows its user the picture of a clip that failed, with the key of its home.
#[tokio::test]
async fn an_uploader_sees_the_pictures_of_its_recording_and_no_others() {
    let server = Server::start().await;
    let admin = server.client("acme", Role::Admin, None).await;
    let home = admin.make_room("h").await;
    let own = server.client("acme", Role::Uploader, Some("h")).await;
    let clip = own.film(&home, TOO_FEW_FRAMES).await;
    assert_ne!(own.settled(&clip).await["state"], "aligned");
    let other = server.client("acme", Role::Uploader, Some("other")).await;
    for (file, is_open) in [
        ("thumbnail.jpg", true),
        ("frames.jpg", true),
        ("overlay.png", false),
        ("cloud.ply", false),
        ("scan", false),
        ("recording", false),
    ] {
        let path = format!("{clip}/{file}");
        assert_eq!(own.get(&path).await.status, if is_open { 200 } else { 403 }, "{file}");
        assert_eq!(other.get(&path).await.status, if is_open { 404 } else { 403 }, "{file}");
    }
}

#[tokio::test]
async fn a_key_for_one_home_knows_no_other() {
    let server = Server::without_workers().await;
    let admin = server.client("acme", Role::Admin, None).await;
    let (own, other) = (belongings(&admin, "own").await, belongings(&admin, "other").await);
    for role in [Role::Uploader, Role::Admin] {
        let key = server.client("acme", role, Some("own")).await;
        for path in [&own.home, &own.clip, &own.job, &own.upload] {
            key.get(path).await.ok(200);
        }
        for path in [&other.home, &other.clip, &other.job, &other.upload] {
            assert_eq!(key.get(path).await.status, 404, "{path}");
        }
        let clip = key.post(&format!("{}/clips", other.home), small_clip()).await;
        clip.problem(404, "home-not-found");
    }
    let key = server.client("acme", Role::Admin, Some("own")).await;
    // Metrics and readiness tell of the homes of all tenants.
    let lists = ["/v1/homes", "/v1/clips", "/v1/changes", "/v1/objects", "/v1/jobs", "/v1/webhooks"];
    for path in lists.into_iter().chain(["/metrics", "/readyz"]) {
        let problem = key.get(path).await.problem(403, "forbidden");
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains("`admin`") && detail.contains("`own`"), "{path}: {detail}");
    }
    // The refusal says why, in the same words for a home that exists.
    for path in ["/v1/homes/new", other.home.as_str()] {
        let problem = key.put(path, "").await.problem(404, "home-not-found");
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains("for the home `own` only") && !detail.contains("PUT"), "{path}: {detail}");
    }
}

#[tokio::test]
async fn a_tenant_has_its_share_of_requests() {
    let requests_per_s = NonZeroU32::new(5);
    let server =
        Server::with(|params| params.limits = LimitParams { requests_per_s, ..LimitParams::default() }).await;
    let (acme, bolt) =
        (server.client("acme", Role::Admin, None).await, server.client("bolt", Role::Admin, None).await);
    let mut refused = 0;
    for _ in 0..40 {
        let answer = acme.get("/v1/session").await;
        if answer.status == 429 {
            assert!(answer.header("retry-after").parse::<u64>().unwrap() >= 1);
            answer.problem(429, "too-many-requests");
            refused += 1;
        }
    }
    assert!(refused > 0, "40 requests at once, and 5 a second are allowed");
    // A sign-in counts as well.
    let (_, secret) = server.key("acme", Role::Uploader, None).await;
    let key = json!({"key": secret.show()});
    let sign_in = || server.send_json(Method::PUT, "/v1/session", &key);
    let begun = futures::future::join_all((0..40).map(|_| sign_in())).await;
    let refused = begun.into_iter().find(|answer| answer.status != 204);
    refused.expect("5 sessions a second are allowed").problem(429, "too-many-requests");
    // So does a request that the role of its key does not allow.
    let core = server.client("core", Role::Uploader, None).await;
    let asked = futures::future::join_all((0..40).map(|_| core.get("/v1/homes"))).await;
    for status in [403, 429] {
        assert!(asked.iter().any(|answer| answer.status == status), "{status}");
    }
    bolt.get("/v1/session").await.ok(200);
}

#[tokio::test]
async fn a_tenant_has_its_share_of_room() {
    let clip = small_clip();
    let limit = clip.len() * 3 / 2;
    let limits = LimitParams { storage_bytes: Some(limit as u64), ..LimitParams::default() };
    let server = Server::with(|params| params.limits = limits).await;
    let acme = server.client("acme", Role::Admin, None).await;
    let bolt = server.client("bolt", Role::Admin, None).await;
    for client in [&acme, &bolt] {
        client.make_home("h").await;
        client.post("/v1/homes/h/clips", clip.clone()).await.ok(201);
        client.post("/v1/homes/h/clips", clip.clone()).await.problem(507, "tenant-full");
    }
    acme.send(acme.announce(limit, &[("home", "h")])).await.problem(507, "tenant-full");
}

/// A retry of a stored clip was once refused for its room, and the app told its user that the clip was lost.
#[tokio::test]
async fn what_stores_nothing_needs_no_room() {
    let (clip, map) = (small_clip(), room::lidar_csv());
    let server = Server::without_workers().await;
    let acme = server.client("acme", Role::Admin, None).await;
    acme.make_home("h").await;
    let put = acme.put("/v1/homes/h/lidar-map", map.clone()).await.ok(201);
    let keyed = |key| {
        let request = acme.request(Method::POST, "/v1/homes/h/clips").header("idempotency-key", key);
        acme.send(request.body(clip.clone()))
    };
    let stored = keyed("one").await.ok(201);
    let used = acme.get("/v1/usage").await.ok(200)["bytes"].as_u64();
    let limits = TenantLimits { max_bytes: used, max_uploads: None };
    server.administer().await.set_tenant_limits(&"acme".parse().unwrap(), &limits).await.unwrap();
    keyed("two").await.problem(507, "tenant-full");
    assert_eq!(keyed("one").await.ok(201)["id"], stored["id"]);
    acme.post("/v1/homes/h/clips?dry_run=true", clip.clone()).await.ok(200);
    assert_eq!(acme.put("/v1/homes/h/lidar-map", map).await.ok(200)["revision"], put["revision"]);
}
