//! Limits of a tenant: nothing that it stores is left out, and no tenant can use up another one's.

use crate::clips::small_clip;
use crate::server::Server;
use futures::{StreamExt, stream};
use reqwest::{Body, Method};
use viola::api::LimitParams;
use viola_storage::{Role, TenantLimits};
use viola_testing::client::Client;
use viola_testing::{room, until};

const MIB: usize = 1 << 20;

async fn usage(client: &Client) -> (u64, Option<u64>) {
    let usage = client.get("/v1/usage").await.ok(200);
    (usage["bytes"].as_u64().unwrap(), usage["max_bytes"].as_u64())
}

/// Begins an upload whose length is not known yet; returns its path.
async fn begin_deferred(client: &Client) -> String {
    let request = client.tus(Method::POST, "/v1/uploads").header("upload-defer-length", 1);
    let request = request.header("upload-concat", "partial");
    let answer = client.send(request).await;
    let path = answer.header("location").to_owned();
    answer.ok(201);
    path
}

/// Deferred lengths once stored 399 MB of a tenant with a limit of 5 MB.
#[tokio::test]
async fn deferred_lengths_and_announced_bytes_count() {
    let limits = LimitParams { storage_bytes: Some(5 * MIB as u64), ..LimitParams::default() };
    let server = Server::with(|params| params.limits = limits).await;
    let acme = server.client("acme", Role::Admin, None).await;
    let uploads = [begin_deferred(&acme).await, begin_deferred(&acme).await, begin_deferred(&acme).await];
    let piece = vec![7; 2 * MIB];
    for upload in &uploads[..2] {
        acme.send(acme.patch(upload, 0, &piece)).await.ok(204);
    }
    acme.send(acme.patch(&uploads[2], 0, &piece)).await.problem(507, "tenant-full");
    let late = acme.patch(&uploads[2], 0, b"").header("upload-length", 2 * MIB);
    acme.send(late).await.problem(507, "tenant-full");
    let announce = |length: usize| {
        let request = acme.tus(Method::POST, "/v1/uploads").header("upload-length", length);
        acme.send(request.header("upload-concat", "partial"))
    };
    announce(2 * MIB).await.problem(507, "tenant-full");
    announce(MIB).await.ok(201);
    assert_eq!(usage(&acme).await, (5 * MIB as u64, Some(5 * MIB as u64)));
    // Another tenant has its own room.
    let bolt = server.client("bolt", Role::Admin, None).await;
    let other = begin_deferred(&bolt).await;
    bolt.send(bolt.patch(&other, 0, &piece)).await.ok(204);
    acme.send(acme.tus(Method::DELETE, &uploads[0])).await.ok(204);
    acme.send(acme.patch(&uploads[2], 0, &piece)).await.ok(204);
}

#[tokio::test]
async fn lidar_maps_count_and_only_the_last_are_kept() {
    let server = Server::without_workers().await;
    let acme = server.client("acme", Role::Admin, None).await;
    let home = acme.make_home("h").await;
    let map = room::lidar_csv();
    for number in 0..12 {
        let file = format!("{map}{}.0,1.0\n", number % 4);
        acme.put(&format!("{home}/lidar-map"), file).await.ok(201);
    }
    let revisions = acme.get(&format!("{home}/lidar-map/revisions")).await.ok(200);
    assert_eq!(revisions["items"].as_array().unwrap().len(), 10);
    let (used, limit) = usage(&acme).await;
    assert!(used > 10 * map.len() as u64 && limit.is_none(), "{used}");
    let storage = server.administer().await;
    let own = TenantLimits { max_bytes: Some(used + 100), max_uploads: None };
    storage.set_tenant_limits(&"acme".parse().unwrap(), &own).await.unwrap();
    storage.close().await;
    let answer = acme.put(&format!("{home}/lidar-map"), format!("{map}2.5,1.5\n")).await;
    let detail = answer.json()["detail"].as_str().unwrap().to_owned();
    assert!(detail.contains(&format!("has {used} bytes here, of at most {}", used + 100)), "{detail}");
    answer.problem(507, "tenant-full");
    assert_eq!(usage(&acme).await, (used, Some(used + 100)));
    acme.post(&format!("{home}/clips"), small_clip()).await.problem(507, "tenant-full");
}

/// Dry runs and bodies without a length once filled the disk beyond every quota.
#[tokio::test]
async fn bytes_that_arrive_are_bounded() {
    let server = Server::with(|params| {
        params.max_upload_bytes = MIB as u64;
        params.bodies.process_bytes = 2 * MIB as u64;
        params.bodies.tenant_bytes = MIB as u64;
    })
    .await;
    let acme = server.client("acme", Role::Admin, None).await;
    let bolt = server.client("bolt", Role::Admin, None).await;
    acme.make_home("h").await;
    bolt.make_home("h").await;
    let path = "/v1/homes/h/clips?dry_run=true";
    let endless = stream::iter([Ok::<_, std::io::Error>(vec![7; 3 * MIB / 4])]).chain(stream::pending());
    let held = acme.request(Method::POST, path).body(Body::wrap_stream(endless));
    let held = tokio::spawn(held.send());
    until("the bytes have arrived", async || {
        let sizes = server.blobs().into_iter().filter_map(|file| file.metadata().ok());
        sizes.map(|file| file.len()).sum::<u64>() == 3 * MIB as u64 / 4
    })
    .await;
    let refused = acme.post(path, vec![7; MIB / 2]).await;
    assert!(!refused.header("retry-after").is_empty());
    refused.problem(503, "unavailable");
    // No length is announced.
    let pieces = stream::iter((0..8).map(|_| Ok::<_, std::io::Error>(vec![7; MIB / 16])));
    acme.post(path, Body::wrap_stream(pieces)).await.problem(503, "unavailable");
    bolt.post(path, vec![7; MIB / 2]).await.problem(415, "unknown-layout");
    held.abort();
    until("the bytes are free", async || acme.post(path, vec![7; MIB / 2]).await.status == 415).await;
}
