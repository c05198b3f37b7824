//! The readers on the real recordings in `VIOLA_TEST_DATA`.

use crate::memory::peak_bytes;
use crate::writers::as_zip;
use std::path::Path;
use std::time::{Duration, Instant};
use viola_align::{AlignParams, align};
use viola_formats::clip::{Clip, Frame};
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::progress::Silent;
use viola_geometry::{Point2, Pose2, Vector3};
use viola_testing::data;

/// Returns the fraction of points of frame `a`, visible in frame `b`, with the same depth in `b`. Wrong
/// directions, axes or times of poses, a wrong unit of depth or wrong intrinsics lower it.
fn agreement(a: &Frame, b: &Frame) -> f64 {
    let b_from_a = b.header.world_from_camera.unwrap().inverse() * a.header.world_from_camera.unwrap();
    let (mut seen, mut agreed) = (0, 0);
    for y in (0..a.depth.height).step_by(8) {
        for x in (0..a.depth.width).step_by(8) {
            let depth_m = f64::from(a.depth.at(x, y));
            if depth_m == 0.0 || depth_m > 4.0 {
                continue;
            }
            let point = b_from_a * a.depth_camera.unproject(f64::from(x), f64::from(y), depth_m);
            let Some(pixel) = b.depth_camera.project(&point) else { continue };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            if u < 0.0 || v < 0.0 || u >= f64::from(b.depth.width) || v >= f64::from(b.depth.height) {
                continue;
            }
            let measured_m = f64::from(b.depth.at(u as u32, v as u32));
            if measured_m > 0.0 {
                seen += 1;
                agreed += usize::from((measured_m - point.z).abs() < 0.03 + 0.02 * point.z);
            }
        }
    }
    assert!(seen > 500, "the two frames look at different things");
    f64::from(agreed as u32) / f64::from(seen)
}

/// Opens a recording and checks its frames against each other; returns it for more.
fn check_recording(path: &Path, layout: &str, frames: usize, steps: &[(usize, usize)]) -> Clip {
    let clip = Clip::open(path).unwrap();
    let info = clip.info();
    println!("{info:#?}");
    assert_eq!((info.layout.as_str(), info.frames, info.frames_with_pose), (layout, frames, frames));
    assert_eq!((info.skipped_incomplete, info.skipped_without_pose), (0, 0));
    assert_eq!((info.depth_width, info.depth_height), (640, 480));
    let numbers: Vec<u32> = clip.frames().iter().map(|f| f.number).collect();
    assert_eq!(numbers, (0..frames as u32).collect::<Vec<_>>());
    for &(a, b) in steps {
        let share = agreement(&clip.load(a).unwrap(), &clip.load(b).unwrap());
        println!("{layout}: frames {a} and {b} agree on {:.0} % of what both see", 100.0 * share);
        assert!(share > 0.8, "{layout}: frames {a} and {b} agree on {share}");
    }
    let start = Instant::now();
    for index in 0..20 {
        clip.load(index).unwrap();
    }
    println!("{layout}: {:?} to load a frame", start.elapsed() / 20);
    clip
}

#[test]
fn scannet_apartment() {
    let Some(data) = data::root() else { return };
    let folder = data.join("scannet/scene0000_00");
    let clip = check_recording(&folder, "scannet", 300, &[(0, 1), (60, 61), (150, 151), (250, 251)]);
    assert_eq!((clip.info().color_width, clip.info().color_height), (648, 484));
    assert_eq!(clip.up_in_world().map(|up| up.direction), Some(Vector3::z()));

    let mut files = Vec::new();
    for kind in ["color", "depth", "pose", "intrinsic"] {
        for entry in std::fs::read_dir(folder.join(kind)).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("scene0000_00/{kind}/{}", path.file_name().unwrap().to_string_lossy());
            files.push((name, std::fs::read(path).unwrap()));
        }
    }
    let zip = as_zip(&files);
    let open = || {
        let start = Instant::now();
        let zipped = Clip::open(zip.path()).unwrap();
        (start.elapsed(), zipped)
    };
    // The shortest of three: other tests run beside this one.
    let (elapsed, zipped) = (0..3).map(|_| open()).min_by_key(|opened| opened.0).unwrap();
    println!("scannet: {elapsed:?} to open a zip of 300 frames");
    assert!(elapsed < Duration::from_millis(500));
    assert_eq!(zipped.info(), clip.info());
    assert_eq!(zipped.frames(), clip.frames());
    let (a, b) = (zipped.load(123).unwrap(), clip.load(123).unwrap());
    assert_eq!((a.depth, a.color), (b.depth, b.color));
}

#[test]
fn seven_scenes_kitchen() {
    let Some(data) = data::root() else { return };
    let folder = data.join("seven_scenes/redkitchen");
    let clip = check_recording(&folder, "seven_scenes", 200, &[(0, 5), (60, 70), (150, 160)]);
    assert_eq!(clip.up_in_world(), None);
}

#[test]
fn tum_desk() {
    let Some(data) = data::root() else { return };
    let folder = data.join("tum/freiburg1_rpy_excerpt");
    let clip = check_recording(&folder, "tum_rgbd", 100, &[(0, 2), (40, 42), (80, 82)]);
    // The lists' first and last depth pictures.
    assert!((clip.info().duration_s.unwrap() - 3.305_861).abs() < 1e-3);
    assert!(clip.info().notes.iter().any(|note| note.contains("assumed")));
    // The motion capture's z is up; the reader finds it by itself.
    let up = clip.up_in_world().unwrap();
    let off_rad = up.direction.angle(&Vector3::z());
    assert!(off_rad < 6f64.to_radians() && off_rad < 2.0 * up.deviation_rad, "{off_rad} {up:?}");
}

/// Its first 39 rows are at the origin, and every sixth frame has depth. The 40th row is 2e-9 m away from it.
#[test]
fn iphone_before_it_tracks() {
    let Some(folder) = data::folder("iphone_stray/second_room") else { return };
    let clip = Clip::open(&folder).unwrap();
    let without = clip.frames().iter().filter(|frame| frame.world_from_camera.is_none());
    assert_eq!(without.map(|frame| frame.number).collect::<Vec<_>>(), [0, 6, 12, 18, 24, 30, 36]);
    assert_eq!(clip.info().frames, 97);
}

/// Returns the distance from each point to the nearest of the others, sorted.
fn distances_m(points: &[Point2], others: &[Point2]) -> Vec<f64> {
    let nearest = |p: &Point2| others.iter().map(|o| (o - p).norm()).fold(f64::INFINITY, f64::min);
    let mut all: Vec<f64> = points.iter().map(nearest).collect();
    all.sort_by(f64::total_cmp);
    all
}

#[test]
fn three_forms_of_the_apartment_agree() {
    let Some(data) = data::root() else { return };
    let folder = data.join("scannet/scene0000_00/lidar");
    let in_world = |map: &str, truth: &str| -> Vec<Point2> {
        let truth: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join(truth)).unwrap()).unwrap();
        let map_from_world: Pose2 = serde_json::from_value(truth["map_from_world"].clone()).unwrap();
        let map = LidarMap::open(&folder.join(map)).unwrap();
        map.occupied_m.iter().map(|p| map_from_world.inverse().apply(p)).collect()
    };
    let points = in_world("points.csv", "ground_truth.json");
    let ros = in_world("map.yaml", "ground_truth.json");
    let valetudo = in_world("valetudo.json", "ground_truth_valetudo.json");
    assert_eq!(points.len(), 2530, "as the data's README says");
    for (name, cells) in [("map.yaml", ros), ("valetudo.json", valetudo)] {
        // The centre of a cell of 5 cm is at most 3.6 cm from a point in it.
        for (what, all) in [("cells", distances_m(&cells, &points)), ("points", distances_m(&points, &cells))]
        {
            let at = |share: f64| all[((all.len() - 1) as f64 * share) as usize];
            println!("{name} {what}: median {:.3}, 99 % {:.3}, most {:.3} m", at(0.5), at(0.99), at(1.0));
            assert!(at(0.5) < 0.025 && at(0.99) < 0.037, "{name} {what}");
        }
    }
}

#[test]
fn vacuum_maps() {
    let Some(data) = data::root() else { return };
    let mut maps = 0;
    for vendor in ["roborock", "dreame", "viomi"] {
        for entry in std::fs::read_dir(data.join("vacuum_maps").join(vendor)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "json") {
                check_valetudo(&path);
                maps += 1;
            }
        }
    }
    assert_eq!(maps, 11);
}

/// Checks a map against the statistics in its file.
fn check_valetudo(path: &Path) {
    let name = path.file_name().unwrap().to_string_lossy();
    let file: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let map = LidarMap::open(path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let info = &map.info;
    println!("{name}: {} walls, {:.1} m2, {:?}", info.occupied_points, info.free_area_m2, info.notes);
    let layers = file["layers"].as_array().unwrap();
    let count = |kind: &str| -> f64 {
        let of_kind = layers.iter().filter(|layer| layer["type"] == kind);
        of_kind.map(|layer| layer["dimensions"]["pixelCount"].as_f64().unwrap_or(0.0)).sum()
    };
    let floor = count("floor") + count("segment");
    if name.starts_with("1c_") {
        // Its 123 wall cells are not walls; 784 cells are floor and room, and 32 are floor and wall.
        assert!(info.occupied_points as f64 > 5.0 * count("wall"), "{name}: {info:?}");
        assert_eq!(info.free_cells as f64, floor - 784.0 - 32.0);
    } else {
        assert_eq!(info.occupied_points as f64, count("wall"), "{name}");
        let under_walls = floor - info.free_cells as f64;
        assert!((0.0..20.0).contains(&under_walls), "{name}: {} of {floor}", info.free_cells);
    }
    let segments = layers.iter().filter(|layer| layer["type"] == "segment");
    let names =
        segments.clone().map(|layer| layer["metaData"]["name"].as_str().filter(|name| !name.is_empty()));
    assert!(names.eq(map.rooms.iter().map(|room| room.name.as_deref())), "{name}");
    for (segment, room) in segments.zip(&info.rooms) {
        assert!((segment["metaData"]["area"].as_f64().unwrap() / 1e4 - room.area_m2).abs() < 1e-9, "{name}");
    }
    // A dock stands at a wall of the home, unless y has the wrong sign.
    let charger = map.charger.unwrap();
    let at = Point2::new(charger.x_m, charger.y_m);
    let nearest_m = distances_m(&[at], &map.occupied_m)[0];
    assert!(nearest_m < 0.6, "{name}: the charger is {nearest_m} m from any wall");
}

#[test]
fn ros_home() {
    let Some(data) = data::root() else { return };
    let map = LidarMap::open(&data.join("vacuum_maps/ros/home.yaml")).unwrap();
    println!("{:#?}", map.info);
    // As counted in the image: 0, 254, and 205, which free_thresh 0.25 would turn into floor.
    let grid = map.cells.as_ref().unwrap();
    assert_eq!((map.info.occupied_points, map.info.free_cells), (5_183, 35_949));
    assert!(grid.cells.iter().filter(|cell| **cell == Cell::Unknown).count() <= 76_243);
    assert!(map.info.notes.iter().any(|note| note.contains("205")));
}

/// Five times the frames take little more memory, and both take little.
#[test]
fn memory_of_300_frames_is_bounded() {
    let Some(folder) = data::folder("scannet/scene0000_00") else { return };
    let (clip, lidar) =
        (Clip::open(&folder).unwrap(), LidarMap::open(&folder.join("lidar/valetudo.json")).unwrap());
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let peak_mib = |frames| {
        let work = || align(&clip, Some(frames), &lidar, &AlignParams::default(), &Silent).unwrap();
        alone.install(|| peak_bytes(work)).1 >> 20
    };
    let (short, long) = (peak_mib(120..180), peak_mib(0..300));
    eprintln!("60 frames: {short} MiB, 300 frames: {long} MiB");
    assert!(short <= 50 && long <= 75, "60 frames: {short} MiB, 300 frames: {long} MiB");
}
