//! A person's choice of a clip's pose.

use crate::map::merged;
use crate::server::Server;
use reqwest::Method;
use serde_json::{Value, json};
use viola::jobs::{self, align_clip};
use viola_align::{AlignmentState, Alternative};
use viola_geometry::{LevelName, Pose2};
use viola_home::{MAP_VOXEL_M, read_cloud_ply};
use viola_testing::client::{Answer, id_of};
use viola_testing::{eventually, room};

/// Runs the real method, then turns its answer into one of two poses. The second one is above a floor that lies 0.3 m lower.
const OF_TWO_MINDS: jobs::Method = |clip, map, params, progress| {
    let mut finished = align_clip(clip, map, params, progress)?;
    let alternative = |x_m: f64| Alternative {
        level: LevelName::MAIN,
        map_from_clip: Pose2 { x_m, y_m: 0.5, yaw_rad: 0.25 },
        rise_m: 0.0,
        loss_m: 0.1,
        inliers: 0.9,
        free_space: None,
        misplaced: None,
        probability: Some(0.5),
        evidence: None,
    };
    finished.alignment.state = AlignmentState::Ambiguous;
    finished.alignment.alternatives = vec![alternative(1.0), Alternative { rise_m: 0.3, ..alternative(2.0) }];
    Ok(finished)
};

/// Starts a server whose one clip is settled with two alternatives; returns it and the clip's path.
async fn settled() -> (Server, String) {
    let server = Server::with(|params| params.worker.method = OF_TWO_MINDS).await;
    let home = server.make_room("h").await;
    let clip = server.film(&home, 2).await;
    assert_eq!(server.settled(&clip).await["state"], "ambiguous");
    (server, clip)
}

async fn choose(server: &Server, clip: &str, body: Value) -> Answer {
    server.send_json(Method::PUT, &format!("{clip}/alignment"), &body).await
}

#[tokio::test]
async fn a_choice_is_carried_over_to_a_new_lidar_map() {
    let (server, path) = settled().await;
    choose(&server, &path, json!({"alternative": 1})).await.ok(200);
    let home = server.get(&path).await.ok(200)["home"].as_str().unwrap().to_owned();
    let map = format!("/v1/homes/{home}/lidar-map");
    // Turned by a quarter, and moved: (2, 0.5) lies at (2.5, 3) there.
    let put = server.put(&map, room::lidar_csv_moved(|x, y| [3.0 - y, x + 1.0])).await.ok(201);
    let from = &put["from_earlier"];
    let off = |pose: &Value, name: &str, wanted: f64| (pose[name].as_f64().unwrap() - wanted).abs();
    let frame = &from["map_from_earlier"];
    assert_eq!(from["revision"], 1);
    assert!(off(frame, "x_m", 3.0) < 0.03 && off(frame, "y_m", 1.0) < 0.03, "{put:#}");
    assert!(off(frame, "yaw_rad", std::f64::consts::FRAC_PI_2) < 0.01, "{put:#}");
    let clip = server.settled(&path).await;
    let reasons = clip["reasons"].as_array().unwrap().iter();
    let codes: Vec<&str> = reasons.filter_map(|reason| reason["code"].as_str()).collect();
    assert_eq!((&clip["state"], codes), (&json!("aligned"), vec!["chosen_by_person", "choice_carried_over"]));
    let choice = &clip["choice"];
    assert_eq!((&choice["lidar_map_revision"], &choice["carried_from"]), (&json!(2), &json!(1)));
    let pose = &choice["map_from_clip"];
    assert!(off(pose, "x_m", 2.5) < 0.05 && off(pose, "y_m", 3.0) < 0.05, "{choice:#}");
    assert!(off(pose, "yaw_rad", std::f64::consts::FRAC_PI_2 + 0.25) < 0.01, "{choice:#}");
    // Back to the first frame with the first file.
    let restored =
        server.post(&format!("/v1/homes/{home}/lidar-maps/main/revisions/1/restore"), "").await.ok(201);
    assert_eq!((&restored["revision"], &restored["from_earlier"]["revision"]), (&json!(3), &json!(2)));
    let back = server.settled(&path).await["choice"].clone();
    assert!(off(&back["map_from_clip"], "x_m", 2.0) < 0.05 && off(&back["map_from_clip"], "y_m", 0.5) < 0.05);
    assert_eq!(back["carried_from"], 1);
    // Another home's map tells nothing: the choice stays as it is, and the clip says so.
    let put = server.put(&map, "x,y\n0,0\n0.5,9\n7,0.3\n7.7,9.4\n3,4\n").await.ok(201);
    assert_eq!(put["from_earlier"], Value::Null);
    let clip = server.settled(&path).await;
    assert_eq!(
        (&clip["reasons"][1]["code"], &clip["choice"]),
        (&json!("choice_of_earlier_lidar_map"), &back)
    );
}

#[tokio::test]
async fn an_earlier_map_leaves_out_no_clip_that_it_has() {
    let (server, path) = settled().await;
    let (home, _) = path.split_once("/clips/").unwrap();
    let id = id_of(&path);
    assert_eq!(merged(&server, home, &[]).await["left_out"][0]["clip"], id);
    choose(&server, &path, json!({"alternative": 1})).await.ok(200);
    let with = merged(&server, home, &[&path]).await;
    assert_eq!(with["left_out"], json!([]));
    server.delete(&format!("{path}/alignment")).await.ok(200);
    assert_eq!(merged(&server, home, &[]).await["left_out"][0]["clip"], id);
    let earlier = server.get(&format!("{home}/map?revision={}", with["revision"])).await.ok(200);
    assert_eq!((&earlier["clips"], &earlier["left_out"]), (&with["clips"], &json!([])));
}

#[tokio::test]
async fn a_chosen_alternative_keeps_its_floor() {
    let (server, path) = settled().await;
    let listed = server.get(&path).await.ok(200)["alignment"]["alternatives"].clone();
    assert_eq!((&listed[0]["rise_m"], &listed[1]["rise_m"]), (&json!(0.0), &json!(0.3)));
    let mut lowest_m = Vec::new();
    for (alternative, x_m, rise_m) in [(0, 1.0, 0.0), (1, 2.0, 0.3)] {
        choose(&server, &path, json!({"alternative": alternative})).await.ok(200);
        let placement = eventually("the clip is placed", || async {
            let placement = server.get(&path).await.ok(200)["placement"].clone();
            (placement["map_from_clip"]["x_m"] == x_m).then_some(placement)
        })
        .await;
        assert!((placement["rise_m"].as_f64().unwrap() - rise_m).abs() < 1e-9, "{placement:#}");
        let file = server.get(&format!("{path}/cloud.ply")).await.bytes;
        let cloud = read_cloud_ply(&file, MAP_VOXEL_M).unwrap();
        lowest_m.push(cloud.points.iter().map(|point| point.position_m[2]).fold(f32::INFINITY, f32::min));
    }
    assert!((lowest_m[1] - lowest_m[0] - 0.3).abs() < 1e-4, "{lowest_m:?}");
}

#[tokio::test]
async fn a_person_decides_where_the_method_could_not() {
    let (server, path) = settled().await;
    let own = server.get(&path).await.ok(200);
    let chosen = choose(&server, &path, json!({"alternative": 1})).await.ok(200);
    assert_eq!(
        (&chosen["state"], &chosen["reasons"][0]["code"]),
        (&json!("aligned"), &json!("chosen_by_person"))
    );
    let second = json!({"x_m": 2.0, "y_m": 0.5, "yaw_rad": 0.25});
    assert_eq!(chosen["choice"]["map_from_clip"], second);
    assert_eq!(
        (&chosen["choice"]["alternative"], &chosen["choice"]["lidar_map_revision"]),
        (&json!(1), &json!(1))
    );
    assert!(chosen["choice"]["chosen_at"].is_string());
    assert_eq!(chosen["alignment"], own["alignment"]);
    assert_eq!(choose(&server, &path, json!({"alternative": 1})).await.ok(200), chosen);
    assert_eq!(server.get(&path).await.ok(200)["choice"], chosen["choice"]);

    // It stays through a new alignment, and is withdrawn.
    server.post(&format!("{path}/align"), "").await.ok(202);
    let again = server.settled(&path).await;
    assert_eq!((&again["state"], &again["choice"]), (&json!("aligned"), &chosen["choice"]));
    assert_eq!(again["alignment"]["state"], "ambiguous");
    let own_pose = json!({"map_from_clip": {"x_m": -1.5, "y_m": 2, "yaw_rad": 3}});
    let moved = choose(&server, &path, own_pose).await.ok(200);
    assert_eq!(moved["choice"]["map_from_clip"], json!({"x_m": -1.5, "y_m": 2.0, "yaw_rad": 3.0}));
    assert_eq!(moved["choice"]["alternative"], Value::Null);
    let withdrawn = server.delete(&format!("{path}/alignment")).await.ok(200);
    assert_eq!((&withdrawn["state"], &withdrawn["choice"]), (&json!("ambiguous"), &Value::Null));
    assert_eq!(withdrawn["reasons"], withdrawn["alignment"]["reasons"]);
    assert_eq!(server.delete(&format!("{path}/alignment")).await.ok(200)["state"], "ambiguous");
}

#[tokio::test]
async fn choices_that_are_refused() {
    let (server, path) = settled().await;
    let pose = |x_m: Value, y_m: Value, yaw_rad: Value| json!({"map_from_clip": {"x_m": x_m, "y_m": y_m, "yaw_rad": yaw_rad}});
    let zero = || json!(0);
    let cases = [
        (json!({"alternative": 2}), Some("alternative")),
        (json!({"alternative": -1}), Some("alternative")),
        (json!({"alternative": 0.5}), Some("alternative")),
        (json!({"alternative": "0"}), Some("alternative")),
        (json!({"alternative": u64::MAX}), Some("alternative")),
        (json!({"map_from_clip": [1, 2, 3]}), Some("map_from_clip")),
        (json!({"map_from_clip": {"x_m": 1, "y_m": 2}}), Some("map_from_clip.yaw_rad")),
        (json!({"map_from_clip": {"x_m": 1, "y_m": 2, "yaw_rad": 0, "z_m": 0}}), Some("map_from_clip")),
        (pose(json!(1000), zero(), zero()), Some("map_from_clip.x_m")),
        (pose(zero(), json!(-1e300), zero()), Some("map_from_clip.y_m")),
        (pose(json!("1"), zero(), zero()), Some("map_from_clip.x_m")),
        (pose(zero(), Value::Null, zero()), Some("map_from_clip.y_m")),
        (pose(zero(), zero(), json!(90)), Some("map_from_clip.yaw_rad")),
        (json!({"alternative": 0, "map_from_clip": {"x_m": 0, "y_m": 0, "yaw_rad": 0}}), None),
        (json!({}), None),
        (json!({"alternative": null}), Some("alternative")),
        (json!({"alternativ": 0}), Some("alternativ")),
    ];
    let before = server.get(&path).await.ok(200);
    for (body, field) in cases {
        println!("{body}");
        let problem = choose(&server, &path, body).await.problem(422, "invalid-body");
        assert_eq!(problem["field"].as_str(), field);
    }
    server.put(&format!("{path}/alignment"), "").await.problem(422, "invalid-body");
    assert_eq!(server.get(&path).await.ok(200), before);
}

#[tokio::test]
async fn what_a_clip_without_an_answer_can_be_told() {
    let server = Server::without_workers().await;
    let home = server.make_home("h").await;
    let path = server.film(&home, 2).await;
    let origin = || json!({"map_from_clip": {"x_m": 2, "y_m": 0, "yaw_rad": 0}});
    choose(&server, &path, json!({"alternative": 0})).await.problem(409, "no-lidar-map");
    choose(&server, &path, origin()).await.problem(409, "no-lidar-map");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    choose(&server, &path, json!({"alternative": 0})).await.problem(409, "no-answer-yet");
    let chosen = choose(&server, &path, origin()).await.ok(200);
    assert_eq!(
        (&chosen["state"], &chosen["choice"]["map_from_clip"]["x_m"]),
        (&json!("queued"), &json!(2.0))
    );
    let other = server.make_home("other").await;
    let elsewhere = path.replace(&home, &other);
    choose(&server, &elsewhere, origin()).await.problem(404, "clip-not-found");
    server.delete(&format!("{elsewhere}/alignment")).await.problem(404, "clip-not-found");
    server
        .delete("/v1/homes/none/clips/01a1f766-7a97-7747-9dbb-391e0eeccb64/alignment")
        .await
        .problem(404, "home-not-found");
}
