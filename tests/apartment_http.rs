//! The main job as the README's tour does it: the real apartment as a zip and its robot's map go in over
//! HTTP, the pose comes out. With the real binary, whose memory is looked at.

mod common;
mod real;

use common::process::Process;
use common::zips;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use viola::evaluate::Scene;
use viola::geometry::{Pose2, angle_between};

fn excerpt(scene: &Path, frames: std::ops::Range<u32>) -> Vec<u8> {
    let read = |name: String| (name.clone(), fs::read(scene.join(&name)).unwrap());
    let mut files: zips::Files = ["intrinsic_color", "intrinsic_depth"]
        .map(|name| read(format!("intrinsic/{name}.txt")))
        .into_iter()
        .collect();
    for i in frames {
        files.extend([format!("color/{i}.jpg"), format!("depth/{i}.png"), format!("pose/{i}.txt")].map(read));
    }
    zips::zip(&files)
}

#[tokio::test]
async fn an_excerpt_finds_its_place() {
    let Some(scene) = real::data("scannet/scene0000_00") else { return };
    let lidar = scene.join("lidar/valetudo.json");
    let truth = Scene::open(&scene, &lidar, &scene.join("lidar/ground_truth_valetudo.json")).unwrap();
    let truth = truth.map_from_clip(120).unwrap();

    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &[]);
    let client = &server.client;
    let home = client.make_home("apartment").await;
    let map = client.put(&format!("{home}/lidar-map"), fs::read(&lidar).unwrap()).await.ok(201);
    assert_eq!(map["info"]["format"], "valetudo");
    let answer = client.post(&format!("{home}/clips"), excerpt(&scene, 120..180)).await;
    let path = answer.header("location").to_owned();
    let clip = answer.ok(201);
    assert_eq!((&clip["info"]["layout"], &clip["info"]["frames"]), (&"scannet".into(), &60.into()));

    let clip = client.settled(&path).await;
    assert_eq!(clip["state"], "aligned", "{clip:#}");
    let pose: Pose2 = serde_json::from_value(clip["alignment"]["map_from_clip"].clone()).unwrap();
    assert!(pose.distance_m(&truth) < 0.1, "{pose:?} is not {truth:?}");
    assert!(angle_between(pose.yaw_rad, truth.yaw_rad) < 3f64.to_radians(), "{pose:?} is not {truth:?}");
    assert!(client.get(&format!("{path}/overlay.png")).await.bytes.starts_with(b"\x89PNG"));
    assert!(client.get(&format!("{path}/cloud.ply")).await.bytes.starts_with(b"ply\n"));
    if let Some(peak_mib) = server.peak_mib() {
        assert!(peak_mib < 700, "{peak_mib} MiB");
    }
}
