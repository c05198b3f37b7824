//! Robots' own files: the drawing is read, and unusable files are refused by name.

use crate::drawing::*;
use crate::maps::check_home;
use crate::maps_refused::check_refused;
use crate::robot_files::*;
use viola_formats::lidar::{LidarMap, LineKind, ZoneKind, valetudo_json};
use viola_geometry::{Point2, Pose2};

fn close(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9
}

fn check_pose(what: &str, pose: Option<Pose2>, at: [f64; 2], yaw_deg: f64) {
    let pose = pose.unwrap_or_else(|| panic!("{what}: no pose"));
    let off_rad = viola_geometry::angle_between(pose.yaw_rad, yaw_deg.to_radians());
    assert!(close([pose.x_m, pose.y_m], at) && off_rad.abs() < 1e-6, "{what}: {pose:?}");
}

/// Checks the rooms over the cells `a` and `b` of the drawing.
fn check_rooms(what: &str, map: &LidarMap, expected: &[(&str, Option<&str>, Option<&str>)]) {
    let found: Vec<_> =
        map.rooms.iter().map(|r| (r.id.as_str(), r.name.as_deref(), r.material.as_deref())).collect();
    assert_eq!(found, expected, "{what}");
    assert!(map.rooms.iter().all(|room| room.cells_m.len() == 4), "{what}");
}

#[test]
fn roborock_in_each_generation() {
    let all = LidarMap::read(&roborock()).unwrap();
    check_home("all", &all, ROBOROCK_CORNER);
    assert_eq!(all.info.format, "roborock");
    check_rooms("all", &all, &[("16", None, Some("wood")), ("17", None, Some("tile"))]);
    check_pose("charger", all.charger, [2.3, 5.05], 90.0);
    // Its heading is that of the path's end, upwards.
    check_pose("robot", all.info.marks.robot, [2.1, 5.1], 90.0);
    let marks = &all.info.marks;
    assert_eq!((marks.zones.len(), marks.lines.len(), marks.obstacles.len()), (1, 1, 1));
    assert_eq!(marks.zones[0].kind, ZoneKind::NoGo);
    assert!(close(marks.zones[0].outline_m[2], [2.1, 5.2]), "{:?}", marks.zones);
    assert!(close(marks.lines[0].ends_m[1], [2.4, 5.0]), "{:?}", marks.lines);
    assert_eq!(marks.obstacles[0].label, "shoe (90%)");
    assert!(close(marks.obstacles[0].at_m, [2.2, 5.1]));

    let zipped = LidarMap::read(&gzip(&roborock())).unwrap();
    assert_eq!(zipped.info, all.info);
    // Without segments the upper bits mean nothing.
    let first = LidarMap::read(&rrmap(&[roborock_image(24, false)])).unwrap();
    check_home("first", &first, ROBOROCK_CORNER);
    assert!(first.rooms.is_empty() && first.charger.is_none());
    let newer = LidarMap::read(&rrmap(&[roborock_image(36, true)])).unwrap();
    check_home("newer", &newer, ROBOROCK_CORNER);
    assert!(newer.info.notes[0].contains("header of 36 bytes"), "{:?}", newer.info.notes);
}

/// The walls of such a map are the cells around its floor: each wall of the drawing beside floor, and the gap below it.
#[test]
fn roborock_without_walls() {
    let mut image = roborock_image(28, true);
    let first_cell = image.len() - 8 * 6;
    image[first_cell..].iter_mut().filter(|cell| **cell == 1).for_each(|cell| *cell = 0);
    let map = LidarMap::read(&rrmap(&[image])).unwrap();
    assert!(map.info.notes.iter().any(|note| note.contains("no wall cells")), "{:?}", map.info.notes);
    let is_floor = |x: usize, y: usize| {
        HOME.get(y).and_then(|row| row.as_bytes().get(x)).is_some_and(|c| !b"# ".contains(c))
    };
    let beside = |x: usize, y: usize| {
        is_floor(x.wrapping_sub(1), y)
            || is_floor(x + 1, y)
            || is_floor(x, y.wrapping_sub(1))
            || is_floor(x, y + 1)
    };
    let expected = cells().filter(|&(x, y, _)| !is_floor(x, y) && beside(x, y)).count();
    assert_eq!(map.occupied_m.len(), expected);
}

#[test]
fn dreame_with_its_saved_map() {
    let text = dreame(&dreame_inflated(b'I'));
    let lines = text.chunks(76).collect::<Vec<_>>().join(&b"\r\n"[..]);
    // The number of a map may look like the start of JSON.
    let numbered = edited(&dreame_inflated(b'I'), 0, b"{");
    let (packed, as_text) = (zlib(&numbered), dreame(&numbered));
    for bytes in [text, lines, zlib(&dreame_inflated(b'I')), dreame_inflated(b'I'), packed, as_text] {
        let map = LidarMap::read(&bytes).unwrap();
        assert_eq!(map.info.format, "dreame");
        assert_eq!(valetudo_json(&bytes), None);
        check_home("dreame", &map, DREAME_CORNER);
        check_rooms("dreame", &map, &[("16", Some("Kitchen"), Some("wood_vertical")), ("17", None, None)]);
        // -1900, -900 mm: 3087 and 3187 cm from the edges of 65.54 m.
        check_pose("robot", map.info.marks.robot, [30.87, 31.87], 0.0);
        check_pose("charger", map.charger, [31.07, 31.87], 90.0);
        let marks = &map.info.marks;
        assert_eq!((marks.zones.len(), marks.lines.len()), (1, 1));
        assert!(close(marks.lines[0].ends_m[1], [31.17, 31.77]), "{:?}", marks.lines);
        assert_eq!(marks.obstacles[0].label, "shoe (50%)");
        // The four cells `b` are of type 3.
        assert_eq!(map.carpet_m.len(), 4);
    }
    // Text behind the image that is not JSON is ignored; the image is read.
    let inflated = dreame_inflated(b'I');
    let map = LidarMap::read(&dreame(&inflated[..27 + 48 + 10])).unwrap();
    assert_eq!(map.rooms.len(), 1);
    assert!(map.info.notes.iter().any(|note| note.contains("no JSON")), "{:?}", map.info.notes);
}

#[test]
fn viomi_with_and_without_a_number() {
    let map = LidarMap::read(&zlib(&viomi_inflated(77))).unwrap();
    assert_eq!(map.info.format, "viomi");
    assert_eq!(map.info.notes, Vec::<String>::new());
    check_home("viomi", &map, VIOMI_CORNER);
    check_rooms("viomi", &map, &[("16", Some("Kitchen"), None), ("17", None, None)]);
    // Rounded up to centimetres: -18.7 as 32 bits is a little more than 1.3 m from -20.
    check_pose("charger", map.charger, [1.3, 0.55], 90.0);
    let kinds: Vec<_> = map.info.marks.lines.iter().map(|line| line.kind).collect();
    assert_eq!(kinds, [LineKind::VirtualWall]);
    assert!(close(map.info.marks.zones[0].outline_m[0], [1.0, 0.5]), "{:?}", map.info.marks.zones);

    let first = LidarMap::read(&zlib(&viomi_inflated(0))).unwrap();
    check_home("temporary", &first, VIOMI_CORNER);
    assert!(first.rooms.is_empty() && first.charger.is_none());
    // Blocks that contradict the flags are not read; the image is.
    let mut other = viomi_inflated(77);
    let charger = 48 + 40 + 3_000 + 12;
    other[charger] ^= 1;
    let map = LidarMap::read(&zlib(&other)).unwrap();
    assert!(map.charger.is_none());
    assert!(map.info.notes.iter().any(|note| note.contains("not all understood")), "{:?}", map.info.notes);
}

#[test]
fn viomi_with_unknown_positions_and_several_maps() {
    let whole = viomi_inflated(77);
    let unknown = 1100f32.to_le_bytes();
    // The charger follows the image of 3 000 bytes and an empty path; the robot follows two restrictions, no zone and a
    // target.
    let charger = 48 + 40 + 3_000 + 12;
    let robot = charger + 16 + (12 + 2 * 92) + 12 + 20;
    for (what, at, expected) in [
        ("all known", None, [true, true]),
        ("the charger's x", Some(charger + 4), [false, true]),
        ("the charger's y", Some(charger + 8), [false, true]),
        ("the robot's x", Some(robot + 9), [true, false]),
        ("the robot's y", Some(robot + 13), [true, false]),
    ] {
        let bytes = at.map_or(whole.clone(), |at| edited(&whole, at, &unknown));
        let map = LidarMap::read(&zlib(&bytes)).unwrap();
        assert_eq!([map.charger.is_some(), map.info.marks.robot.is_some()], expected, "{what}");
        assert_eq!(map.info.notes, Vec::<String>::new(), "{what}");
    }
    // The map's name is `up`, with the number 0.
    let names = whole.windows(3).rposition(|window| window == b"\x02up").unwrap();
    let number = 0x5e63_d2b4u32.to_le_bytes();
    let named = |name: &[u8]| [name, &number].concat();
    for (what, bytes) in [
        ("a name of another map", [&whole[..names], &named(b"\x03Alt")[..], &whole[names..]].concat()),
        ("two", [&whole[..names], &named(b"\x03Alt")[..], &named(b"\x01B")[..], &whole[names..]].concat()),
        ("one name with a large number", edited(&whole, names + 3, &number)),
    ] {
        let map = LidarMap::read(&zlib(&bytes)).unwrap();
        check_rooms(what, &map, &[("16", Some("Kitchen"), None), ("17", None, None)]);
        assert_eq!(map.info.notes, Vec::<String>::new(), "{what}");
    }
}

#[test]
fn valetudo_in_what_carries_it() {
    let json = valetudo(true, true);
    let plain = LidarMap::read(&text(&json)).unwrap();
    let state = text(&serde_json::json!({"attributes": [], "map": json}));
    for (what, bytes) in [
        ("png", valetudo_png(&json)),
        ("mqtt", zlib(&text(&json))),
        ("mqtt as base64", dreame(&text(&json))),
        ("gzip", gzip(&text(&json))),
        ("state", state),
    ] {
        let map = LidarMap::read(&bytes).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(map.info, plain.info, "{what}");
        assert!(map.cells == plain.cells, "{what}");
        let sent_back = valetudo_json(&bytes).unwrap_or_else(|| panic!("{what}"));
        assert_eq!(LidarMap::read(&sent_back).unwrap().info, plain.info, "{what}");
    }
}

#[test]
fn valetudo_with_every_mark() {
    let mut json = valetudo(true, true);
    json["layers"][2]["metaData"]["material"] = "wood_vertical".into();
    let square = [230, 170, 240, 170, 240, 180, 230, 180];
    let entities = json["entities"].as_array_mut().unwrap();
    for kind in ["ramp", "carpet", "no_mop_area", "no_go_area", "active_zone"] {
        entities.push(serde_json::json!({"type": kind, "points": square, "metaData": {}}));
    }
    for kind in ["curtain", "threshold", "virtual_wall"] {
        entities.push(serde_json::json!({"type": kind, "points": [230, 170, 240, 170]}));
    }
    let obstacle = serde_json::json!({"label": "Shoe (87%)"});
    entities.push(serde_json::json!({"type": "obstacle", "points": [230, 170], "metaData": obstacle}));
    entities
        .push(serde_json::json!({"type": "robot_position", "points": [240, 180], "metaData": {"angle": 0}}));
    entities.push(serde_json::json!({"type": "no_go_area", "points": [1, 2, 3, 4]}));
    entities.push(serde_json::json!({"type": "virtual_wall", "points": vec![1; 500]}));
    let map = LidarMap::read(&text(&json)).unwrap();
    assert_eq!(map.rooms[0].material.as_deref(), Some("wood_vertical"));
    let marks = &map.info.marks;
    let kinds: Vec<_> = marks.zones.iter().map(|zone| zone.kind).collect();
    assert_eq!(kinds, [ZoneKind::NoGo, ZoneKind::NoMop, ZoneKind::Carpet, ZoneKind::Ramp]);
    // The sheet is 400 cm high.
    assert!(close(marks.zones[0].outline_m[2], [2.4, 2.2]), "{:?}", marks.zones);
    let kinds: Vec<_> = marks.lines.iter().map(|line| line.kind).collect();
    assert_eq!(kinds, [LineKind::VirtualWall, LineKind::Threshold, LineKind::Curtain]);
    assert_eq!(marks.obstacles[0].label, "Shoe (87%)");
    check_pose("robot", marks.robot, [2.4, 2.2], 90.0);
    assert!(map.info.notes.iter().any(|note| note.contains("zone of 2 corners")), "{:?}", map.info.notes);
    assert!(map.info.notes.iter().any(|note| note.contains("without two ends")), "{:?}", map.info.notes);
    let again = LidarMap::read(&map.to_valetudo().unwrap().bytes).unwrap();
    assert_eq!((&again.info.marks, &again.rooms[0].material), (marks, &map.rooms[0].material));
}

#[test]
fn pcd_points_in_each_encoding() {
    for data in ["ascii", "binary", "binary_compressed"] {
        let map = LidarMap::read(&pcd(data)).unwrap_or_else(|error| panic!("{data}: {error}"));
        assert_eq!(map.info.format, "pcd_points");
        assert_eq!(map.occupied_m, hits(), "{data}");
        assert_eq!(map.info.notes, Vec::<String>::new(), "{data}");
    }
    let commented = String::from_utf8(pcd("ascii")).unwrap().replace("# .PCD v0.7", "# Saved by a node\n#");
    assert_eq!(LidarMap::read(commented.as_bytes()).unwrap().occupied_m.len(), hits().len());
    let moved = String::from_utf8(pcd("ascii")).unwrap().replace("VIEWPOINT 0", "VIEWPOINT 1");
    assert!(LidarMap::read(moved.as_bytes()).unwrap().info.notes[0].contains("VIEWPOINT"));
    // Comments, COUNT and POINTS are optional.
    let bare = "FIELDS x y\nSIZE 4 4\nTYPE F F\nWIDTH 1\nHEIGHT 2\nDATA ascii\n1 2\nnan nan\n";
    assert_eq!(LidarMap::read(bare.as_bytes()).unwrap().occupied_m, [Point2::new(1.0, 2.0)]);
}

fn edited(bytes: &[u8], at: usize, with: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + with.len()].copy_from_slice(with);
    bytes
}

#[test]
fn robot_files_that_cannot_be_used_are_refused_by_name() {
    // The image block of the bare file: 8 bytes of head, 4 of segments, then top, left, height, width.
    let image = rrmap(&[roborock_image(28, true)]);
    let huge = i32::MAX.to_le_bytes();
    for (what, bytes, code) in [
        ("no image", rrmap(&[block(1, &[], &[0; 8])]), "bad_robot_map"),
        ("half an image", image[..image.len() - 9].to_vec(), "bad_robot_map"),
        ("a block of 4 GB", edited(&image, 24, &[0xff; 4]), "bad_robot_map"),
        ("a header of 3 bytes", edited(&image, 22, &[3, 0]), "bad_robot_map"),
        ("a header without a place", rrmap(&[block(2, &[0; 8], &[1; 48])]), "bad_robot_map"),
        ("a header of the file beyond it", edited(&image, 2, &[0xff, 0]), "bad_robot_map"),
        ("top far away", edited(&image, 32, &huge), "bad_field"),
        ("a negative left", edited(&image, 36, &(-1i32).to_le_bytes()), "bad_field"),
        ("a height of 2^31", edited(&image, 40, &huge), "bad_field"),
        ("more cells than there are", edited(&image, 40, &[7]), "bad_robot_map"),
        ("a tail", [image.clone(), vec![1, 2]].concat(), "bad_robot_map"),
        ("an empty image", rrmap(&[block(2, &[0; 16], &[])]), "no_walls"),
        ("gzip of something else", gzip(b"not a map"), "unknown_format"),
        ("half a gzip", gzip(&image)[..40].to_vec(), "bad_compression"),
        ("a gzip of 100 MB", gzip(&vec![b'r'; 100 << 20]), "file_too_large"),
    ] {
        check_refused(what, &bytes, code);
    }
    let whole = dreame_inflated(b'I');
    let side = 2_000i16.to_le_bytes();
    for (what, inflated, code) in [
        ("changes", dreame_inflated(b'P'), "partial_map"),
        ("another frame", edited(&whole, 4, b"X"), "bad_robot_map"),
        ("cells of 3 mm", edited(&whole, 17, &[3, 0]), "bad_robot_map"),
        ("cells of -50 mm", edited(&whole, 17, &(-50i16).to_le_bytes()), "bad_robot_map"),
        ("a width of 2000", edited(&whole, 19, &side), "bad_robot_map"),
        ("a width of -8", edited(&whole, 19, &(-8i16).to_le_bytes()), "bad_robot_map"),
        ("a left beyond the sheet", edited(&whole, 23, &32_700i16.to_le_bytes()), "bad_field"),
        ("half a header", whole[..20].to_vec(), "bad_robot_map"),
    ] {
        check_refused(what, &dreame(&inflated), code);
    }
    check_refused("broken base64", &[&dreame(&whole)[..], b"=A"].concat(), "bad_robot_map");
    check_refused("half a text", &dreame(&whole)[..80], "bad_compression");
    check_refused("zlib of something else", &zlib(b"not a map"), "unknown_format");

    let viomi = viomi_inflated(77);
    for (what, inflated, code) in [
        ("no image", edited(&viomi, 0, &[1]), "unknown_format"),
        ("another number", edited(&viomi, 48, &[78]), "unknown_format"),
        ("a height of 2^32", edited(&viomi, 60, &[0xff; 4]), "unknown_format"),
        ("cells of no size", edited(&viomi, 84, &[0; 4]), "unknown_format"),
        ("half an image", viomi[..2_000].to_vec(), "bad_robot_map"),
    ] {
        check_refused(what, &zlib(&inflated), code);
    }
    let png = valetudo_png(&valetudo(true, true));
    check_refused("a picture", &png[..60], "image_without_yaml");
    check_refused("a chunk of 4 GB", &edited(&png, 8, &[0xff; 4]), "image_without_yaml");
    let at = png.windows(11).position(|w| w == b"ValetudoMap").unwrap() + 13;
    check_refused("a broken chunk", &edited(&png, at + 9, &[0xff; 8]), "bad_compression");
}

#[test]
fn pcd_files_and_logs_that_cannot_be_used_are_refused_by_name() {
    let good = String::from_utf8(pcd("ascii")).unwrap();
    let points = format!("POINTS {}", hits().len());
    for (what, from, to, code) in [
        ("no y", "x rgb y", "x rgb w", "bad_pcd"),
        ("no data", "DATA ascii", "DATE ascii", "bad_pcd"),
        ("data of its own", "DATA ascii", "DATA zip", "bad_pcd"),
        ("floats of 3 bytes", "SIZE 4", "SIZE 3", "bad_pcd"),
        ("one type too few", "TYPE F U", "TYPE F", "bad_pcd"),
        ("10^9 points", points.as_str(), "POINTS 1000000000", "too_many_points"),
        ("-1 points", points.as_str(), "POINTS -1", "bad_pcd"),
        ("one point too many", points.as_str(), "POINTS 27", "bad_pcd"),
        ("no point", points.as_str(), "POINTS 0", "no_walls"),
        ("10^9 numbers", "COUNT 1 1 1 1 2", "COUNT 1 1 1 1 1000000000", "bad_pcd"),
        ("a word", "-0.5 16744512", "one 16744512", "bad_pcd"),
    ] {
        assert!(good.contains(from), "{what}");
        check_refused(what, good.replacen(from, to, 1).as_bytes(), code);
    }
    let binary = pcd("binary");
    check_refused("half of it", &binary[..binary.len() - 30], "bad_pcd");
    let packed = pcd("binary_compressed");
    let body = packed.windows(11).position(|w| w == b"_compressed").unwrap() + 12;
    check_refused("10^9 bytes", &edited(&packed, body + 4, &1_000_000_000u32.to_le_bytes()), "bad_pcd");
    check_refused("a copy from before the beginning", &edited(&packed, body + 8, &[0xff]), "bad_pcd");
    check_refused("half of it", &packed[..packed.len() - 30], "bad_pcd");

    let log = String::from_utf8(carmen("FLASER")).unwrap();
    for (what, from, to, code) in [
        ("no scans", "FLASER", "RLASER", "bad_log"),
        ("10^9 readings", "FLASER 181", "FLASER 1000000000", "bad_log"),
        ("a word", "FLASER 181 1.", "FLASER 181 one 1.", "bad_log"),
        ("a cut line", "host 0.0\nODOM", "host 0.0\nFLASER 9 1 2\nODOM", "bad_log"),
        ("a pose on the moon", " 1 0.0 0.0", " 4e8 0.0 0.0", "bad_log"),
        ("a pose that is none", " 1 0.0 0.0", " nan 0.0 0.0", "bad_log"),
        ("a home of 9 km", " 1 0.0 0.0", " 9000 0.0 0.0", "too_many_cells"),
    ] {
        assert!(log.contains(from), "{what}");
        check_refused(what, log.replace(from, to).as_bytes(), code);
    }
    let new = String::from_utf8(carmen("ROBOTLASER1")).unwrap();
    check_refused("an angle of none", new.replace("-1.5707963", "inf").as_bytes(), "bad_log");
    check_refused("no range at all", b"FLASER 2 80 nan 0 0 0 0 0 0 1 host 1", "bad_log");
}
