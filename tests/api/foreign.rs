//! The files of a home in the readers of other programs (`tests/foreign`), which compare them with the truth.
//!
//! `VIOLA_FOREIGN_READERS` is a Python with the packages of `tests/foreign/requirements.txt`; else the test is skipped.

use crate::levels::small_room_csv;
use crate::map::merged;
use crate::server::Server;
use serde_json::json;
use std::ffi::OsStr;
use std::process::Command;
use viola_testing::process::succeed;
use viola_testing::room;

/// Each file with its path below the home.
const FILES: [(&str, &str); 22] = [
    ("map.json", "map"),
    ("objects.json", "map/objects"),
    ("points.ply", "map/points"),
    ("points.glb", "map/points?format=glb"),
    ("points.e57", "map/points?format=e57"),
    ("points.laz", "map/points?format=laz"),
    ("empty.e57", "map/points?format=e57&classes=animal"),
    ("empty.laz", "map/points?format=laz&classes=animal"),
    ("mesh.glb", "map/mesh?format=glb"),
    ("mesh.usdz", "map/mesh?format=usdz"),
    ("mesh.obj", "map/mesh?format=obj"),
    ("plan.svg", "map/plan?format=svg"),
    ("plan.png", "map/plan?format=png"),
    ("plan.pdf", "map/plan?format=pdf"),
    ("plan.dxf", "map/plan?format=dxf"),
    ("plan.geojson", "map/plan?format=geojson"),
    ("plan.json", "map/plan?format=json"),
    ("home.mcap", "map/recording"),
    ("nav2.zip", "map/robot?format=nav2"),
    ("valetudo.json", "map/robot?format=valetudo"),
    ("calibration.json", "map/robot?format=calibration"),
    ("matter.json", MATTER),
];
/// The areas of all levels.
const MATTER: &str = "map/robot?format=matter";
/// Files that a reader opens, each of which it tells about in a line.
const READ: usize = 17;

/// Makes a home whose clip is on a level, and checks this level's files. The LiDAR map of `main` is another one if the
/// clip is on another level.
async fn check_level(python: &OsStr, level: &str) {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    if level != "main" {
        server.put(&format!("{home}/lidar-map"), small_room_csv()).await.ok(201);
    }
    server.put(&format!("{home}/lidar-maps/{level}"), room::lidar_csv()).await.ok(201);
    let clip = server.film(&home, 24).await;
    merged(&server, &home, &[&clip]).await;

    let folder = tempfile::tempdir().unwrap();
    for (name, path) in FILES {
        let answer = match (path, path.contains('?')) {
            // These are of all levels.
            ("map" | "map/objects" | MATTER, _) => server.get(&format!("{home}/{path}")).await,
            (_, true) => server.get(&format!("{home}/{path}&level={level}")).await,
            (_, false) => server.get(&format!("{home}/{path}?level={level}")).await,
        };
        assert_eq!(answer.status, 200, "{name}");
        std::fs::write(folder.path().join(name), answer.bytes).unwrap();
    }
    std::fs::write(folder.path().join("classes.json"), server.get("/v1/classes").await.bytes).unwrap();
    let (x_m, y_m, yaw_rad) = room::MAP_FROM_ROOM;
    let truth = json!({
        "map_from_room": [x_m, y_m, yaw_rad],
        "size_m": room::SIZE_M,
        "camera_circle": { "centre_m": room::CIRCLE_M, "radius_m": room::RADIUS_M, "height_m": room::CAMERA_HEIGHT_M },
    });
    std::fs::write(folder.path().join("truth.json"), truth.to_string()).unwrap();

    let check = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/foreign/check.py");
    let mut command = Command::new(python);
    let said = succeed(command.arg("-B").arg(check).args(["--level", level]).arg(folder.path()));
    print!("{said}");
    assert_eq!(said.lines().count(), READ, "{said}");
}

#[tokio::test]
async fn readers_of_other_programs_find_the_home_in_its_files() {
    let Some(python) = std::env::var_os("VIOLA_FOREIGN_READERS") else {
        let switch =
            "set VIOLA_FOREIGN_READERS to a Python with the packages of tests/foreign/requirements.txt";
        viola_testing::skipped("readers of other programs", switch);
        return;
    };
    for level in ["main", "upper"] {
        check_level(&python, level).await;
    }
}

#[tokio::test]
async fn made_files_have_a_type_a_length_a_name_and_a_tag() {
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.get(&format!("{home}/map/recording")).await.problem(404, "map-not-found");
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.film(&home, 24).await;
    merged(&server, &home, &[&clip]).await;
    // The first bytes are those of the formats' specifications.
    for (path, media_type, name, begin) in [
        ("map/points?format=e57", "model/e57", "points.e57", &b"ASTM-E57"[..]),
        ("map/points?format=laz", "application/vnd.laszip", "points.laz", b"LASF"),
        ("map/recording", "application/vnd.mcap", "recording.mcap", b"\x89MCAP0\r\n"),
        ("map/recording?format=mcap&level=main", "application/vnd.mcap", "recording.mcap", b"\x89MCAP0\r\n"),
    ] {
        let path = format!("{home}/{path}");
        let answer = server.get(&path).await;
        assert_eq!((answer.status, answer.header("content-type")), (200, media_type), "{path}");
        assert!(answer.bytes.starts_with(begin), "{path}");
        assert_eq!(answer.header("content-length"), answer.bytes.len().to_string(), "{path}");
        assert!(answer.header("content-disposition").ends_with(&format!("-{name}\"")), "{path}");
        let known = server.get_with(&path, "if-none-match", answer.header("etag")).await;
        assert_eq!(known.status, 304, "{path}");
        assert!(server.get(&path).await.bytes == answer.bytes, "{path}: other bytes");
    }
    // A recording has the cameras of the clips' present results.
    let revision = server.get(&format!("{home}/map")).await.ok(200)["revision"].to_string();
    let recording = format!("{home}/map/recording?revision={revision}");
    let tag = server.get(&recording).await.header("etag").to_owned();
    server.post(&format!("{clip}/align"), "").await.ok(202);
    server.settled(&clip).await;
    assert_eq!(server.get_with(&recording, "if-none-match", &tag).await.status, 200);
    let accepted = server.get_with(&format!("{home}/map/points"), "accept", "text/x, model/e57;q=1").await;
    assert_eq!(accepted.header("content-type"), "model/e57");
    for path in ["map/recording?format=bag", "map/recording?level=attic", "map/points?format=las"] {
        server.get(&format!("{home}/{path}")).await.problem(400, "invalid-query");
    }
}
