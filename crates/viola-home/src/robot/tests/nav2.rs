//! Nav2 files and the zones to avoid.

use super::*;
use crate::assemble::Tile;
use crate::map_point::MapPoint;
use crate::robot::no_go::{NoGoReason, no_go_zones};
use viola_reconstruct::{CloudPoint, Label};

/// Points on a plane of 1 m x 1 m from a corner on, 2.5 cm apart.
fn patch(class: Class, low: [f64; 2], z: f32) -> Tile {
    let point = |i: u32| MapPoint {
        point: CloudPoint {
            position_m: [
                (low[0] + f64::from(i % 40) * 0.025) as f32,
                (low[1] + f64::from(i / 40) * 0.025) as f32,
                z,
            ],
            normal: [0.0, 0.0, 1.0],
            color: [0; 3],
            label: Label::new(class, 0.8, 4),
            weight: 100,
        },
        clip: 0,
    };
    Tile { points: (0..1600).map(point).collect(), ..Tile::default() }
}

#[test]
fn zones_to_avoid_have_their_reasons() {
    let mut level = level(&LIDAR);
    level.objects.push(object("television-1", Class::Television, [1.2, 2.5], [1.0, 0.1, 1.2], "16"));
    let mut ground = Ground::new(&LIDAR);
    ground.add(&patch(Class::Stairs, [7.0, 1.2], -0.2));
    ground.add(&patch(Class::Rug, [3.0, 1.2], 0.02));
    // A blanket on a sofa is no rug.
    ground.add(&patch(Class::Rug, [6.0, 2.0], 0.5));
    let zones = no_go_zones(&level, &ground);
    let found: Vec<_> = zones.iter().map(|zone| (zone.reason, zone.object.as_deref(), zone.mask)).collect();
    assert_eq!(
        found,
        [
            (NoGoReason::RobotMap, None, 100),
            (NoGoReason::Stairs, None, 100),
            (NoGoReason::Cables, Some("television-1"), 100),
            (NoGoReason::LowFurniture, Some("sofa-1"), 100),
            (NoGoReason::Rug, None, 50),
        ]
    );
    // The user's zone is 600 to 650 cm from the left and 250 to 300 cm from the bottom.
    assert_eq!(zones[0].polygon_m, [[6.0, 3.0], [6.5, 3.0], [6.5, 2.5], [6.0, 2.5]]);
    let area = |polygon: &[[f64; 2]]| crate::rooms::outline::signed_area_m2(polygon).abs();
    assert!((area(&zones[1].polygon_m) - 1.0).abs() < 0.15, "{:?}", zones[1]);
    assert!((area(&zones[2].polygon_m) - 1.3 * 0.4).abs() < 1e-3);
    // The robot's map has floor below the sofa.
    assert_eq!(zones[3].driven, Some(1.0));
}

/// A rug of 3 m x 3 m around a square metre without one.
#[test]
fn a_rug_around_a_place_leaves_it_out() {
    let level = level(&LIDAR);
    let mut ground = Ground::new(&LIDAR);
    for (x, y) in (0..3).flat_map(|x| (0..3).map(move |y| (x, y))).filter(|at| *at != (1, 1)) {
        ground.add(&patch(Class::Rug, [1.0 + f64::from(x), 1.0 + f64::from(y)], 0.02));
    }
    let zones = no_go_zones(&level, &ground);
    let rug = zones.iter().find(|zone| zone.reason == NoGoReason::Rug).unwrap();
    let frame = LIDAR.cells.as_ref().unwrap().frame;
    let mut cells = 0;
    for_cells(&frame, &rug.rings(), |index| {
        let at = frame.centre(index % frame.width, index / frame.width);
        assert!((at - Point2::new(2.5, 2.5)).norm() > 0.4, "{at:?}");
        cells += 1;
    });
    let area_m2 = f64::from(cells) * frame.cell_m * frame.cell_m;
    assert!((area_m2 - 8.0).abs() < 0.5, "{area_m2}");
}

/// Nav2's own conversion (`map_io.cpp`) with the thresholds of the files: hundredths of the darkness between them, or
/// the grey value.
fn occupancy(grey: u8, mode: &str) -> i32 {
    let dark = 1.0 - f64::from(grey) / 255.0;
    match mode {
        "scale" if dark > 0.999 => 100,
        "scale" if dark < 0.001 => 0,
        "scale" => ((dark - 0.001) / (0.999 - 0.001) * 100.0).round_ties_even() as i32,
        _ if grey <= 100 => i32::from(grey),
        _ => -1,
    }
}

#[test]
fn nav2_files_are_read_back() {
    let level = level(&LIDAR);
    let mut ground = Ground::new(&LIDAR);
    ground.add(&patch(Class::Rug, [3.0, 1.2], 0.02));
    let files = nav2_files(&level, &ground).unwrap();
    let read = |names: [&str; 2]| {
        let pair: Vec<_> = files.iter().filter(|(name, _)| names.contains(name)).cloned().collect();
        LidarMap::read(&nav2_zip(&pair)).unwrap()
    };
    let map = read(["map.yaml", "map.pgm"]);
    let keepout = read(["keepout_mask.yaml", "keepout_mask.pgm"]);
    let mut want = LIDAR.cells.clone().unwrap();
    want.frame.origin_m = want.frame.written_origin_m();
    assert_eq!(map.cells, Some(want));
    // Forbidden cells are occupied for the reader: the sofa and the user's zone.
    for (at, want) in [([6.6, 3.5], Cell::Occupied), ([6.2, 2.7], Cell::Occupied), ([3.0, 2.5], Cell::Free)] {
        assert_eq!(keepout.cells.as_ref().unwrap().at(&Point2::from(at)), Some(want), "{at:?}");
    }
    let find = |name: &str| &files.iter().find(|(other, _)| *other == name).unwrap().1;
    let cells = LIDAR.cells.as_ref().unwrap();
    let value = |name: &str, mode: &str, at: [f64; 2]| {
        let head = format!("P5\n{} {}\n255\n", cells.frame.width, cells.frame.height);
        let pixels = find(name).strip_prefix(head.as_bytes()).unwrap();
        let (x, y) = cells.frame.cell(&Point2::from(at)).unwrap();
        occupancy(pixels[(cells.frame.height - 1 - y) * cells.frame.width + x], mode)
    };
    for (at, class, room, keepout) in [
        ([6.6, 3.5], Class::Sofa, 2, 100),
        ([3.0, 2.5], Class::Table, 1, 0),
        ([3.5, 1.5], Class::Floor, 1, 50),
        ([5.05, 1.2], Class::Wall, 0, 0),
    ] {
        assert_eq!(value("semantic_mask.pgm", "raw", at), i32::from(class.id()), "{at:?}");
        assert_eq!(value("room_mask.pgm", "raw", at), room, "{at:?}");
        assert_eq!(value("keepout_mask.pgm", "scale", at), keepout, "{at:?}");
    }
    let yaml = String::from_utf8(find("keepout_mask.yaml").clone()).unwrap();
    let [x_m, y_m] = cells.frame.written_origin_m();
    assert!(
        yaml.contains("mode: scale\n")
            && yaml.contains("occupied_thresh: 0.999\nfree_thresh: 0.001\n")
            && yaml.contains(&format!("origin: [{x_m:?}, {y_m:?}, 0.0]\n")),
        "{yaml}"
    );
    let goals: Value = serde_json::from_slice(find("goals.json")).unwrap();
    assert_eq!(goals["goals"].as_array().unwrap().len(), 4);
    assert_eq!(
        (&goals["goal_area"]["is_at_dock"], &goals["goal_area"]["reason"]),
        (&json!(true), &Value::Null)
    );
    assert_eq!(nav2_zip(&files), nav2_zip(&nav2_files(&level, &ground).unwrap()));
    assert!(nav2_zip(&files).starts_with(b"PK"));
}
