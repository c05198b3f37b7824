//! Maps in the formats of other tools: written and read back, they are the same.

use crate::drawing::*;
use crate::maps_real::recorded;
use crate::robot_files::*;
use serde_json::{Value, json};
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::{GridFrame, Point2, Pose2, angle_between};
use viola_testing::data;

/// Checks that every cell, room, dock and mark of `a` is in `b`, moved by `shift_m`.
fn check_same(what: &str, a: &LidarMap, b: &LidarMap, shift_m: [f64; 2]) {
    let shift = viola_geometry::Vector2::new(shift_m[0], shift_m[1]);
    let grid = b.cells.as_ref().unwrap();
    assert_eq!(
        (a.info.free_cells, a.info.occupied_points),
        (b.info.free_cells, b.info.occupied_points),
        "{what}"
    );
    let cells = a.cells.as_ref().unwrap();
    for y in 0..cells.frame.height {
        for x in 0..cells.frame.width {
            let there = grid.at(&(cells.frame.centre(x, y) + shift)).unwrap_or(Cell::Unknown);
            assert_eq!(there, cells.get(x, y), "{what}: cell {x}, {y}");
        }
    }
    let near = |p: &Point2, q: &Point2| (p + shift - q).norm() < 1e-6;
    assert!(a.occupied_m.iter().all(|p| grid.at(&(p + shift)) == Some(Cell::Occupied)), "{what}");
    assert_eq!(a.rooms.len(), b.rooms.len(), "{what}");
    for (room, other) in a.rooms.iter().zip(&b.rooms) {
        assert_eq!(
            (&room.id, &room.name, &room.material),
            (&other.id, &other.name, &other.material),
            "{what}"
        );
        assert_eq!(room.cells_m.len(), other.cells_m.len(), "{what}");
        assert!(room.cells_m.iter().zip(&other.cells_m).all(|(p, q)| near(p, q)), "{what}: room {}", room.id);
    }
    let pose = |a: Option<Pose2>, b: Option<Pose2>| match (a, b) {
        (Some(a), Some(b)) => {
            let at = |pose: &Pose2| Point2::new(pose.x_m, pose.y_m);
            near(&at(&a), &at(&b)) && angle_between(a.yaw_rad, b.yaw_rad).abs() < 1e-4
        }
        (a, b) => a == b,
    };
    assert!(pose(a.charger, b.charger), "{what}: {:?} {:?}", a.charger, b.charger);
    let (marks, other) = (&a.info.marks, &b.info.marks);
    assert!(pose(marks.robot, other.robot), "{what}: {:?} {:?}", marks.robot, other.robot);
    let places = |map: &LidarMap| -> Vec<[f64; 2]> {
        let marks = &map.info.marks;
        let zones = marks.zones.iter().flat_map(|zone| zone.outline_m.clone());
        let lines = marks.lines.iter().flat_map(|line| line.ends_m);
        zones.chain(lines).chain(marks.obstacles.iter().map(|obstacle| obstacle.at_m)).collect()
    };
    let (places, others) = (places(a), places(b));
    assert_eq!(places.len(), others.len(), "{what}");
    assert!(
        places.iter().zip(&others).all(|(p, q)| near(&Point2::from(*p), &Point2::from(*q))),
        "{what}: {places:?} {others:?}"
    );
}

fn with_cells() -> Vec<(String, LidarMap)> {
    let mut maps: Vec<(String, LidarMap)> = Vec::new();
    for (name, bytes) in one_of_each_format() {
        let map = LidarMap::read(&bytes).unwrap();
        if map.cells.is_some() && !name.starts_with("carmen") {
            maps.push((name.to_string(), map));
        }
    }
    if let Some(data) = data::root() {
        for file in [
            "roborock/S6_FW2652_with_active_segment_and_no_mop_zone",
            "dreame/1c_1096_fullcleanup",
            "dreame/misc_monastery_with_cutoff",
            "viomi/viomi_v6_41_no_path",
        ] {
            maps.push((
                file.to_string(),
                LidarMap::open(&data.join("vacuum_maps").join(file).with_extension("bin")).unwrap(),
            ));
        }
        maps.push(("ros".to_string(), LidarMap::open(&data.join("vacuum_maps/ros/home.yaml")).unwrap()));
    }
    assert!(maps.len() >= 8);
    maps
}

#[test]
fn valetudo_is_read_back() {
    for (name, map) in with_cells() {
        let written = map.to_valetudo().unwrap();
        let read = LidarMap::read(&written.bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(read.info.format, "valetudo");
        let moved = written.file_from_map_m != [0.0; 2];
        // Only a map with cells left of or below its origin must be moved.
        assert_eq!(moved, map.info.min_m.iter().any(|v| *v < 0.0), "{name}: {:?}", written.notes);
        check_same(&name, &map, &read, written.file_from_map_m);
        // Once on a sheet it keeps its place.
        let again = LidarMap::read(&read.to_valetudo().unwrap().bytes).unwrap();
        check_same(&name, &read, &again, [0.0; 2]);
    }
}

/// Returns the entities: type, points in centimetres from the upper-left corner, and hundredths of a degree.
fn entities(json: &Value) -> Vec<(String, Value, Option<i64>)> {
    let of = |entity: &Value| {
        let angle = entity["metaData"]["angle"].as_f64().map(|degrees| (degrees * 100.0).round() as i64);
        (entity["type"].as_str().unwrap().to_owned(), entity["points"].clone(), angle)
    };
    // A path, a target and the areas of one cleaning are not kept.
    let is_kept = |kind: &str| !["path", "predicted_path", "go_to_target", "active_zone"].contains(&kind);
    let mut all: Vec<_> = json["entities"].as_array().unwrap().iter().map(of).collect();
    all.retain(|(kind, ..)| is_kept(kind));
    all.sort_by_key(|(kind, points, _)| (kind.clone(), points.to_string()));
    all
}

/// Sides of Valetudo's `size`: `RoborockMapParser.js`, `DreameMapParser.js`, `ViomiMapParser.js` and the drawn file.
#[test]
fn the_sheet_of_a_robot_stays() {
    let sizes: [(&str, i64); 3] = [("roborock", 5120), ("dreame", 6554), ("viomi", 4000)];
    let mut found = 0;
    for (name, map) in with_cells() {
        let Some(sheet_cm) = map.sheet_cm else { continue };
        let written = map.to_valetudo().unwrap();
        let json: Value = serde_json::from_slice(&written.bytes).unwrap();
        assert_eq!(json["size"], json!({"x": sheet_cm[0], "y": sheet_cm[1]}), "{name}");
        assert_eq!(written.file_from_map_m, [0.0; 2], "{name}");
        if let Some((_, size)) = sizes.iter().find(|(format, _)| *format == map.info.format) {
            found += 1;
            // The drawn Viomi has a small image.
            assert!(sheet_cm == [*size; 2] || name == "viomi", "{name}: {sheet_cm:?}");
        }
        let read = LidarMap::read(&written.bytes).unwrap();
        assert_eq!((read.frames.valetudo, read.sheet_cm), (map.frames.valetudo, map.sheet_cm), "{name}");
        let corners = |map: &LidarMap| [map.info.min_m, map.info.max_m].concat();
        let off = corners(&read).into_iter().zip(corners(&map)).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9, "{name}");
    }
    assert!(found >= 3, "{found}");
}

#[test]
fn real_maps_of_valetudo_keep_their_positions_and_angles() {
    let Some(maps) = recorded("json") else { return };
    let mut docks = 0;
    for (_, path) in maps {
        let own: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let written = LidarMap::open(&path).unwrap().to_valetudo().unwrap();
        let written: Value = serde_json::from_slice(&written.bytes).unwrap();
        assert_eq!(written["size"], own["size"], "{}", path.display());
        assert_eq!(entities(&written), entities(&own), "{}", path.display());
        docks += entities(&own).iter().filter(|(kind, ..)| kind == "charger_location").count();
    }
    assert!(docks >= 8, "{docks}");
}

/// A wall is added around a floor without walls, a cell beyond the sheet's border.
#[test]
fn a_floor_at_the_border_of_its_sheet_is_written_and_read() {
    for (runs, kept) in [
        // The floor reaches the right and the lower border: the sheet grows there, and positions stay.
        ("[4,4,6, 4,5,6, 4,9,6]", true),
        // It reaches the left and the upper border: the map must move.
        ("[0,0,6, 0,1,6]", false),
    ] {
        let json = format!(
            r#"{{"size":{{"x":50,"y":50}},"pixelSize":5,"layers":[{{"type":"floor","compressedPixels":{runs}}}],
            "entities":[{{"type":"charger_location","points":[25,30],"metaData":{{}}}}]}}"#
        );
        let map = LidarMap::read(json.as_bytes()).unwrap();
        let written = map.to_valetudo().unwrap();
        let read = LidarMap::read(&written.bytes).unwrap();
        check_same(runs, &map, &read, written.file_from_map_m);
        let json: Value = serde_json::from_slice(&written.bytes).unwrap();
        let dock = &json["entities"][0];
        assert_eq!(dock["points"] == json!([25, 30]), kept, "{runs}: {dock}");
        // Its angle is unknown, and none is invented.
        assert_eq!(dock["metaData"], json!({}), "{runs}");
    }
}

#[test]
fn valetudo_says_what_its_own_says() {
    let Some(data) = data::root() else { return };
    let path = data.join("vacuum_maps/roborock/S5_FW2008_with_segments.json");
    let original: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let written = LidarMap::open(&path).unwrap().to_valetudo().unwrap();
    let written: serde_json::Value = serde_json::from_slice(&written.bytes).unwrap();
    assert_eq!(written["pixelSize"], original["pixelSize"]);
    assert_eq!(written["metaData"]["totalLayerArea"], original["metaData"]["totalLayerArea"]);
    for layer in original["layers"].as_array().unwrap() {
        let same = |other: &&serde_json::Value| {
            other["type"] == layer["type"] && other["metaData"]["segmentId"] == layer["metaData"]["segmentId"]
        };
        let other = written["layers"].as_array().unwrap().iter().find(same).unwrap();
        assert_eq!(other["metaData"]["area"], layer["metaData"]["area"]);
        assert_eq!(
            other["compressedPixels"].as_array().unwrap().len(),
            layer["compressedPixels"].as_array().unwrap().len()
        );
        assert_eq!(other["dimensions"]["pixelCount"], layer["dimensions"]["pixelCount"]);
    }
}

#[test]
fn ros_is_read_back() {
    for (name, map) in with_cells() {
        let files = map.to_ros("map.pgm").unwrap();
        let read = LidarMap::read(&ros_zip(&files.yaml, &files.pgm)).unwrap();
        assert_eq!(read.info.format, "ros_map_server");
        assert_eq!(read.info.notes, Vec::<String>::new(), "{name}");
        let (read, own) = (read.cells.unwrap(), map.cells.unwrap());
        let frame = GridFrame { origin_m: own.frame.written_origin_m(), ..own.frame };
        assert_eq!((read.frame, read.cells), (frame, own.cells), "{name}");
    }
    // A name that YAML would read as something else.
    let map = LidarMap::read(&roborock()).unwrap();
    let yaml = String::from_utf8(map.to_ros("no: #1.pgm").unwrap().yaml).unwrap();
    assert!(yaml.starts_with("image: \"no: #1.pgm\"\n"), "{yaml}");
}

#[test]
fn ply_is_read_back() {
    for (name, bytes) in one_of_each_format() {
        let map = LidarMap::read(&bytes).unwrap();
        let read = LidarMap::read(&map.to_ply().bytes).unwrap();
        assert_eq!(read.occupied_m, map.occupied_m, "{name}");
    }
}

#[test]
fn points_and_fine_cells_become_cells_of_5_cm() {
    let points = LidarMap::read(&pcd("binary")).unwrap();
    let written = points.to_valetudo().unwrap();
    let read = LidarMap::read(&written.bytes).unwrap();
    let [x, y] = written.file_from_map_m;
    let grid = read.cells.as_ref().unwrap();
    for point in &points.occupied_m {
        assert_eq!(grid.at(&Point2::new(point.x + x, point.y + y)), Some(Cell::Occupied), "{point}");
    }
    let fine = String::from_utf8(yaml("")).unwrap().replace("0.05", "0.025");
    let fine = LidarMap::read(&ros_zip(fine.as_bytes(), &pgm(grey(0, 254, 205)))).unwrap();
    let written = fine.to_valetudo().unwrap();
    assert!(written.notes.iter().any(|note| note.contains("0.025")), "{:?}", written.notes);
    let read = LidarMap::read(&written.bytes).unwrap();
    assert_eq!(read.info.cell_m, Some(0.05));
    let [x, y] = written.file_from_map_m;
    let grid = read.cells.as_ref().unwrap();
    assert!(fine.occupied_m.iter().all(|p| grid.at(&Point2::new(p.x + x, p.y + y)) == Some(Cell::Occupied)));
}

#[test]
fn a_map_far_from_its_origin_is_moved_for_valetudo() {
    let far = LidarMap::read(b"x,y\n90000,0\n90001,0\n").unwrap();
    let written = far.to_valetudo().unwrap();
    assert!(LidarMap::read(&written.bytes).is_ok() && written.file_from_map_m[0] < -80_000.0);
}

/// Stored infos without marks are still read.
#[test]
fn infos_of_before_are_read() {
    let map = LidarMap::read(&roborock()).unwrap();
    let mut stored = serde_json::to_value(&map.info).unwrap();
    assert_eq!(serde_json::from_value::<viola_formats::lidar::LidarInfo>(stored.clone()).unwrap(), map.info);
    stored.as_object_mut().unwrap().remove("marks");
    for room in stored["rooms"].as_array_mut().unwrap() {
        room.as_object_mut().unwrap().remove("material");
    }
    let read: viola_formats::lidar::LidarInfo = serde_json::from_value(stored).unwrap();
    assert_eq!(read.marks, viola_formats::lidar::MapMarks::default());
    assert_eq!(read.rooms[0].material, None);
}
