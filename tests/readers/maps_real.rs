//! Robots' own files, read directly, against the Valetudo maps that were made of them.

use std::path::{Path, PathBuf};
use viola_formats::lidar::{LidarMap, Obstacle};
use viola_geometry::{Pose2, angle_between};
use viola_testing::data;

/// Returns every `.bin` beside a `.json`, with the name of its format.
fn pairs() -> Option<Vec<(&'static str, PathBuf)>> {
    let pairs = recorded("bin")?;
    assert_eq!(pairs.len(), 11);
    Some(pairs)
}

/// Returns the recorded maps of robots with this ending, and the names of their formats.
pub fn recorded(ending: &str) -> Option<Vec<(&'static str, PathBuf)>> {
    let data = data::root()?;
    let mut maps = Vec::new();
    for vendor in ["roborock", "dreame", "viomi"] {
        for entry in std::fs::read_dir(data.join("vacuum_maps").join(vendor)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == ending) {
                maps.push((vendor, path));
            }
        }
    }
    maps.sort();
    Some(maps)
}

const KINDS: [Option<&str>; 3] = [Some("Corridor"), Some("Kitchen"), Some("Primary bedroom")];

/// Every cell, point, room, zone and pose is equal. The differences, which are compared separately:
/// - Roborock's charger has an angle since the third generation, which Valetudo does not keep; without one
///   both take the dock as facing the top of the map.
/// - Viomi's angles are radians. Valetudo adds 180 to them as if they were degrees, so all its angles of
///   Viomi maps lie within 4 degrees of 180.
/// - Dreame's carpet is not in Valetudo's maps, and the words for obstacles are our own.
/// - Dreame's rooms without a name have the name of their kind.
/// - The robot's heading is that of the JSON up to rounding to whole degrees.
#[test]
fn each_robots_own_file_equals_its_valetudo_map() {
    let Some(pairs) = pairs() else { return };
    for (vendor, path) in pairs {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let mut own = LidarMap::open(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        own.rooms
            .iter_mut()
            .filter(|room| KINDS.contains(&room.name.as_deref()))
            .for_each(|room| room.name = None);
        let valetudo = LidarMap::open(&path.with_extension("json")).unwrap();
        println!("{name}: {}, {:?}", own.info.marks_in_words(), own.info.notes);
        assert_eq!(own.info.format, vendor, "{name}");
        assert!(own.cells == valetudo.cells, "{name}: cells");
        assert!(own.occupied_m == valetudo.occupied_m, "{name}: walls");
        let ids = |map: &LidarMap| -> Vec<_> {
            map.rooms.iter().map(|room| (room.id.clone(), room.name.clone(), room.material.clone())).collect()
        };
        assert_eq!(ids(&own), ids(&valetudo), "{name}");
        assert!(own.rooms == valetudo.rooms, "{name}: the rooms' cells");
        assert_eq!((own.info.min_m, own.info.max_m), (valetudo.info.min_m, valetudo.info.max_m), "{name}");
        assert_eq!((own.info.free_cells, own.info.cell_m), (valetudo.info.free_cells, valetudo.info.cell_m));
        assert_eq!(own.info.marks.zones, valetudo.info.marks.zones, "{name}");
        assert_eq!(own.info.marks.lines, valetudo.info.marks.lines, "{name}");
        let places = |obstacles: &[Obstacle]| obstacles.iter().map(|o| o.at_m).collect::<Vec<_>>();
        assert_eq!(places(&own.info.marks.obstacles), places(&valetudo.info.marks.obstacles), "{name}");
        check_pose(&name, "charger", own.charger, valetudo.charger);
        check_pose(&name, "robot", own.info.marks.robot, valetudo.info.marks.robot);
    }
}

fn check_pose(name: &str, what: &str, own: Option<Pose2>, valetudo: Option<Pose2>) {
    assert_eq!(own.is_some(), valetudo.is_some(), "{name}: {what}");
    let (Some(own), Some(valetudo)) = (own, valetudo) else { return };
    assert_eq!((own.x_m, own.y_m), (valetudo.x_m, valetudo.y_m), "{name}: {what}");
    let own_deg = own.yaw_rad.to_degrees();
    let expected_deg = match (name, what) {
        // From the bytes of the files: 98, -1; -2.960 and -1.535 radians, and 0 for the first Viomi's robot.
        ("S5_FW2008_with_segments.bin", "charger") => 98.0,
        ("S6_FW2652_with_active_segment_and_no_mop_zone.bin", "charger") => -1.0,
        ("converted_3790.bin", "charger") => -169.6,
        ("converted_3790.bin", _) => 0.0,
        ("viomi_v6_41_no_path.bin", _) => -88.0,
        _ => valetudo.yaw_rad.to_degrees(),
    };
    let off = angle_between(own.yaw_rad, f64::to_radians(expected_deg)).to_degrees();
    assert!(off.abs() < 0.1, "{name}: the {what} faces {own_deg}, not {expected_deg} degrees");
}

/// The docks whose angle only our reader reads face away from their wall.
#[test]
fn docks_face_away_from_their_walls() {
    let Some(pairs) = pairs() else { return };
    let names = ["S5_FW2008", "S6_FW2652", "converted_3790", "viomi_v6"];
    let told = pairs.iter().filter(|(_, path)| names.iter().any(|name| in_name(path, name)));
    assert_eq!(told.clone().count(), 4);
    for (_, path) in told {
        let map = LidarMap::open(path).unwrap();
        let dock = map.charger.unwrap();
        let nearest_ahead = |reach_m: f64| {
            let along = dock.apply(&viola_geometry::Point2::new(reach_m, 0.0));
            map.occupied_m.iter().map(|p| (p - along).norm()).fold(f64::INFINITY, f64::min)
        };
        assert!(nearest_ahead(0.4) > nearest_ahead(-0.15) + 0.1, "{}", path.display());
    }
}

fn in_name(path: &Path, part: &str) -> bool {
    path.file_name().unwrap().to_string_lossy().contains(part)
}

#[test]
fn what_only_the_robots_files_tell() {
    let Some(pairs) = pairs() else { return };
    let open = |part: &str| {
        let (_, path) = pairs.iter().find(|(_, path)| in_name(path, part)).unwrap();
        LidarMap::open(path).unwrap()
    };
    // Counted in the image's bytes: 1878 + 2 cells whose type is 3.
    let carpet = open("l10su_1121_carpet");
    assert_eq!(carpet.carpet_m.len(), 1880);
    assert!((carpet.info.marks.carpet_m2 - 1880.0 * 0.0025).abs() < 1e-9);
    // `"seg_inf": {"1": {"type": 8, ..}, "4": {"type": 2, ..}, "2": {"type": 4, ..}, ..}` without names.
    let [corridor, kitchen, bedroom] = KINDS;
    let kinds: Vec<Option<&str>> = carpet.rooms.iter().map(|room| room.name.as_deref()).collect();
    assert_eq!(kinds, [corridor, kitchen, None, bedroom, None, None]);
    let obstacle = &open("x10plus_1104").info.marks.obstacles[0];
    assert_eq!(obstacle.label, "pedestal (89%)");
    let restricted = open("S6_FW2652");
    assert_eq!(restricted.info.marks_in_words(), "the robot, 1 no-go zone, 1 no-mop zone");
    assert_eq!(open("misc_monastery").info.marks.lines.len(), 5);
}
