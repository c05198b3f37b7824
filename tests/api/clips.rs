use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use viola_testing::client::id_of;
use viola_testing::{room, zips};

/// Frames of a clip that is not aligned.
pub const TOO_FEW_FRAMES: u32 = 1;

/// Returns a clip of two frames.
pub fn small_clip() -> Vec<u8> {
    zips::zip(&room::clip(2))
}

#[tokio::test]
async fn a_clip_goes_from_upload_to_its_pose_in_the_map() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    let answer = server.post(&format!("{home}/clips"), zips::zip(&room::clip(24))).await;
    let path = answer.header("location").to_owned();
    let clip = answer.ok(201);
    assert_eq!(path, format!("{home}/clips/{}", clip["id"].as_str().unwrap()));
    assert_eq!((&clip["state"], &clip["job"]), (&json!("uploaded"), &Value::Null));
    assert_eq!(clip["reasons"][0]["code"], "no_lidar_map");
    assert_eq!((&clip["info"]["layout"], &clip["info"]["frames"]), (&json!("scannet"), &json!(24)));
    for file in ["overlay.png", "thumbnail.jpg"] {
        server.get(&format!("{path}/{file}")).await.problem(404, "result-not-found");
    }
    server.post(&format!("{path}/align"), "").await.problem(409, "no-lidar-map");

    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.settled(&path).await;
    assert_eq!(clip["state"], "aligned", "{clip:#}");
    assert_eq!(clip["alignment"]["state"], clip["state"]);
    assert_eq!(clip["job"]["state"], "succeeded");
    check_pose(&clip["alignment"]["map_from_clip"]);

    let picture = server.get(&format!("{path}/overlay.png")).await;
    assert_eq!((picture.status, picture.header("content-type")), (200, "image/png"));
    image::load_from_memory(&picture.bytes).unwrap();
    // Only a clip that is not aligned shows its frames.
    server.get(&format!("{path}/frames.jpg")).await.problem(404, "result-not-found");
    let cloud = server.get(&format!("{path}/cloud.ply")).await;
    assert_eq!((cloud.status, cloud.header("content-type")), (200, "model/ply"));
    assert!(cloud.bytes.starts_with(b"ply\n"));

    // Again: the same answer apart from the times.
    let again = server.post(&format!("{path}/align"), "").await.ok(202);
    assert_eq!(again["alignment"], Value::Null);
    let mut again = server.settled(&path).await["alignment"].clone();
    let mut first = clip["alignment"].clone();
    for alignment in [&mut again, &mut first] {
        alignment.as_object_mut().unwrap().remove("seconds").unwrap();
    }
    assert_eq!(again, first);

    // A file that the store lost is no file that the clip does not have.
    for (route, file) in [("overlay.png", "overlay.png"), ("scan", "scan.json"), ("cloud.ply", "cloud.ply")] {
        assert_eq!(server.get(&format!("{path}/{route}")).await.status, 200);
        // Those of the first answer may be there still.
        for blob in server.blobs().iter().filter(|blob| blob.ends_with(file)) {
            let _ = std::fs::remove_file(blob);
        }
        server.get(&format!("{path}/{route}")).await.problem(500, "internal-error");
    }
}

#[tokio::test]
async fn a_thumbnail_comes_with_the_answer_and_goes_with_the_clip() {
    let server = Server::start().await;
    let home = server.make_room("h").await;
    // A clip without a pose in the map has one too.
    let path = server.film(&home, TOO_FEW_FRAMES).await;
    assert_ne!(server.settled(&path).await["state"], "aligned");
    let thumbnail = format!("{path}/thumbnail.jpg");
    let answer = server.get(&thumbnail).await;
    assert_eq!((answer.status, answer.header("content-type")), (200, "image/jpeg"));
    assert_eq!(answer.header("cache-control"), "private, no-cache");
    let picture = image::load_from_memory_with_format(&answer.bytes, image::ImageFormat::Jpeg).unwrap();
    assert!(picture.width().max(picture.height()) <= 320, "{} x {}", picture.width(), picture.height());
    let frames = server.get(&format!("{path}/frames.jpg")).await;
    assert_eq!((frames.status, frames.header("content-type")), (200, "image/jpeg"));
    image::load_from_memory_with_format(&frames.bytes, image::ImageFormat::Jpeg).unwrap();
    let tag = answer.header("etag").to_owned();
    let known = server.get_with(&thumbnail, "if-none-match", &tag).await;
    assert_eq!((known.status, known.header("etag"), known.bytes.len()), (304, tag.as_str(), 0));

    server.delete(&path).await.ok(204);
    server.get(&thumbnail).await.problem(404, "clip-not-found");
}

#[tokio::test]
async fn a_failed_clip_shows_its_frames_and_says_why() {
    let server = Server::start().await;
    let home = server.make_room("h").await;
    // The depth sensor saw nothing.
    let mut files = room::clip(6);
    for (_, bytes) in files.iter_mut().filter(|(name, _)| name.contains("depth/")) {
        let mut blank = image::load_from_memory(bytes).unwrap().into_luma16();
        blank.fill(0);
        bytes.clear();
        blank.write_to(&mut std::io::Cursor::new(bytes), image::ImageFormat::Png).unwrap();
    }
    let path = server.add_clip(&home, zips::zip(&files)).await;
    let clip = server.settled(&path).await;
    assert_eq!((&clip["state"], &clip["alignment"]["map_from_clip"]), (&json!("failed"), &Value::Null));
    let reason = &clip["reasons"][0];
    assert!(reason["code"].is_string() && reason["detail"].as_str().unwrap().len() > 20, "{reason}");
    let frames = server.get(&format!("{path}/frames.jpg")).await;
    assert_eq!((frames.status, frames.header("content-type")), (200, "image/jpeg"));
    let picture = image::load_from_memory_with_format(&frames.bytes, image::ImageFormat::Jpeg).unwrap();
    assert!(picture.width() > 2 * picture.height(), "{} x {}", picture.width(), picture.height());
    // The export has them, too.
    let export = server.get(&format!("{home}/export")).await;
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(&export.bytes)).unwrap();
    let mut exported = Vec::new();
    let name = format!("clips/{}/frames.jpg", clip["id"].as_str().unwrap());
    std::io::Read::read_to_end(&mut zip.by_name(&name).unwrap(), &mut exported).unwrap();
    assert!(exported == frames.bytes);
}

/// Checks a pose against the bounds for real clips: 3 degrees and 0.1 m.
fn check_pose(map_from_clip: &Value) {
    let (x0, y0, turn) = room::MAP_FROM_ROOM;
    let (x, y, yaw) = room::FIRST_CAMERA;
    let truth = (x0 + turn.cos() * x - turn.sin() * y, y0 + turn.sin() * x + turn.cos() * y, turn + yaw);
    let number = |name: &str| map_from_clip[name].as_f64().unwrap();
    let away = (number("x_m") - truth.0).hypot(number("y_m") - truth.1);
    let turned = (number("yaw_rad") - truth.2).sin().abs();
    assert!(away < 0.1 && turned < 3f64.to_radians(), "{map_from_clip} is not {truth:?}");
}

#[tokio::test]
async fn clips_are_listed_by_pages_and_removed() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    let mut made = Vec::new();
    for _ in 0..3 {
        made.push(server.film(&home, 2).await);
    }
    let page = server.get(&format!("{clips}?limit=2")).await.ok(200);
    let rest = server.get(&format!("{clips}?limit=2&after={}", page["next"].as_str().unwrap())).await.ok(200);
    let listed = page["items"].as_array().unwrap().iter().chain(rest["items"].as_array().unwrap());
    let ids: Vec<&str> = made.iter().map(|clip| id_of(clip)).collect();
    assert_eq!(listed.map(|clip| clip["id"].clone()).collect::<Vec<_>>(), ids);
    assert_eq!(rest["next"], Value::Null);
    assert_eq!(server.get(&home).await.ok(200)["clips"], 3);

    server.delete(&made[0]).await.ok(204);
    server.delete(&made[0]).await.problem(404, "clip-not-found");
    server.get(&made[0]).await.problem(404, "clip-not-found");
    assert_eq!(server.blobs().len(), 2);
    server.delete(&home).await.ok(204);
    server.get(&clips).await.problem(404, "home-not-found");
    assert_eq!(server.blobs().len(), 0);
}

#[tokio::test]
async fn an_idempotency_key_makes_one_clip_of_many_uploads() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    let upload = |key: &'static str, body: Vec<u8>| {
        server.send(server.request(Method::POST, &clips).header("Idempotency-Key", key).body(body))
    };
    let first = upload("k", small_clip()).await;
    let again = upload("k", small_clip()).await;
    assert_eq!(again.header("location"), first.header("location"));
    let first = first.ok(201);
    assert_eq!(again.ok(201), first);
    // An app that retries may pack the recording again.
    let mut files = room::clip(2);
    files.reverse();
    assert_eq!(upload("k", zips::zip(&files)).await.ok(201), first);
    let other = zips::zip(&room::clip(3));
    let problem = upload("k", other).await.problem(422, "idempotency-key-reused");
    assert_eq!(problem["field"], "Idempotency-Key");
    // All at once, as from a phone with a bad connection.
    let many = (0..6).map(|_| upload("at-once", small_clip()));
    let many = futures::future::join_all(many).await;
    let ids: std::collections::HashSet<String> =
        many.into_iter().map(|one| one.ok(201)["id"].to_string()).collect();
    assert_eq!(ids.len(), 1);
    assert_eq!(server.get(&home).await.ok(200)["clips"], 2);
    assert_eq!(server.blobs().len(), 2);
    upload("a b", small_clip()).await.problem(400, "invalid-header");
    let twice =
        server.request(Method::POST, &clips).header("Idempotency-Key", "k").header("Idempotency-Key", "l");
    let problem = server.send(twice.body(small_clip())).await.problem(400, "invalid-header");
    assert_eq!(problem["field"], "Idempotency-Key");
}

#[tokio::test]
async fn a_clip_is_found_in_its_own_home_only() {
    let server = Server::without_workers().await;
    let home = server.make_home("mine").await;
    let other = server.make_home("other").await;
    let path = server.film(&home, 2).await.replace(&home, &other);
    server.get(&path).await.problem(404, "clip-not-found");
    server.delete(&path).await.problem(404, "clip-not-found");
    server.post(&format!("{path}/align"), "").await.problem(404, "clip-not-found");
}

#[tokio::test]
async fn a_clip_knows_when_it_was_recorded() {
    let server = Server::without_workers().await;
    let clips = format!("{}/clips", server.make_home("h").await);
    let upload = async |query: String| server.post(&format!("{clips}{query}"), small_clip()).await;
    // ScanNet's layout has no times.
    assert_eq!(upload(String::new()).await.ok(201)["recorded_at"], Value::Null);
    let cases = [
        ("2026-03-14T15:09:26Z", "2026-03-14T15:09:26Z"),
        ("2026-03-14T17:09:26.5%2B02:00", "2026-03-14T15:09:26.5Z"),
        ("2000-01-01T00:00:00Z", "2000-01-01T00:00:00Z"),
    ];
    for (given, kept) in cases {
        let clip = upload(format!("?recorded_at={given}")).await.ok(201);
        assert_eq!(clip["recorded_at"], kept, "{given}");
        let path = format!("{clips}/{}", clip["id"].as_str().unwrap());
        assert_eq!(server.get(&path).await.ok(200)["recorded_at"], kept);
    }
    let refused = [
        "",
        "yesterday",
        "2026-03-14",
        "1773500966",
        "1999-12-31T23:59:59Z",
        "2399-01-01T00:00:00Z",
        // The + is a space here.
        "2026-03-14T17:09:26+02:00",
    ];
    let before = server.blobs().len();
    for given in refused {
        let problem = upload(format!("?recorded_at={given}")).await.problem(400, "invalid-query");
        assert_eq!(problem["field"], "recorded_at", "{given}");
        let has_advice = problem["detail"].as_str().unwrap().contains("%2B");
        assert!(has_advice || !given.contains('+'), "{problem}");
    }
    assert_eq!(server.blobs().len(), before);
}

#[tokio::test]
async fn clips_are_listed_by_state_and_time() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    let mut made = Vec::new();
    for _ in 0..3 {
        made.push(server.film(&home, 2).await);
    }
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let job = server.job_of(&made[1]).await;
    server.post(&format!("{job}/cancel"), "").await.ok(200);
    let listed = async |query: &str| server.ids(&format!("{clips}?{query}")).await;
    assert_eq!(listed("state=uploaded,failed").await, [id_of(&made[1])]);
    assert!(listed("updated_after=2399-01-01T00:00:00%2B01:00").await.is_empty());
    // A filter and a cursor together.
    let first = server.get(&format!("{clips}?state=queued&limit=1")).await.ok(200);
    let next = first["next"].as_str().unwrap();
    let rest = server.get(&format!("{clips}?state=queued&limit=1&after={next}")).await.ok(200);
    assert_eq!((&rest["items"][0]["id"], &rest["next"]), (&json!(id_of(&made[2])), &Value::Null));
    let homes = server.get("/v1/homes?updated_after=2020-01-01T00:00:00Z").await.ok(200);
    assert_eq!(homes["items"][0]["id"], "h");
    assert_eq!(server.get("/v1/homes?updated_after=2399-01-01T00:00:00Z").await.ok(200)["items"], json!([]));
}

#[tokio::test]
async fn a_dry_run_tells_what_would_become_of_a_file_and_keeps_nothing() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    let file = zips::zip(&room::clip(24));
    let report = server.post(&format!("{clips}?dry_run=true"), file.clone()).await.ok(200);
    assert_eq!(report["size_bytes"], file.len());
    assert_eq!(
        (&report["understood"]["layout"], &report["understood"]["frames"]),
        (&json!("scannet"), &json!(24))
    );
    assert_eq!(report["has_lidar_map"], false);
    let key_frames = report["estimate"]["key_frames"].as_u64().unwrap();
    assert!((1..=24).contains(&key_frames), "{report:#}");
    assert!(report["estimate"]["seconds"].as_f64().unwrap() > 0.0, "{report:#}");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let report = server.post(&format!("{clips}?dry_run=true"), file.clone()).await.ok(200);
    assert_eq!(report["has_lidar_map"], true);

    // A dry run refuses the same files.
    server.post(&format!("{clips}?dry_run=true"), "no clip").await.problem(415, "unknown-layout");
    let problem =
        server.post(&format!("{clips}?dry_run=maybe"), file.clone()).await.problem(400, "invalid-query");
    assert_eq!(problem["field"], "dry_run");
    assert_eq!(server.get(&clips).await.ok(200)["items"], json!([]));
    assert_eq!(server.get(&home).await.ok(200)["clips"], 0);
    server.post(&format!("{clips}?dry_run=false"), file).await.ok(201);
}

#[tokio::test]
async fn a_clip_without_metres_gets_its_scale_with_its_pose() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    let clips = format!("{home}/clips");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let file = zips::zip(&room::clip(24));
    let report = server.post(&format!("{clips}?dry_run=true&scale=unknown"), file.clone()).await.ok(200);
    assert_eq!(report["understood"]["metric"], false);
    let clip = server.post(&format!("{clips}?scale=unknown"), file.clone()).await.ok(201);
    assert_eq!(clip["info"]["metric"], false);
    let clip = server.settled(&format!("{clips}/{}", clip["id"].as_str().unwrap())).await;
    let alignment = &clip["alignment"];
    assert_ne!(alignment["state"], "failed", "{clip:#}");
    let scale = alignment["scale"].as_f64().unwrap();
    assert!((scale - 1.0).abs() < 0.03, "{clip:#}");
    assert!(alignment["scale_std"].as_f64().unwrap() > 0.0, "{clip:#}");
    let metric = server.settled(&server.film(&home, 24).await).await;
    assert_eq!((&metric["info"]["metric"], &metric["alignment"]["scale"]), (&json!(true), &Value::Null));
    for given in ["", "1.0", "metres"] {
        let refused = server.post(&format!("{clips}?scale={given}"), file.clone()).await;
        assert_eq!(refused.problem(400, "invalid-query")["field"], "scale", "{given}");
    }
}
