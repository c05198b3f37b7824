//! The modes of the map card.

use super::*;
use crate::robot::area::MAX_RECTANGLES;
use crate::robot::calibration::Selection;
use crate::rooms::outline::contains;

fn modes(level: &RobotLevel) -> Vec<Value> {
    calibration(level, &image(level)).map_modes.iter().map(json_of).collect()
}

#[test]
fn each_mode_has_its_type_of_selection() {
    let modes = modes(&level(&LIDAR));
    let types: Vec<_> = modes.iter().map(|mode| (&mode["template"], &mode["selection_type"])).collect();
    let want = [
        (json!("vacuum_clean_segment"), json!("ROOM")),
        (json!("vacuum_clean_zone_predefined"), json!("PREDEFINED_RECTANGLE")),
        (json!("vacuum_goto_predefined"), json!("PREDEFINED_POINT")),
    ];
    assert_eq!(types, want.iter().map(|(template, of)| (template, of)).collect::<Vec<_>>());
}

/// The card sends the zones of all selections in one call; without `max_selections` it takes 999 of them (`map-mode.ts`).
#[test]
fn no_choice_has_more_zones_than_a_robot_takes() {
    let mut level = level(&LIDAR);
    let image = image(&level);
    // A room at an angle has the most rectangles.
    level.rooms[0].polygon_m = vec![[3.0, 1.0], [5.0, 2.5], [3.0, 4.0], [1.0, 2.5]];
    let mut most = 0;
    for mode in calibration(&level, &image).map_modes {
        let zones = |selection: &Selection| selection.zones.as_ref().map_or(0, Vec::len);
        let of_one = mode.predefined_selections.iter().map(zones).max().unwrap();
        let at_once = mode.max_selections.map_or(999, usize::from);
        assert!(of_one * at_once <= MAX_RECTANGLES, "{}: {of_one} zones, {at_once} at once", mode.template);
        most = most.max(of_one);
    }
    assert_eq!(most, MAX_RECTANGLES);
}

#[test]
fn segments_keep_their_cells_when_people_merge_and_split_rooms() {
    let own = [
        ("16", [[100.0, 900.0], [500.0, 900.0], [500.0, 600.0], [100.0, 600.0]]),
        ("17", [[510.0, 900.0], [810.0, 900.0], [810.0, 600.0], [510.0, 600.0]]),
    ];
    let merged =
        vec![Room { name: Some("Flat".to_owned()), ..Room::rectangle("16", [1.0, 1.0], [8.1, 4.0]) }];
    let split = vec![
        Room { name: Some("Flat".to_owned()), ..Room::rectangle("16", [1.0, 1.0], [4.0, 4.0]) },
        Room::rectangle("16-b", [4.0, 1.0], [5.0, 4.0]),
        Room::rectangle("17", [5.1, 1.0], [8.1, 4.0]),
    ];
    // A person must tell the segments of one room apart.
    for (rooms, names) in [(merged, ["Flat", "Flat 2"]), (split, ["Flat", "Room 17"])] {
        let modes = modes(&RobotLevel { rooms, ..level(&LIDAR) });
        let selections = modes[0]["predefined_selections"].as_array().unwrap();
        assert_eq!(selections.len(), 2);
        for ((selection, (id, outline)), name) in selections.iter().zip(own).zip(names) {
            assert_eq!((&selection["id"], &selection["outline"]), (&json!(id), &json!(outline)));
            assert_eq!(selection["label"]["text"], name);
            for part in ["label", "icon"] {
                let [x, y] = ["x", "y"].map(|axis| selection[part][axis].as_f64().unwrap());
                assert!(contains(&outline, &Point2::new(x, y)), "{selection}");
            }
        }
    }
}

/// The card's own examples (`docs/templates`) have these types.
#[test]
fn segments_have_numbers_as_ids_except_for_valetudo() {
    let mut lidar = LidarMap::read(&valetudo_map()).unwrap();
    for (format, ids) in [
        ("valetudo", [json!("16"), json!("17")]),
        ("roborock", [json!(16), json!(17)]),
        ("dreame", [json!(16), json!(17)]),
        ("viomi", [json!(16), json!(17)]),
    ] {
        lidar.info.format = format.to_owned();
        let modes = modes(&level(&lidar));
        let selections = modes[0]["predefined_selections"].as_array().unwrap();
        assert_eq!(selections.iter().map(|one| one["id"].clone()).collect::<Vec<_>>(), ids, "{format}");
    }
}

#[test]
fn rooms_without_a_name_are_called_by_their_number_in_their_level() {
    let mut level = level(&LIDAR);
    level.level = "upper".parse().unwrap();
    level.rooms[1].name = None;
    level.rooms[1].id = "upper~3".to_owned();
    level.objects[1].room = Some("upper~3".to_owned());
    for mode in modes(&level) {
        let selections = mode["predefined_selections"].as_array().unwrap();
        let names: Vec<&str> = selections.iter().map(|one| one["label"]["text"].as_str().unwrap()).collect();
        assert_eq!(names[..2], ["Kitchen", "Room 3"], "{mode}");
    }
    let matter = matter(&[level]);
    let names: Vec<&str> =
        matter.supported_areas.iter().map(|area| area.info.location_info.location_name.as_str()).collect();
    assert_eq!(names, ["Kitchen", "Room 3", "Kitchen: table", "Room 3: sofa"]);
}
