//! The files of a home in the readers of other programs (`tests/foreign`), which compare them with the truth.
//!
//! `VIOLA_FOREIGN_READERS` is a Python with the packages of `tests/foreign/requirements.txt`; else the test is skipped.

use crate::map::merged;
use crate::server::Server;
use serde_json::json;
use std::process::Command;
use viola_testing::{room, zips};

/// Each file with its path below the home.
const FILES: [(&str, &str); 15] = [
    ("map.json", "map"),
    ("objects.json", "map/objects"),
    ("points.ply", "map/points"),
    ("points.glb", "map/points?format=glb"),
    ("points.e57", "map/points?format=e57"),
    ("points.laz", "map/points?format=laz"),
    ("mesh.glb", "map/mesh?format=glb"),
    ("mesh.usdz", "map/mesh?format=usdz"),
    ("mesh.obj", "map/mesh?format=obj"),
    ("plan.svg", "map/plan?format=svg"),
    ("plan.pdf", "map/plan?format=pdf"),
    ("plan.dxf", "map/plan?format=dxf"),
    ("plan.geojson", "map/plan?format=geojson"),
    ("plan.json", "map/plan?format=json"),
    ("home.mcap", "map/recording"),
];
/// Files that a reader opens, each of which it tells about in a line.
const READ: usize = 9;

#[tokio::test]
async fn readers_of_other_programs_find_the_home_in_its_files() {
    let Some(python) = std::env::var_os("VIOLA_FOREIGN_READERS") else {
        let switch =
            "set VIOLA_FOREIGN_READERS to a Python with the packages of tests/foreign/requirements.txt";
        viola_testing::skipped("readers of other programs", switch);
        return;
    };
    let server = Server::start().await;
    let home = server.make_home("h").await;
    server.put(&format!("{home}/lidar-map"), room::lidar_csv()).await.ok(201);
    let clip = server.post(&format!("{home}/clips"), zips::zip(&room::clip(24))).await.ok(201);
    merged(&server, &home, &[&clip["id"]]).await;

    let folder = tempfile::tempdir().unwrap();
    for (name, path) in FILES {
        let answer = server.get(&format!("{home}/{path}")).await;
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
    let output = Command::new(python).arg("-B").arg(check).arg(folder.path()).output().unwrap();
    let (said, erred) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}\n{erred}");
    print!("{said}");
    assert_eq!(said.lines().count(), READ, "{said}");
}
