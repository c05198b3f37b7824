//! Readers of clips and maps on the real recordings in `VIOLA_TEST_DATA`.

use std::path::PathBuf;
use std::time::Instant;
use viola::clip::Clip;
use viola::geometry::{Point2, Pose2};
use viola::lidar::LidarMap;

/// The folder of real recordings. Says so when it is absent; the test then has nothing to check.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("VIOLA_TEST_DATA").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("VIOLA_TEST_DATA is not set: the real recordings are absent, nothing was checked");
    }
    folder
}

#[test]
fn scannet_apartment_opens() {
    let Some(data) = data() else { return };
    let clip = Clip::open(&data.join("scannet/scene0000_00")).unwrap();
    let info = clip.info();
    println!("{info:#?}");
    assert_eq!((info.layout.as_str(), info.frames, info.frames_with_pose), ("scannet", 300, 300));
    assert_eq!((info.color_width, info.color_height), (648, 484));
    assert_eq!((info.depth_width, info.depth_height), (640, 480));
    assert_eq!(clip.up_in_world(), Some(viola::geometry::Vector3::z()));
    let numbers: Vec<u32> = clip.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, (0..300).collect::<Vec<_>>());
    let start = Instant::now();
    for index in 0..20 {
        let frame = clip.load(index).unwrap();
        assert!(frame.depth.depth_m.iter().all(|&d| (0.0..20.0).contains(&d)));
    }
    println!("load: {:?} a frame", start.elapsed() / 20);
}

/// Distance from each point to the nearest of the others, sorted.
fn distances_m(points: &[Point2], others: &[Point2]) -> Vec<f64> {
    let nearest = |p: &Point2| others.iter().map(|o| (o - p).norm()).fold(f64::INFINITY, f64::min);
    let mut all: Vec<f64> = points.iter().map(nearest).collect();
    all.sort_by(f64::total_cmp);
    all
}

#[test]
fn three_forms_of_the_apartment_agree() {
    let Some(data) = data() else { return };
    let folder = data.join("scannet/scene0000_00/lidar");
    let in_world = |map: &str, truth: &str| -> Vec<Point2> {
        let truth: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join(truth)).unwrap()).unwrap();
        let map_from_world: Pose2 = serde_json::from_value(truth["map_from_world"].clone()).unwrap();
        let map = LidarMap::open(&folder.join(map)).unwrap();
        println!("{map_from_world:?} {:#?}", map.info);
        map.occupied_m.iter().map(|p| map_from_world.inverse().apply(p)).collect()
    };
    let points = in_world("points.csv", "ground_truth.json");
    let ros = in_world("map.yaml", "ground_truth.json");
    let valetudo = in_world("valetudo.json", "ground_truth_valetudo.json");
    assert_eq!(points.len(), 2530);
    for (name, cells) in [("map.yaml", ros), ("valetudo.json", valetudo)] {
        // A cell of 5 cm that a point lies in has its centre at most 3.6 cm from it.
        for (direction, all) in
            [("cells", distances_m(&cells, &points)), ("points", distances_m(&points, &cells))]
        {
            let at = |share: f64| all[((all.len() - 1) as f64 * share) as usize];
            println!("{name} {direction}: median {:.3}, 99 % {:.3}, most {:.3}", at(0.5), at(0.99), at(1.0));
            assert!(at(0.5) < 0.025 && at(0.99) < 0.05, "{name} {direction}");
        }
    }
}

#[test]
fn vacuum_maps_load() {
    let Some(data) = data() else { return };
    for vendor in ["roborock", "dreame", "viomi"] {
        for entry in std::fs::read_dir(data.join("vacuum_maps").join(vendor)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "json") {
                let map = LidarMap::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                let i = &map.info;
                println!(
                    "{} {} occ {} free {:.1} m2 {:?} {:?} rooms {} charger {:?} {:?}",
                    path.display(),
                    i.format,
                    i.occupied_points,
                    i.free_area_m2,
                    i.min_m,
                    i.max_m,
                    i.rooms.len(),
                    i.charger,
                    i.notes
                );
            }
        }
    }
    let map = LidarMap::open(&data.join("vacuum_maps/ros/home.yaml")).unwrap();
    println!("{:#?}", map.info);
}

#[test]
fn other_layouts_open() {
    let Some(data) = data() else { return };
    for folder in ["seven_scenes/redkitchen", "tum/freiburg1_rpy_excerpt"] {
        let start = Instant::now();
        let clip = Clip::open(&data.join(folder)).unwrap();
        println!("{:?} {:#?}", start.elapsed(), clip.info());
        let start = Instant::now();
        for index in 0..20 {
            clip.load(index).unwrap();
        }
        println!("load: {:?} a frame", start.elapsed() / 20);
    }
}
