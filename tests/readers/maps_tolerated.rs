//! Maps with faults that cost a note and not the map.

use crate::drawing::{text, valetudo};
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
