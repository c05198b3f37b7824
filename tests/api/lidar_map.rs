use crate::server::Server;
use serde_json::{Value, json};
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
    let clip = server.post(&format!("{home}/clips"), crate::clips::small_clip()).await;
    let clip = clip.header("location").to_owned();
    assert_eq!(server.get(&clip).await.ok(200)["state"], "uploaded");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let first = server.get(&clip).await.ok(200);
    assert_eq!((&first["state"], &first["job"]["lidar_map_revision"]), (&json!("queued"), &json!(1)));
    server.put(&format!("{home}/lidar-map"), format!("{}1,1\n", room::lidar_csv())).await.ok(201);
    let second = server.get(&clip).await.ok(200);
    assert_eq!((&second["state"], &second["job"]["lidar_map_revision"]), (&json!("queued"), &json!(2)));
    let old = server.get(&format!("/v1/jobs/{}", first["job"]["id"].as_str().unwrap())).await.ok(200);
    assert_eq!(old["state"], "cancelled");
}
