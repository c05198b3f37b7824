//! Files for robots and homes.

use crate::corrections::{add, list, patch, start};
use crate::server::Server;
use serde_json::{Value, json};
use std::io::{Cursor, Read};
use viola_formats::lidar::{Cell, LidarMap};
use viola_testing::room;
use zip::ZipArchive;

async fn robot(server: &Server, home: &str, query: &str) -> Value {
    let answer = server.get(&format!("{home}/map/robot?{query}")).await;
    assert_eq!((answer.status, answer.header("content-type")), (200, "application/json"), "{query}");
    answer.json()
}

#[tokio::test]
async fn a_robot_gets_its_map_back_with_names_zones_and_goals() {
    let server = start().await;
    let home = server.make_home("h").await;
    let lidar = room::lidar_valetudo();
    server.put(&format!("{home}/lidar-map"), lidar.clone()).await.ok(201);
    server.get(&format!("{home}/map/robot?format=matter")).await.problem(404, "map-not-found");
    add(&server, &home, 24).await;
    let objects = list(&server, &home, "objects", |list| list["objects"] != json!([])).await;
    patch(&server, &format!("{home}/map/rooms/16"), &json!({"name": "Kitchen"})).await.ok(200);
    list(&server, &home, "rooms", |list| list["rooms"][0]["name"] == "Kitchen").await;

    // The person's name of the room is in the uploaded map, and nothing else is changed.
    let valetudo = robot(&server, &home, "format=valetudo").await;
    let mut want: Value = serde_json::from_str(&lidar).unwrap();
    want["layers"][0]["metaData"]["name"] = json!("Kitchen");
    assert_eq!((&valetudo["map"], &valetudo["map_absent"]), (&want, &Value::Null));
    assert_eq!(valetudo["segments"][0]["room"], "16");
    assert_eq!(
        (&valetudo["coordinates"]["unit"], &valetudo["coordinates"]["is_valetudo"]),
        (&json!("cm"), &json!(true))
    );
    let ids = |list: &Value| -> Vec<Value> {
        list.as_array().unwrap().iter().map(|object| object["id"].clone()).collect()
    };
    assert_eq!(ids(&valetudo["objects"]), ids(&objects["objects"]));
    // Every goal is on the robot's floor: 10 m - y is the height on the sheet.
    let map = LidarMap::read(lidar.as_bytes()).unwrap();
    let targets = valetudo["rooms"].as_array().unwrap().iter().chain(valetudo["objects"].as_array().unwrap());
    for target in targets.filter(|target| target["go_to"] != Value::Null) {
        let cm = |axis: &str| target["go_to"]["coordinates"][axis].as_f64().unwrap();
        let at = viola_geometry::Point2::new(cm("x") / 100.0, 10.0 - cm("y") / 100.0);
        assert_eq!(map.cells.as_ref().unwrap().at(&at), Some(Cell::Free), "{target:#}");
        assert_eq!(target["zone_cleaning"]["action"], "clean", "{target:#}");
    }
    assert_ne!(valetudo["objects"][0]["go_to"], Value::Null);

    let matter = robot(&server, &home, "format=matter").await;
    let kitchen = json!({"locationName": "Kitchen", "floorNumber": 0, "areaType": 0x2e});
    assert_eq!(matter["supportedAreas"][0]["areaInfo"]["locationInfo"], kitchen);
    assert_eq!(matter["supportedAreas"][0]["mapID"], matter["supportedMaps"][0]["mapID"]);

    let card = robot(&server, &home, "format=calibration&level=main").await;
    let picture = server.get(&format!("{home}/map/plan?format=png")).await;
    let picture = image::load_from_memory(&picture.bytes).unwrap();
    assert_eq!(card["image_px"], json!([picture.width(), picture.height()]));
    assert_eq!(card["calibration_points"].as_array().unwrap().len(), 3);
    assert_eq!(card["map_modes"][0]["predefined_selections"][0]["id"], "16");

    let path = format!("{home}/map/robot?format=nav2");
    let answer = server.get(&path).await;
    assert_eq!((answer.status, answer.header("content-type")), (200, "application/zip"));
    let mut zip = ZipArchive::new(Cursor::new(&answer.bytes)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    zip.extract(folder.path()).unwrap();
    let mut zones = String::new();
    zip.by_name("no_go_zones.json").unwrap().read_to_string(&mut zones).unwrap();
    assert!(serde_json::from_str::<Value>(&zones).unwrap()["zones"].is_array(), "{zones}");
    let read = LidarMap::open(&folder.path().join("map.yaml")).unwrap();
    let mut want = map.cells.clone().unwrap();
    want.frame.origin_m = want.frame.written_origin_m();
    assert_eq!(read.cells, Some(want));
    assert_eq!(server.get_with(&path, "if-none-match", answer.header("etag")).await.status, 304);
}

#[tokio::test]
async fn a_map_of_points_has_zones_in_metres_and_no_segments() {
    let server = start().await;
    let home = server.make_room("h").await;
    add(&server, &home, 24).await;
    list(&server, &home, "objects", |list| list["objects"] != json!([])).await;
    let valetudo = robot(&server, &home, "format=valetudo").await;
    assert_eq!((&valetudo["map"], &valetudo["map_absent"]["code"]), (&Value::Null, &json!("not_valetudo")));
    assert_eq!(
        (&valetudo["coordinates"]["unit"], &valetudo["coordinates"]["is_valetudo"]),
        (&json!("m"), &json!(false))
    );
    assert_eq!(valetudo["rooms"][0]["zone_cleaning"]["action"], "clean");
    for (query, field) in [
        ("", "format"),
        ("?format=ros", "format"),
        ("?format=nav2&level=attic", "level"),
        ("?format=nav2&revision=x", "revision"),
    ] {
        let problem = server.get(&format!("{home}/map/robot{query}")).await.problem(400, "invalid-query");
        assert_eq!(problem["field"], field, "{query}");
    }
    server.get("/v1/homes/nowhere/map/robot?format=nav2").await.problem(404, "home-not-found");
}

#[tokio::test]
async fn a_file_of_the_map_that_the_store_lost_is_a_fault_of_the_service() {
    let server = start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), room::lidar_valetudo()).await.ok(201);
    add(&server, &home, 24).await;
    list(&server, &home, "rooms", |list| list["rooms"] != json!([])).await;
    let mut files = server.blobs();
    files.retain(|path| path.to_string_lossy().contains("home-maps"));
    // The worker may rename a file of the mesh meanwhile.
    for path in &files {
        let bytes = std::fs::read(path).unwrap_or_default();
        let _ = std::fs::write(path, &bytes[..bytes.len() / 2]);
    }
    server.get(&format!("{home}/map/robot?format=calibration")).await.problem(500, "internal-error");
    for path in &files {
        let _ = std::fs::remove_file(path);
    }
    for of_map in ["rooms", "plan", "robot?format=matter", "robot?format=nav2", "robot?format=calibration"] {
        server.get(&format!("{home}/map/{of_map}")).await.problem(500, "internal-error");
    }
    patch(&server, &format!("{home}/map/rooms/16"), &json!({"name": "Hall"}))
        .await
        .problem(500, "internal-error");
}
