use crate::clips::TOO_FEW_FRAMES;
use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use viola::jobs::{self, align_clip};
use viola_formats::clip::ClipError;
use viola_testing::room;

#[tokio::test]
async fn a_map_is_put_told_and_drawn() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    let path = format!("{home}/lidar-map");
    server.get(&path).await.problem(404, "lidar-map-not-found");
    server.get(&format!("{path}/image.png")).await.problem(404, "lidar-map-not-found");
    server.get("/v1/homes/none/lidar-map").await.problem(404, "home-not-found");
    server.put("/v1/homes/none/lidar-map", room::lidar_csv()).await.problem(404, "home-not-found");

    let first = server.put(&path, room::lidar_csv()).await.ok(201);
    assert_eq!((&first["revision"], &first["info"]["format"]), (&json!(1), &json!("csv_points")));
    let mut current = server.get(&path).await.ok(200);
    let frame = current.as_object_mut().unwrap().remove("image").unwrap();
    assert_eq!(current, first);
    let picture = server.get(&format!("{path}/image.png")).await;
    assert_eq!((picture.status, picture.header("content-type")), (200, "image/png"));
    let picture = image::load_from_memory(&picture.bytes).unwrap();
    assert_eq!(
        (&frame["width_px"], &frame["height_px"]),
        (&picture.width().into(), &picture.height().into())
    );
    // The map lies within its picture.
    let (corner, px_per_m) = (&frame["corner_m"], frame["px_per_m"].as_f64().unwrap());
    let (left_m, top_m) = (corner[0].as_f64().unwrap(), corner[1].as_f64().unwrap());
    let (low, high) = (&first["info"]["min_m"], &first["info"]["max_m"]);
    assert!(left_m < low[0].as_f64().unwrap() && top_m > high[1].as_f64().unwrap());
    assert!(left_m + f64::from(picture.width()) / px_per_m > high[0].as_f64().unwrap());
    assert!(top_m - f64::from(picture.height()) / px_per_m < low[1].as_f64().unwrap());

    // The same file again is no revision, another is.
    assert_eq!(server.put(&path, room::lidar_csv()).await.ok(200), first);
    let other = format!("{}1.0,1.0\n", room::lidar_csv());
    assert_eq!(server.put(&path, other).await.ok(201)["revision"], 2);
    assert_eq!(server.get(&home).await.ok(200)["lidar_map_revision"], 2);
    // A page names the revision, so that its browser does not show the earlier picture again.
    let newer = server.get(&format!("{path}/image.png?revision=2")).await;
    assert_eq!((newer.status, newer.header("content-type")), (200, "image/png"));
    assert_eq!(newer.header("etag"), server.get(&format!("{path}/image.png")).await.header("etag"));
    let page = server.get(&format!("{path}/revisions?limit=1")).await.ok(200);
    assert_eq!(page["items"][0]["revision"], 2);
    let next = page["next"].as_str().unwrap();
    let page = server.get(&format!("{path}/revisions?limit=1&after={next}")).await.ok(200);
    assert_eq!((&page["items"][0], &page["next"]), (&first, &Value::Null));
}

#[tokio::test]
async fn a_new_map_queues_the_clips_again() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let clip = server.film(&home, 2).await;
    assert_eq!(server.get(&clip).await.ok(200)["state"], "uploaded");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let first = server.get(&clip).await.ok(200);
    assert_eq!((&first["state"], &first["job"]["lidar_map_revision"]), (&json!("queued"), &json!(1)));
    server.put(&format!("{home}/lidar-map"), format!("{}1,1\n", room::lidar_csv())).await.ok(201);
    let second = server.get(&clip).await.ok(200);
    assert_eq!((&second["state"], &second["job"]["lidar_map_revision"]), (&json!("queued"), &json!(2)));
    let old = server.get(&format!("/v1/jobs/{}", first["job"]["id"].as_str().unwrap())).await.ok(200);
    assert_eq!((&old["state"], &old["error"]["code"]), (&json!("cancelled"), &json!("superseded")));
    assert_eq!(server.get("/v1/jobs?state=failed").await.ok(200)["items"], json!([]));
}

/// Aligns clips, but not to a map with the point (1, 1).
const REFUSES_THE_POINT: jobs::Method = |clip, maps, params, progress| {
    if maps.iter().any(|map| map.bytes.ends_with(b"\n1,1\n")) {
        return Err(ClipError::NoFrames { color: 0, depth: 0 }.into());
    }
    align_clip(clip, maps, params, progress)
};

#[tokio::test]
async fn the_last_answer_stays_until_a_clip_is_aligned_to_a_new_map() {
    let server = Server::with(|params| params.worker.method = REFUSES_THE_POINT).await;
    let home = server.make_home("h").await;
    let map = format!("{home}/lidar-map");
    server.put(&map, room::lidar_csv()).await.ok(201);
    let clip = server.film(&home, TOO_FEW_FRAMES).await;
    let first = server.settled(&clip).await;
    assert_eq!((&first["last_answer"], first["alignment"].is_object()), (&Value::Null, true));
    let files = async || {
        let mut files = Vec::new();
        for file in ["thumbnail.jpg", "frames.jpg", "overlay.png", "scan"] {
            let answer = server.get(&format!("{clip}/{file}")).await;
            assert_eq!(answer.status, 200, "{file}");
            files.push((answer.header("etag").to_owned(), answer.bytes));
        }
        files
    };
    let before = files().await;
    server.put(&map, format!("{}1,1\n", room::lidar_csv())).await.ok(201);
    let failed = server.settled(&clip).await;
    assert_eq!((&failed["state"], &failed["reasons"][0]["code"]), (&json!("failed"), &json!("no_frames")));
    assert_eq!((&failed["alignment"], &failed["job"]["lidar_map_revision"]), (&Value::Null, &json!(2)));
    let last = &failed["last_answer"];
    assert_eq!((&last["alignment"], &last["lidar_map_revision"]), (&first["alignment"], &json!(1)));
    assert!(files().await == before, "the files are those of the last answer");
    assert_eq!(server.get(&format!("{clip}/cloud.ply")).await.status, 200);

    server.post(&format!("{home}/lidar-maps/main/revisions/1/restore"), "").await.ok(201);
    let second = server.settled(&clip).await;
    assert_eq!((&second["last_answer"], &second["job"]["lidar_map_revision"]), (&Value::Null, &json!(3)));
    let after = files().await;
    assert!(before.iter().zip(after).all(|(before, after)| before.0 != after.0), "they are others now");
}

#[tokio::test]
async fn a_dry_run_only_tells_what_a_map_is() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let path = format!("{home}/lidar-map");
    server.film(&home, 2).await;
    let report = server.put(&format!("{path}?dry_run=true"), room::lidar_csv()).await.ok(200);
    assert_eq!(
        (&report["understood"]["format"], &report["clips_to_align"]),
        (&json!("csv_points"), &json!(1))
    );
    server.get(&path).await.problem(404, "lidar-map-not-found");
    let refused = server.put(&format!("{path}?dry_run=true"), "no map").await;
    refused.problem(415, "unknown-format");
    server.put(&path, room::lidar_csv()).await.ok(201);
    let same = server.put(&format!("{home}/lidar-maps/main?dry_run=true"), room::lidar_csv()).await.ok(200);
    assert_eq!(same["clips_to_align"], 0);
    let new_only = server.request(Method::PUT, &format!("{path}?dry_run=true")).header("if-none-match", "*");
    server.send(new_only.body(room::lidar_csv())).await.problem(412, "changed-meanwhile");
    server.put(&format!("{path}?dry_run=1"), room::lidar_csv()).await.problem(400, "invalid-query");
}

#[tokio::test]
async fn a_mesh_is_no_map() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let mut mesh =
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n"
            .to_owned();
    for corner in 0..8 {
        mesh += &format!("{} {} {}\n", corner & 1, corner >> 1 & 1, f64::from(corner >> 2) * 2.4);
    }
    mesh += "3 0 1 2\n";
    let refused = server.put(&format!("{home}/lidar-map"), mesh.clone()).await;
    let problem = refused.problem(422, "three-dimensional-map");
    assert!(problem["detail"].as_str().unwrap().contains("0.00 to 2.40 m"), "{problem}");
    // A scan that is not quite level is a map.
    server.put(&format!("{home}/lidar-map"), mesh.replace("2.4", "0.2")).await.ok(201);
}

#[tokio::test]
async fn an_earlier_map_comes_back_and_every_file_can_be_had() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let path = format!("{home}/lidar-maps/main");
    let (first, second) = (room::lidar_csv(), format!("{}1,1\n", room::lidar_csv()));
    let put = server.put(&format!("{path}?filename=first.csv"), first.clone()).await.ok(201);
    assert_eq!(put["file_name"], "first.csv");
    server.put(&path, second.clone()).await.ok(201);
    let restored = server.post(&format!("{path}/revisions/1/restore"), "").await.ok(201);
    assert_eq!((&restored["revision"], &restored["sha256"]), (&json!(3), &put["sha256"]));
    assert_eq!(server.post(&format!("{path}/revisions/1/restore"), "").await.ok(200), restored);
    for (revision, name, bytes) in
        [(1, "first.csv", &first), (2, "h-main-2", &second), (3, "first.csv", &first)]
    {
        let file = server.get(&format!("{path}/revisions/{revision}/file")).await;
        assert_eq!(file.bytes, bytes.as_bytes(), "{revision}");
        assert_eq!(file.header("content-disposition"), format!("attachment; filename=\"{name}\""));
        assert_eq!(
            file.header("cache-control"),
            "private, no-cache",
            "a home made again begins at revision 1"
        );
    }
    let missing = server.get(&format!("{path}/revisions/4/file")).await.problem(404, "lidar-map-not-found");
    assert!(missing["detail"].as_str().unwrap().contains("no revision 4"), "{missing}");
    server.post(&format!("{path}/revisions/4/restore"), "").await.problem(404, "lidar-map-not-found");
    for (maps, code, part) in [
        (format!("{home}/lidar-maps/attic"), "lidar-map-not-found", "`attic`"),
        ("/v1/homes/nowhere/lidar-maps/main".to_owned(), "home-not-found", "no home"),
    ] {
        let file = server.get(&format!("{maps}/revisions/1/file")).await;
        let restored = server.post(&format!("{maps}/revisions/1/restore"), "").await;
        for problem in [file, restored].map(|answer| answer.problem(404, code)) {
            assert!(problem["detail"].as_str().unwrap().contains(part), "{problem}");
        }
    }
    for revision in ["0", "-1", "x"] {
        let path = format!("{path}/revisions/{revision}/restore");
        assert_eq!(server.post(&path, "").await.problem(400, "invalid-path")["field"], "revision");
    }
}
