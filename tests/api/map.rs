use crate::common::{eventually, room, zips};
use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};

/// The home's map once it has these clips in it.
async fn merged(server: &Server, home: &str, clips: &[&Value]) -> Value {
    eventually("the map is merged", || async {
        let answer = server.get(&format!("{home}/map")).await;
        let map = (answer.status == 200).then(|| answer.json())?;
        let mut wanted: Vec<&str> = clips.iter().map(|id| id.as_str().unwrap()).collect();
        wanted.sort_unstable();
        (map["clips"] == json!(wanted)).then_some(map)
    })
    .await
}

async fn points(server: &Server, home: &str) -> Vec<u8> {
    let answer = server.get(&format!("{home}/map/points.ply")).await;
    assert_eq!((answer.status, answer.header("content-type")), (200, "model/ply"));
    answer.bytes
}

#[tokio::test]
async fn clips_become_one_map_that_does_not_depend_on_their_order() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.get(&format!("{home}/map")).await.problem(404, "map-not-found");
    server.get("/v1/homes/nowhere/map").await.problem(404, "home-not-found");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let add = |frames: u32| {
        let (server, home) = (&server, &home);
        async move {
            let clip = server.post(&format!("{home}/clips"), zips::zip(&room::clip(frames))).await.ok(201);
            let path = format!("{home}/clips/{}", clip["id"].as_str().unwrap());
            assert_eq!(server.settled(&path).await["state"], "aligned");
            (clip["id"].clone(), path)
        }
    };
    let (first, first_path) = add(24).await;
    let (second, _) = add(20).await;
    let map = merged(&server, &home, &[&first, &second]).await;
    assert_eq!((&map["lidar_map_revision"], &map["left_out"]), (&json!(1), &json!([])));
    let count = map["info"]["points"].as_u64().unwrap();
    assert!(count > 1000 && map["info"]["classes"].as_array().unwrap().iter().any(|c| c["class"] == "wall"));
    let both = points(&server, &home).await;
    assert!(
        both.starts_with(b"ply\n") && String::from_utf8_lossy(&both[..200]).contains("comment frame map")
    );

    // Taken out and added again, the other way around in time: the same bytes.
    server.delete(&first_path).await.ok(204);
    let alone = merged(&server, &home, &[&second]).await;
    assert!(alone["revision"].as_i64() > map["revision"].as_i64());
    assert_ne!(points(&server, &home).await, both);
    let (again, _) = add(24).await;
    merged(&server, &home, &[&second, &again]).await;
    assert_eq!(points(&server, &home).await, both);
}

#[tokio::test]
async fn what_a_reader_has_is_not_sent_again() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.post(&format!("{home}/clips"), zips::zip(&room::clip(24))).await.ok(201);
    merged(&server, &home, &[&clip["id"]]).await;
    for path in [format!("{home}/map"), format!("{home}/map/points.ply")] {
        let tag = server.get(&path).await.header("etag").to_owned();
        for (known, status) in [(tag.as_str(), 304), ("\"other\"", 200), ("*", 304)] {
            let request = server.request(Method::GET, &path).header("if-none-match", known);
            let answer = server.send(request).await;
            assert_eq!((answer.status, answer.header("etag")), (status, tag.as_str()), "{path} {known}");
            assert_eq!(answer.bytes.is_empty(), status == 304);
        }
    }
    // A clip that is left out is told, which changes the answer but not the points.
    let map_tag = server.get(&format!("{home}/map")).await.header("etag").to_owned();
    let short = server.post(&format!("{home}/clips"), crate::clips::small_clip()).await.ok(201);
    let path = format!("{home}/clips/{}", short["id"].as_str().unwrap());
    let state = server.settled(&path).await["state"].clone();
    assert_ne!(state, "aligned", "two frames are too few");
    let map = server.get(&format!("{home}/map")).await;
    assert_ne!(map.header("etag"), map_tag);
    let left_out = map.ok(200)["left_out"].clone();
    assert_eq!((&left_out[0]["clip"], &left_out[0]["state"]), (&short["id"], &state));
    assert!(left_out[0]["reasons"][0]["code"].is_string());
}
