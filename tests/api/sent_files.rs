//! Files come back as they were sent, with their names.

use crate::clips::small_clip;
use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use viola_testing::tus::sha256;
use viola_testing::{room, zips};

#[tokio::test]
async fn a_recording_comes_back_with_its_name() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    let file = small_clip();
    let sent = server.post(&format!("{clips}?filename=K%C3%BCche%201.zip&title=Kitchen"), file.clone()).await;
    let sent = sent.ok(201);
    assert_eq!((&sent["file_name"], &sent["title"]), (&json!("K\u{fc}che 1.zip"), &json!("Kitchen")));
    assert_eq!(sent["duplicate_of"], Value::Null);
    let path = format!("{clips}/{}", sent["id"].as_str().unwrap());
    let back = server.get(&format!("{path}/recording")).await;
    assert!(back.bytes == file && back.status == 200);
    let name = "attachment; filename=\"K_che 1.zip\"; filename*=UTF-8''K%C3%BCche%201.zip";
    assert_eq!(back.header("content-disposition"), name);
    assert_eq!(back.header("etag"), format!("\"{}\"", sha256(&file)));
    let range = server.get_with(&format!("{path}/recording"), "range", "bytes=0-1").await;
    assert_eq!((range.status, range.bytes.as_slice()), (206, &b"PK"[..]));

    // The same file again is another clip, which names the first.
    let again = server.post(&clips, file).await.ok(201);
    assert_eq!((&again["duplicate_of"], &again["file_name"]), (&sent["id"], &Value::Null));
    let other = format!("{clips}/{}", again["id"].as_str().unwrap());
    let unnamed = server.get(&format!("{other}/recording")).await;
    let name = format!("attachment; filename=\"clip-{}\"", again["id"].as_str().unwrap());
    assert_eq!(unnamed.header("content-disposition"), name);

    let patch = async |body: Value| server.send_json(Method::PATCH, &path, &body).await;
    assert_eq!(patch(json!({"title": "Hall"})).await.ok(200)["title"], "Hall");
    assert_eq!(patch(json!({})).await.ok(200)["title"], "Hall");
    assert_eq!(patch(json!({"title": null})).await.ok(200)["title"], Value::Null);
    patch(json!({"name": "Hall"})).await.problem(422, "invalid-body");
    for (query, field) in [("filename=", "filename"), ("filename=a%0Ab", "filename"), ("title=", "title")] {
        let refused = server.post(&format!("{clips}?{query}"), small_clip()).await;
        assert_eq!(refused.problem(400, "invalid-query")["field"], field);
    }
}

#[tokio::test]
async fn another_archive_of_the_same_files_is_a_copy() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    let first = server.post(&clips, small_clip()).await.ok(201);
    let mut files = room::clip(2);
    files.reverse();
    for (name, _) in &mut files {
        name.insert_str(0, "again/");
    }
    let copy = server.post(&clips, zips::zip(&files)).await.ok(201);
    assert_ne!(copy["sha256"], first["sha256"]);
    assert_eq!((&first["duplicate_of"], &copy["duplicate_of"]), (&Value::Null, &first["id"]));
    let other = server.post(&clips, zips::zip(&room::clip(3))).await.ok(201);
    assert_eq!(other["duplicate_of"], Value::Null);
    server.delete(&format!("{clips}/{}", first["id"].as_str().unwrap())).await.ok(204);
    let copy = server.get(&format!("{clips}/{}", copy["id"].as_str().unwrap())).await.ok(200);
    assert_eq!(copy["duplicate_of"], Value::Null);
}

#[tokio::test]
async fn homes_are_counted_and_found() {
    let server = Server::without_workers().await;
    for id in ["elm-1", "elm-2", "oak"] {
        server.make_home(id).await;
    }
    let home = "/v1/homes/oak";
    server.send_json(Method::PUT, home, &json!({"name": "\u{d6}l Street"})).await.ok(200);
    server.film(home, 2).await;
    let waiting = server.get(home).await.ok(200);
    assert_eq!((&waiting["clips"], &waiting["clips_by_state"]["uploaded"]), (&json!(1), &json!(1)));
    assert_eq!((&waiting["needs_attention"], &waiting["coverage"]), (&json!(["waiting"]), &json!([])));
    let found = async |query: &str| server.ids(&format!("/v1/homes?{query}")).await;
    assert_eq!(found("q=ELM").await, ["elm-1", "elm-2"]);
    assert_eq!(found("q=%C3%B6l").await, ["oak"]);
    assert_eq!(found("needs_attention=true").await, ["oak"]);
    assert_eq!(found("q=elm&needs_attention=true").await, Vec::<String>::new());
    server.get("/v1/homes?needs_attention=yes").await.problem(400, "invalid-query");
    server.get("/v1/homes?q=").await.problem(400, "invalid-query");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    assert_eq!(server.get(home).await.ok(200)["needs_attention"], json!([]));
}

#[tokio::test]
async fn a_file_that_the_store_lost_is_a_fault_of_the_service() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let recording = format!("{}/recording", server.film(&home, 2).await);
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let map_file = format!("{home}/lidar-maps/main/revisions/1/file");
    let image = format!("{home}/lidar-map/image.png");
    let is_map =
        |path: &std::path::Path| path.ends_with("file") && path.to_string_lossy().contains("lidar-maps");
    for path in server.blobs().iter().filter(|path| is_map(path)) {
        std::fs::write(path, "x").unwrap();
    }
    server.get(&map_file).await.problem(500, "internal-error");
    for path in server.blobs() {
        std::fs::remove_file(path).unwrap();
    }
    for path in [&recording, &map_file, &image] {
        server.get(path).await.problem(500, "internal-error");
    }
    server.delete(&home).await.ok(204);
    server.get(&recording).await.problem(404, "home-not-found");
}
