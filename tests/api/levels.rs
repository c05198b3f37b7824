//! Homes with a LiDAR map for each storey.

use crate::corrections;
use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use viola_testing::{eventually, room, until};

/// Returns points along the walls of a room of 3 x 2 m, which is not that of the clips.
pub fn small_room_csv() -> String {
    let mut text = String::from("x,y\n");
    for step in 0..150 {
        let x = 0.02 * f64::from(step);
        text += &format!("{x:.2},0.00\n{x:.2},2.00\n");
    }
    for step in 0..100 {
        let y = 0.02 * f64::from(step);
        text += &format!("0.00,{y:.2}\n3.00,{y:.2}\n");
    }
    text
}

#[tokio::test]
async fn each_level_has_a_map_of_its_own() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    let maps = format!("{home}/lidar-maps");
    assert_eq!(server.get(&maps).await.ok(200), json!({"items": []}));
    let missing = server.get(&format!("{maps}/upper")).await.problem(404, "lidar-map-not-found");
    assert!(missing["detail"].as_str().unwrap().contains("/lidar-maps lists those that it has"), "{missing}");
    server.get(&format!("{maps}/upper/revisions")).await.problem(404, "lidar-map-not-found");
    assert_eq!(server.get(&format!("{maps}/main/revisions")).await.ok(200)["items"], json!([]));
    server.get("/v1/homes/none/lidar-maps").await.problem(404, "home-not-found");

    let main = server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    assert_eq!((&main["level"], &main["revision"]), (&json!("main"), &json!(1)));
    // The older route is the level `main`.
    assert_eq!(server.put(&format!("{maps}/main"), room::lidar_csv()).await.ok(200), main);
    let upper = server.put(&format!("{maps}/upper"), small_room_csv()).await.ok(201);
    assert_eq!((&upper["level"], &upper["revision"]), (&json!("upper"), &json!(2)));
    let listed = server.get(&maps).await.ok(200);
    let levels: Vec<&Value> = listed["items"].as_array().unwrap().iter().map(|map| &map["level"]).collect();
    assert_eq!(levels, ["main", "upper"]);
    for (path, level) in [("lidar-map", "main"), ("lidar-maps/main", "main"), ("lidar-maps/upper", "upper")] {
        let path = format!("{home}/{path}");
        let current = server.get(&path).await.ok(200);
        assert!(
            current["level"] == level && listed["items"].as_array().unwrap().contains(&current),
            "{path}"
        );
        assert_eq!(server.get(&format!("{path}/image.png")).await.header("content-type"), "image/png");
        let revisions = server.get(&format!("{path}/revisions")).await.ok(200);
        assert_eq!(revisions["items"].as_array().unwrap().len(), 1, "{path}");
    }

    for bad in ["Upper", "a%20b", "..%2Fmain", "%C3%A9", &"a".repeat(33)] {
        let problem =
            server.put(&format!("{maps}/{bad}"), small_room_csv()).await.problem(400, "invalid-path");
        assert_eq!(problem["field"], "level", "{bad}");
    }
    for n in 0..6 {
        server.put(&format!("{maps}/level-{n}"), small_room_csv()).await.ok(201);
    }
    // A dry run answers as the upload would.
    for query in ["", "?dry_run=true"] {
        let ninth = server.put(&format!("{maps}/ninth{query}"), small_room_csv()).await;
        ninth.problem(409, "too-many-levels");
    }
    server.put(&format!("{maps}/upper?dry_run=true"), room::lidar_csv()).await.ok(200);
}

#[tokio::test]
async fn a_home_without_the_level_main_shows_another_one() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let picture = format!("{home}/lidar-map/image.png");
    let missing = async |path: &str| {
        let problem = server.get(&format!("{home}/{path}")).await.problem(404, "lidar-map-not-found");
        problem["detail"].as_str().unwrap().to_owned()
    };
    assert!(missing("lidar-map/image.png").await.contains("PUT .../lidar-map sends one"));
    server.put(&format!("{home}/lidar-maps/upper"), room::lidar_csv()).await.ok(201);
    server.put(&format!("{home}/lidar-maps/attic"), small_room_csv()).await.ok(201);
    let attic = server.get(&format!("{home}/lidar-maps/attic/image.png")).await;
    let shown = server.get(&picture).await;
    assert_eq!((shown.status, shown.header("etag")), (200, attic.header("etag")));
    assert!(shown.bytes == attic.bytes, "the first level by name is shown");
    for path in ["lidar-map", "lidar-maps/main", "lidar-maps/cellar/image.png", "lidar-maps/cellar/revisions"]
    {
        let detail = missing(path).await;
        assert!(detail.ends_with("it has those of attic, upper"), "{path}: {detail}");
    }
}

/// Starts a server with a home whose clip was recorded on the level `upper`; returns both paths and the clip.
async fn aligned_upstairs() -> (Server, String, String, Value) {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), small_room_csv()).await.ok(201);
    server.put(&format!("{home}/lidar-maps/upper"), room::lidar_csv()).await.ok(201);
    let path = server.film(&home, 24).await;
    let clip = server.settled(&path).await;
    (server, home, path, clip)
}

/// Returns the clip once it is in the map.
async fn placed(server: &Server, path: &str) -> Value {
    eventually("the clip is in the map", || async {
        let clip = server.get(path).await.ok(200);
        (!clip["placement"].is_null()).then_some(clip)
    })
    .await
}

#[tokio::test]
async fn a_clip_is_aligned_to_the_level_where_it_was_recorded() {
    let (server, home, path, clip) = aligned_upstairs().await;
    assert_eq!((&clip["state"], &clip["alignment"]["level"]), (&json!("aligned"), &json!("upper")));
    assert_eq!(clip["alignment"]["alternatives"][0]["level"], "upper");
    let overlay = server.get(&format!("{path}/overlay.png")).await;
    assert_eq!((overlay.status, overlay.header("content-type")), (200, "image/png"));

    assert_eq!(placed(&server, &path).await["placement"]["level"], "upper");
    let map = server.get(&format!("{home}/map")).await.ok(200);
    assert_eq!(map["clips"][0]["level"], "upper");
    let levels = map["levels"].as_array().unwrap();
    let points: Vec<(&Value, &Value, u64)> = levels
        .iter()
        .map(|level| {
            (&level["level"], &level["lidar_map_revision"], level["info"]["points"].as_u64().unwrap())
        })
        .collect();
    assert_eq!(
        (points[0], (points[1].0, points[1].1)),
        ((&json!("main"), &json!(1), 0), (&json!("upper"), &json!(2)))
    );
    assert!(points[1].2 > 1000 && map["info"]["points"] == points[1].2, "{points:?}");

    // Each level has its own points, plan and coverage.
    let head = async |level: &str| {
        let answer = server.get(&format!("{home}/map/points?level={level}")).await;
        String::from_utf8_lossy(&answer.bytes[..200]).into_owned()
    };
    assert!(head("main").await.contains("element vertex 0\n"));
    assert!(head("upper").await.contains(&format!("element vertex {}\n", points[1].2)));
    let plan = async |query: &str| server.get(&format!("{home}/map/plan{query}")).await;
    let (main, upper) = (plan("?level=main").await, plan("?level=upper").await);
    assert_eq!((main.status, upper.status), (200, 200));
    assert_ne!(main.bytes, upper.bytes);
    assert_eq!(plan("").await.bytes, main.bytes, "the default is the level main");
    assert!(main.header("etag") != upper.header("etag"));
    let seen = async |level: &str| {
        server.get(&format!("{home}/map/coverage?level={level}")).await.ok(200)["seen"].as_f64().unwrap()
    };
    assert!(seen("main").await == 0.0 && seen("upper").await > 0.5);
    for what in ["points", "plan", "coverage", "rooms", "objects"] {
        let problem =
            server.get(&format!("{home}/map/{what}?level=attic")).await.problem(400, "invalid-query");
        assert_eq!(problem["field"], "level", "{what}");
    }
    // Rooms and objects name their level; their ids are unique in the home.
    let rooms = server.get(&format!("{home}/map/rooms")).await.ok(200)["rooms"].clone();
    for room in rooms.as_array().unwrap() {
        let (id, level) = (room["id"].as_str().unwrap(), room["level"].as_str().unwrap());
        assert_eq!(id.starts_with("upper~"), level == "upper", "{id} {level}");
    }
    let of_main = server.get(&format!("{home}/map/rooms?level=main")).await.ok(200)["rooms"].clone();
    assert!(of_main.as_array().unwrap().iter().all(|room| room["level"] == "main"));
}

#[tokio::test]
async fn a_plan_tells_its_level_and_its_home() {
    let (server, home, path, _) = aligned_upstairs().await;
    placed(&server, &path).await;
    let plan = async |query: &str| server.get(&format!("{home}/map/plan?{query}")).await;
    let title = async |level: &str| {
        let svg = String::from_utf8(plan(&format!("level={level}")).await.bytes).unwrap();
        let (_, title) = svg.split_once("<title>").unwrap();
        title.split_once("</title>").unwrap().0.to_owned()
    };
    assert_eq!(title("main").await, "Floor plan");
    assert_eq!(title("upper").await, "Floor plan, upper");
    for (query, end) in [("level=upper&format=dxf", "-plan-upper.dxf\""), ("format=png", "-plan.png\"")] {
        let plan = plan(query).await;
        let name = plan.header("content-disposition");
        assert!(name.starts_with("inline; filename=\"h-") && name.ends_with(end), "{name}");
    }
    // Plans with the home's new name follow.
    let rename =
        async |name: Value| server.send_json(Method::PUT, &home, &json!({"name": name})).await.ok(200);
    rename(json!("Elm & Co")).await;
    until("the plans have the name of the home", async || {
        title("upper").await == "Floor plan, upper: Elm &amp; Co"
    })
    .await;
    assert_eq!(title("main").await, "Floor plan: Elm &amp; Co");
    rename(Value::Null).await;
    until("the plans have no name", async || title("main").await == "Floor plan").await;
}

#[tokio::test]
async fn a_person_chooses_a_level() {
    let (server, home, path, clip) = aligned_upstairs().await;
    let alignment = format!("{path}/alignment");
    let choose = async |body: Value| server.send_json(Method::PUT, &alignment, &body).await;
    let pose = json!({"x_m": 1.0, "y_m": 1.0, "yaw_rad": 0.5});
    let chosen = choose(json!({"map_from_clip": pose, "level": "main"})).await.ok(200);
    assert_eq!(
        (&chosen["choice"]["level"], &chosen["choice"]["lidar_map_revision"]),
        (&json!("main"), &json!(1))
    );
    let placed = eventually("the clip is on its level", || async {
        let map = server.get(&format!("{home}/map")).await;
        let map = (map.status == 200).then(|| map.json())?;
        (map["clips"][0]["level"] == "main").then_some(map)
    })
    .await;
    assert_eq!(placed["levels"][1]["info"]["points"], 0, "it left the other level");
    let chosen = choose(json!({"alternative": 0})).await.ok(200);
    assert_eq!(chosen["choice"]["level"], clip["alignment"]["alternatives"][0]["level"]);
    for (body, field) in [
        (json!({"map_from_clip": pose, "level": "attic"}), "level"),
        (json!({"map_from_clip": pose, "level": "No"}), "level"),
        (json!({"map_from_clip": pose, "level": 1}), "level"),
        (json!({"alternative": 0, "level": "main"}), "level"),
    ] {
        let problem = choose(body).await.problem(422, "invalid-body");
        assert_eq!(problem["field"], field);
    }
}

#[tokio::test]
async fn the_objects_of_a_removed_level_are_lost() {
    let server = corrections::start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), small_room_csv()).await.ok(201);
    let upper = format!("{home}/lidar-maps/upper");
    server.put(&upper, room::lidar_csv()).await.ok(201);
    corrections::add(&server, &home, 24).await;
    let is_furnished = |list: &Value| list["objects"][0]["level"] == "upper";
    let before = corrections::list(&server, &home, "objects", is_furnished).await;
    server.delete(&upper).await.ok(204);
    let is_without = |list: &Value| {
        let is_later = list["revision"].as_i64() > before["revision"].as_i64();
        is_later && list["rooms"].as_array().unwrap().iter().all(|room| room["level"] == "main")
    };
    let after = corrections::list(&server, &home, "rooms", is_without).await;
    // The earlier revision is kept, and the LiDAR map of which robots' files are made is not.
    let earlier = format!("level=upper&revision={}", before["revision"]);
    assert_eq!(server.get(&format!("{home}/map/plan?{earlier}")).await.status, 200);
    let robot = server.get(&format!("{home}/map/robot?format=nav2&{earlier}")).await;
    robot.problem(404, "lidar-map-not-found");
    let changes = format!("{home}/map/changes?from={}&to={}", before["revision"], after["revision"]);
    let lost = server.get(&changes).await.ok(200)["lost"].clone();
    let lost: Vec<&Value> = lost.as_array().unwrap().iter().map(|lost| &lost["object"]).collect();
    assert_eq!(lost, before["objects"].as_array().unwrap().iter().collect::<Vec<_>>());
}
