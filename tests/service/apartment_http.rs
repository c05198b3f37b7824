//! The main job as in the tour of docs/api.md: the real apartment as a zip and its robot's map are sent over HTTP,
//! and the pose is returned. With the real binary, whose memory is checked.

use reqwest::Method;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use viola_geometry::{Pose2, angle_between};
use viola_lab::evaluate::Scene;
use viola_testing::client::Client;
use viola_testing::process::Process;
use viola_testing::{eventually, zips};

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
    let Some(scene) = viola_testing::data::folder("scannet/scene0000_00") else { return };
    let lidar = scene.join("lidar/valetudo.json");
    let truth = Scene::open(&scene, &lidar, &scene.join("lidar/ground_truth_valetudo.json")).unwrap();
    let truth = truth.map_from_clip(120).unwrap();

    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &[]);
    let client = &server.client;
    let home = client.make_home("apartment").await;
    let map = client.put(&format!("{home}/lidar-map"), fs::read(&lidar).unwrap()).await.ok(201);
    assert_eq!(map["info"]["format"], "valetudo");
    let path = client.add_clip(&home, excerpt(&scene, 120..180)).await;
    let clip = client.get(&path).await.ok(200);
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

/// Returns eight excerpts of 40 frames that cover all 300: neighbours share a few frames.
fn eight() -> Vec<std::ops::Range<u32>> {
    (0..8u32).map(|i| (i * 260 / 7)..(i * 260 / 7 + 40)).collect()
}

/// Returns the home's map once it contains `clips` clips, without ids and times, and its points.
async fn map_of(client: &Client, home: &str, clips: usize) -> (Value, Vec<u8>) {
    let map = eventually("the map is merged", || async {
        let answer = client.get(&format!("{home}/map")).await;
        let map = (answer.status == 200).then(|| answer.json())?;
        (map["clips"].as_array().unwrap().len() == clips && map["left_out"] == serde_json::json!([]))
            .then_some(map)
    })
    .await;
    let mut poses = map["clips"].clone();
    poses.as_array_mut().unwrap().iter_mut().for_each(|clip| {
        clip.as_object_mut().unwrap().remove("clip");
    });
    let told = serde_json::json!({ "clips": poses, "info": map["info"] });
    (told, client.get(&format!("{home}/map/points")).await.bytes)
}

/// Keeps pictures for people, beside those of the browser's test; they are never part of the repository.
async fn keep_pictures(client: &Client, home: &str) {
    let folder = std::env::var_os("VIOLA_ARTIFACTS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("target"), PathBuf::from)
        .join("apartment");
    fs::create_dir_all(&folder).unwrap();
    for (query, name, start) in [
        ("png", "plan.png", &b"\x89PNG"[..]),
        ("svg", "plan.svg", b"<"),
        ("pdf", "plan.pdf", b"%PDF"),
        ("dxf", "plan.dxf", b"999"),
        ("geojson", "plan.geojson", b"{"),
        ("json", "plan.json", b"{"),
    ] {
        let plan = client.get(&format!("{home}/map/plan?format={query}")).await;
        assert!(plan.status == 200 && plan.bytes.starts_with(start), "{name}");
        fs::write(folder.join(name), plan.bytes).unwrap();
    }
}

/// Documents are compressed to a quarter of their size, points to a half.
async fn check_compression(client: &Client, home: &str) {
    for (path, least_ratio) in [("objects", 4), ("plan?format=geojson", 4), ("points?format=ply", 2)] {
        let path = format!("{home}/map/{path}");
        let plain = client.get(&path).await.bytes.len();
        for encoding in ["gzip", "br", "zstd"] {
            let request = client.request(Method::GET, &path).header("accept-encoding", encoding);
            let packed = client.send(request).await;
            assert_eq!(packed.header("content-encoding"), encoding, "{path}");
            let packed = packed.bytes.len();
            assert!(packed * least_ratio <= plain, "{path}, {encoding}: {packed} of {plain} bytes");
        }
    }
}

async fn add(client: &Client, home: &str, zip: &[u8]) -> String {
    let path = client.add_clip(home, zip.to_vec()).await;
    let clip = client.settled(&path).await;
    assert_eq!(clip["state"], "aligned", "{clip:#}");
    path
}

/// The map is a function of the set of clips: eight excerpts in three orders. In the first they are merged one by one, and one
/// is taken out and put back; in the others they wait for the LiDAR map.
#[tokio::test]
async fn the_order_of_clips_does_not_matter() {
    let Some(scene) = viola_testing::data::folder("scannet/scene0000_00") else { return };
    let data = TempDir::new().unwrap();
    let server = Process::serve(data.path(), &[]);
    let client = &server.client;
    let zips: Vec<Vec<u8>> = eight().into_iter().map(|frames| excerpt(&scene, frames)).collect();
    let lidar = fs::read(scene.join("lidar/valetudo.json")).unwrap();

    let home = client.make_home("one-by-one").await;
    client.put(&format!("{home}/lidar-map"), lidar.clone()).await.ok(201);
    // Three random orders.
    let mut paths = Vec::new();
    for i in [3, 0, 6, 1, 7, 5, 2, 4] {
        paths.push(add(client, &home, &zips[i]).await);
    }
    let map = map_of(client, &home, 8).await;
    assert!(map.1.len() > 1_000_000);
    keep_pictures(client, &home).await;
    check_compression(client, &home).await;
    client.delete(&paths[2]).await.ok(204);
    assert_ne!(map_of(client, &home, 7).await.1, map.1);
    add(client, &home, &zips[6]).await;
    assert!(map_of(client, &home, 8).await == map, "one taken out and put back gives another map");

    for order in [[5, 2, 7, 4, 0, 3, 6, 1], [6, 4, 1, 0, 2, 7, 3, 5]] {
        let home = client.make_home(&format!("home-{}", order[0])).await;
        for i in order {
            client.add_clip(&home, zips[i].clone()).await;
        }
        client.put(&format!("{home}/lidar-map"), lidar.clone()).await.ok(201);
        assert!(map_of(client, &home, 8).await == map, "the order of the clips shows");
    }
}
