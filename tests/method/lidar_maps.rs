//! An earlier LiDAR map registered to a later one: maps of real robots, and simulated homes.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::path::PathBuf;
use viola_align::later_from_earlier;
use viola_formats::lidar::LidarMap;
use viola_geometry::{Point2, Pose2, angle_between};
use viola_lab::simulate::{Home, HomeParams, Set};
use viola_testing::data;

/// The same home, mapped again: in another frame, with noise of 2 cm, a fifth of the points missing, and without furniture
/// in one of its quarters.
fn anew(map: &LidarMap, map_from_earlier: &Pose2, seed: u64) -> LidarMap {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let middle = middle(map);
    let mut csv = "x,y\n".to_owned();
    for point in &map.occupied_m {
        let is_moved = point.x > middle.x && point.y > middle.y && random.random_bool(0.5);
        if is_moved || random.random_bool(0.2) {
            continue;
        }
        let at = map_from_earlier.apply(point);
        let noise = [random.random_range(-0.02..0.02), random.random_range(-0.02..0.02)];
        csv += &format!("{},{}\n", at.x + noise[0], at.y + noise[1]);
    }
    LidarMap::read(csv.as_bytes()).unwrap()
}

fn middle(map: &LidarMap) -> Point2 {
    let half = |axis: usize| 0.5 * (map.info.min_m[axis] + map.info.max_m[axis]);
    Point2::new(half(0), half(1))
}

/// Registers each map to itself mapped again, in three frames, and to the others. Most homes tell their frame; none tells a
/// wrong one, or one in another home.
fn check(maps: &[(String, LidarMap)], of_one_home: &[&str], least_told: f64) {
    let mut told = 0;
    for (name, map) in maps {
        for (seed, yaw_deg) in [0.0, 90.0, -145.0].into_iter().enumerate() {
            let turned = f64::to_radians(yaw_deg);
            let truth = Pose2::new(if yaw_deg == 0.0 { 0.0 } else { 7.0 }, -3.0 * turned, turned);
            let Some(found) = later_from_earlier(map, &anew(map, &truth, seed as u64)) else { continue };
            told += 1;
            let miss_m = (found.apply(&middle(map)) - truth.apply(&middle(map))).norm();
            let miss_deg = angle_between(found.yaw_rad, truth.yaw_rad).to_degrees();
            assert!(
                miss_m < 0.1 && miss_deg < 1.0,
                "{name}, {yaw_deg} degrees: {miss_m} m, {miss_deg} degrees"
            );
        }
    }
    let told = told as f64 / (3 * maps.len()) as f64;
    assert!(told >= least_told, "{told} of the frames are told");
    let mut pairs = BTreeSet::new();
    for (at, (name, map)) in maps.iter().enumerate() {
        for (other_name, other) in &maps[..at] {
            pairs.extend(later_from_earlier(map, other).map(|_| [other_name.as_str(), name.as_str()]));
        }
    }
    let known = |name: &String| of_one_home.contains(&name.as_str());
    let mut expected = BTreeSet::new();
    for (at, (name, _)) in maps.iter().enumerate().filter(|(_, (name, _))| known(name)) {
        let others = maps[..at].iter().filter(|(other, _)| known(other));
        expected.extend(others.map(|(other, _)| [other.as_str(), name.as_str()]));
    }
    assert_eq!(pairs, expected);
}

/// Maps that five robots made of one home: the rooms have the same sizes.
const ONE_HOME: [&str; 5] = [
    "d9_1058_with_custom_named_segments",
    "l10su_1121_carpet",
    "x10plus_1104_with_obstacle",
    "z10_1056_paths",
    "viomi_v6_41_no_path",
];

#[test]
fn maps_of_real_robots() {
    let Some(folder) = data::folder("vacuum_maps") else { return };
    let files = ["dreame", "roborock", "viomi"]
        .iter()
        .flat_map(|vendor| std::fs::read_dir(folder.join(vendor)).unwrap());
    let mut paths: Vec<PathBuf> = files.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    paths.push(folder.join("ros/home.yaml"));
    paths.sort();
    let open = |path: &PathBuf| {
        (path.file_stem().unwrap().to_string_lossy().into_owned(), LidarMap::open(path).unwrap())
    };
    check(&paths.iter().map(open).collect::<Vec<_>>(), &ONE_HOME, 0.9);
}

#[test]
fn maps_of_simulated_homes() {
    let map = |seed: u64| {
        let home = Home::generate(&HomeParams::new(Set::Normal, seed));
        (format!("home {seed}"), home.survey().lidar_map().unwrap())
    };
    check(&(0..4).map(map).collect::<Vec<_>>(), &[], 0.9);
}
