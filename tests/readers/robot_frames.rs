//! The coordinates of robots: the dock's place as its file has it.

use crate::maps_real::recorded;
use crate::robot_files::{dreame, dreame_inflated, roborock, viomi_inflated, zlib};
use crate::writers::zip_bytes;
use serde_json::Value;
use viola_formats::lidar::{LidarMap, RobotFrame, valetudo_json};

fn dock(map: &LidarMap) -> [f64; 2] {
    let dock = map.charger.unwrap();
    [dock.x_m, dock.y_m]
}

/// The docks of the drawn files, in the units of each: millimetres, and metres for Viomi.
#[test]
fn a_dock_has_the_coordinates_of_its_file() {
    for (name, file, unit, want) in [
        ("roborock", roborock(), "mm", [2_300.0, 5_050.0]),
        ("dreame", dreame(&dreame_inflated(b'I')), "mm", [-1_700.0, -900.0]),
        ("viomi", zlib(&viomi_inflated(7)), "m", [-18.7, -19.45]),
    ] {
        let map = LidarMap::read(&file).unwrap();
        let own = map.frames.own;
        let found = own.from_map(dock(&map));
        // Readers round to a centimetre, as Valetudo does.
        let off_m = [0, 1].map(|axis| (found[axis] - want[axis]) / own.units_per_m);
        assert!(off_m.iter().all(|off_m| off_m.abs() <= 0.0101), "{name}: {found:?}");
        assert_eq!((own.unit(), own.is_y_down), (unit, false), "{name}");
        let back = own.to_map(found);
        assert!((0..2).all(|axis| (back[axis] - dock(&map)[axis]).abs() < 1e-9), "{name}: {back:?}");
        // None of them is Valetudo's JSON.
        assert_eq!(valetudo_json(&file), None, "{name}");
    }
}

/// A corner of the sheet, in centimetres from its upper-left corner.
#[test]
fn valetudo_counts_down_from_the_upper_left_corner() {
    let json = br#"{"size":{"x":400,"y":300},"pixelSize":5,
        "layers":[{"type":"wall","compressedPixels":[0,0,1, 79,59,1]}]}"#;
    let map = LidarMap::read(json).unwrap();
    let frame = map.frames.own;
    assert_eq!(map.frames.valetudo, Some(frame));
    assert_eq!((frame.unit(), frame.is_y_down), ("cm", true));
    for (point_m, want) in [
        ([0.0, 3.0], [0.0, 0.0]),
        ([0.0, 0.0], [0.0, 300.0]),
        ([4.0, 0.0], [400.0, 300.0]),
        ([1.234, 1.0], [123.0, 200.0]),
    ] {
        assert_eq!(frame.rounded(point_m), want);
    }
    assert_eq!(RobotFrame::MAP.rounded([1.23456, -2.0]), [1.235, -2.0]);
    assert_eq!(valetudo_json(json).as_deref(), Some(&json[..]));
    let zipped = |files: &[&str]| {
        zip_bytes(&files.iter().map(|name| (name.to_string(), json.to_vec())).collect::<Vec<_>>())
    };
    let one = zipped(&["home/map.json"]);
    assert!(LidarMap::read(&one).unwrap().frames.valetudo.is_some());
    assert_eq!(valetudo_json(&one).as_deref(), Some(&json[..]));
    for other in [zipped(&["a.json", "b.json"]), zip_bytes(&[("map.zip".to_string(), one)])] {
        assert_eq!(valetudo_json(&other), None);
    }
}

/// Valetudo's own conversion of real maps: its JSON has the dock in its coordinates.
#[test]
fn docks_of_real_maps_are_where_valetudo_has_them() {
    let Some(maps) = recorded("json") else { return };
    let mut docks = 0;
    for (_, path) in maps {
        let json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let map = LidarMap::open(&path.with_extension("bin")).unwrap();
        let entities = json["entities"].as_array().unwrap();
        let Some(dock_cm) = entities.iter().find(|entity| entity["type"] == "charger_location") else {
            continue;
        };
        docks += 1;
        let want = [0, 1].map(|axis| dock_cm["points"][axis].as_f64().unwrap());
        let frame = map.frames.valetudo.unwrap();
        assert_eq!(frame.rounded(dock(&map)), want, "{}", path.display());
    }
    assert!(docks >= 8, "{docks}");
}
