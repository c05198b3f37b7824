//! Maps with faults that cost a note and not the map.

use crate::drawing::{grey, pgm, ros_zip, text, valetudo, yaml};
use crate::maps::check_home;
use serde_json::{Value, json};
use viola_formats::lidar::LidarMap;

fn read(map: &Value) -> LidarMap {
    LidarMap::read(&text(map)).unwrap()
}

fn check_note(map: &LidarMap, words: &str) {
    assert!(map.info.notes.iter().any(|note| note.contains(words)), "{words}: {:?}", map.info.notes);
}

#[test]
fn segments_of_one_id_are_one_room() {
    let mut two_parts = valetudo(true, true);
    two_parts["layers"][3]["metaData"]["segmentId"] = json!(16);
    let mut twice = valetudo(true, true);
    twice["layers"][3] = twice["layers"][2].clone();
    for (what, map, cells) in [("two parts", two_parts, 8), ("twice", twice, 4)] {
        let map = read(&map);
        let rooms: Vec<_> = map
            .rooms
            .iter()
            .map(|room| (room.id.as_str(), room.name.as_deref(), room.cells_m.len()))
            .collect();
        assert_eq!(rooms, [("16", Some("Kitchen"), cells)], "{what}");
        check_note(&map, "1 segments have the id of an earlier one");
    }
}

#[test]
fn a_segment_without_an_id_gets_one_of_its_own() {
    let mut map = valetudo(true, true);
    map["layers"][2]["metaData"] = json!({});
    map["layers"][3]["metaData"]["segmentId"] = json!("1");
    let map = read(&map);
    let ids: Vec<&str> = map.rooms.iter().map(|room| room.id.as_str()).collect();
    assert_eq!(ids, ["2", "1"]);
}

#[test]
fn a_yaw_in_degrees_is_told() {
    let plain = String::from_utf8(yaml("")).unwrap();
    for (yaw, is_told) in [("0.0", false), ("-6.28", false), ("90", true), ("-90.0", true)] {
        let turned = plain.replace("2.0, 0.0]", &format!("2.0, {yaw}]"));
        let map = LidarMap::read(&ros_zip(turned.as_bytes(), &pgm(grey(0, 254, 205)))).unwrap();
        let told = map.info.notes.iter().any(|note| note.contains("if it is in degrees, write"));
        assert_eq!(told, is_told, "{yaw}: {:?}", map.info.notes);
    }
}

/// map_saver writes `-nan` for a map whose publisher left the rotation empty.
#[test]
fn a_yaw_that_is_not_a_number_is_0() {
    let plain = String::from_utf8(yaml("")).unwrap();
    for yaw in ["-nan", "nan", "\"-nan\"", ".nan"] {
        let unknown = plain.replace("2.0, 0.0]", &format!("2.0, {yaw}]"));
        let map = LidarMap::read(&ros_zip(unknown.as_bytes(), &pgm(grey(0, 254, 205))));
        let map = map.unwrap_or_else(|error| panic!("{yaw}: {error}"));
        check_home(yaw, &map, [-1.0, 2.0]);
        check_note(&map, "the yaw of origin is not a number; 0 was taken");
    }
}

#[test]
fn marks_far_off_the_sheet_are_ignored() {
    let mut map = valetudo(true, true);
    map["entities"] = json!([
        {"type": "charger_location", "points": [1e300, 170], "metaData": {"angle": 90}},
        {"type": "robot_position", "points": [230, -2e4], "metaData": {"angle": 90}},
        {"type": "obstacle", "points": [1e7, 170], "metaData": {"label": "shoe"}},
        {"type": "obstacle", "points": [230, 170], "metaData": {"label": "cable"}},
        {"type": "virtual_wall", "points": [0, 0, 0, 1e5], "metaData": {}},
        {"type": "no_go_area", "points": [0, 0, 100, 0, 1e5, 100], "metaData": {}},
        // It begins beside the sheet.
        {"type": "no_go_area", "points": [-100, -100, 100, -100, 100, 100], "metaData": {}},
    ]);
    let map = read(&map);
    let marks = &map.info.marks;
    assert!(map.charger.is_none() && marks.robot.is_none() && !map.unknown_yaw.charger);
    assert_eq!((marks.zones.len(), marks.lines.len(), marks.obstacles.len()), (1, 0, 1));
    check_note(&map, "5 marks are more than 10 m off the map's sheet");
}
