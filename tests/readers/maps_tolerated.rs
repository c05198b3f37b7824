//! Maps with faults that cost a note and not the map.

use crate::drawing::{grey, pgm, ros_zip, text, valetudo, yaml};
use crate::maps::check_home;
use crate::maps_refused::check_refused;
use serde_json::{Value, json};
use viola_formats::lidar::{LidarMap, valetudo_json};
use viola_geometry::Point2;

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

/// Returns a text in UTF-16 with a byte order mark, as Excel and PowerShell write it.
fn utf16(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(unit).collect()
}

#[test]
fn a_map_in_utf16_is_read() {
    let points = "x [m]\ty [m]\tWände\r\n1,5\t2,25\t7\r\n3,5\t-0,5\t8\r\n";
    let mut json = valetudo(true, true);
    json["layers"][2]["metaData"]["name"] = json!("Küche \u{1f373}");
    for unit in [u16::to_le_bytes as fn(u16) -> [u8; 2], u16::to_be_bytes] {
        let map = LidarMap::read(&utf16(points, unit)).unwrap();
        assert_eq!(map.occupied_m, [Point2::new(1.5, 2.25), Point2::new(3.5, -0.5)]);
        let file = utf16(&format!("\r\n{json}"), unit);
        let map = LidarMap::read(&file).unwrap();
        assert_eq!(map.rooms[0].name.as_deref(), Some("Küche \u{1f373}"));
        assert_eq!(valetudo_json(&file), Some(text(&json)));
        // Half a character at the end, and half of a pair of them.
        let whole = utf16(points, unit);
        let pair = [whole.as_slice(), &unit(0xd83c)].concat();
        check_refused("half a character", &whole[..whole.len() - 1], "unknown_format");
        check_refused("half a pair", &pair, "unknown_format");
        check_refused("only the mark", &utf16("", unit), "empty");
    }
    // Each of these characters has three bytes in UTF-8.
    check_refused(
        "more than 64 MiB",
        &utf16(&"\u{2028}".repeat(23 << 20), u16::to_le_bytes),
        "file_too_large",
    );
}

#[test]
fn points_whose_lines_end_in_carriage_returns_are_read() {
    for csv in ["x,y\r1.5,2.25\r3.5,-0.5\r", "1.5,2.25\r3.5,-0.5", "# x y\r1.5 2.25\r\r3.5 -0.5\r"] {
        let map = LidarMap::read(csv.as_bytes()).unwrap_or_else(|error| panic!("{csv:?}: {error}"));
        assert_eq!(map.occupied_m, [Point2::new(1.5, 2.25), Point2::new(3.5, -0.5)], "{csv:?}");
    }
    let told = LidarMap::read(b"x,y\r1,2\r1,two\r").unwrap_err().to_string();
    assert!(told.contains("line 3"), "{told}");
}
