//! Walls that clips filmed, and walls that are in the LiDAR map only.

use super::super::*;
use super::upright;
use crate::rooms::tests::flat;
use viola_geometry::taxonomy::Class;

const LEGEND: &str = "not filmed: by the LiDAR map only";

/// Returns the points of an upright surface above a line: 2.5 cm apart along it, up to 2.35 m.
fn sheet(class: Class, from_m: [f64; 2], to_m: [f64; 2], normal: [f32; 3]) -> Vec<MapPoint> {
    upright(class, [from_m, to_m], normal, 0.025, (0.15, 23))
}

/// Returns the points of both long walls, of the left half of the wall at x = 0, and of the wall between the rooms.
fn points() -> Vec<MapPoint> {
    [
        sheet(Class::Wall, [0.0, 0.0], [7.1, 0.0], [0.0, 1.0, 0.0]),
        sheet(Class::Wall, [0.0, 3.0], [7.1, 3.0], [0.0, -1.0, 0.0]),
        sheet(Class::Other, [0.0, 0.0], [0.0, 1.5], [1.0, 0.0, 0.0]),
        sheet(Class::Wall, [4.0, 0.0], [4.0, 1.0], [-1.0, 0.0, 0.0]),
        sheet(Class::Wall, [4.0, 1.8], [4.0, 3.0], [-1.0, 0.0, 0.0]),
    ]
    .concat()
}

fn plan_of(points: &[MapPoint]) -> Plan {
    let lidar = flat(0.0);
    plan(&lidar, points, &crate::rooms(&lidar, points), &[])
}

#[test]
fn a_wall_tells_the_fraction_that_clips_filmed() {
    let plan = plan_of(&points());
    let mut unfilmed = 0;
    for wall in &plan.walls {
        let [x, y] = [0, 1].map(|axis| (wall.to_m[axis] - wall.from_m[axis]).abs());
        let at_m = (wall.from_m[0] + wall.to_m[0]) / 2.0;
        let fraction = match at_m {
            _ if x > y => 1.0,
            at_m if at_m < 1.0 => 0.5,
            // The door in it does not count.
            at_m if at_m < 5.0 => 1.0,
            _ => {
                // The surface of the walls at its corners is not its own.
                assert_eq!(wall.filmed_fraction, 0.0, "{wall:?}");
                unfilmed += 1;
                continue;
            }
        };
        assert!((wall.filmed_fraction - fraction).abs() < 0.1, "{fraction} {wall:?}");
    }
    assert_eq!(unfilmed, 1, "{:?}", plan.walls);
}

#[test]
fn walls_that_are_in_the_lidar_map_only_look_different() {
    let plan = plan_of(&points());
    let svg = plan_svg(&plan);
    assert!(svg.contains("<g id=\"unfilmed-walls\"") && svg.contains(&format!(">{LEGEND}</text>")));
    // The right wall without its corners, which belong to the long walls.
    let unfilmed_m2: f64 = plan.unfilmed_masonry.iter().map(Outline::area_m2).sum();
    assert!((unfilmed_m2 - 3.0 * 0.2).abs() < 0.1, "{unfilmed_m2}");
    let picture = image::load_from_memory(&plan_png(&plan)).unwrap().to_rgb8();
    let frame = PlanImage::of(&plan);
    for (place_m, color) in [([7.2, 1.5], [0xb4, 0xbb, 0xc6]), ([-0.1, 1.5], [0x2f, 0x34, 0x3d])] {
        let [x, y] = frame.pixel(place_m);
        assert_eq!(picture.get_pixel(x as u32, y as u32).0, color, "{place_m:?}");
    }
    let dxf = plan_dxf(&plan);
    assert_eq!(dxf.matches("\nLINE\n8\nWALL_LINES_UNFILMED\n").count(), 1);
    assert_eq!(dxf.matches("\nLINE\n8\nWALL_LINES\n").count(), plan.walls.len() - 1);
    assert_eq!(dxf.matches("\nPOLYLINE\n8\nWALLS_UNFILMED\n").count(), plan.unfilmed_masonry.len());
    let (json, geojson) = (plan_json(&plan), plan_geojson(&plan));
    let lines = geojson["features"].as_array().unwrap().iter().map(|feature| &feature["properties"]);
    let lines: Vec<_> = lines.filter(|properties| properties["kind"] == "wall_line").collect();
    assert_eq!(lines.len(), plan.walls.len());
    for (at, wall) in plan.walls.iter().enumerate() {
        assert_eq!(json["walls"][at]["filmed_fraction"], wall.filmed_fraction);
        assert_eq!(lines[at]["filmed_fraction"], wall.filmed_fraction);
    }
}

/// Clips filmed the left room only: more than half of the long walls.
#[test]
fn a_facade_is_drawn_by_its_rooms() {
    let left = [
        sheet(Class::Wall, [0.0, 0.0], [4.0, 0.0], [0.0, 1.0, 0.0]),
        sheet(Class::Wall, [0.0, 3.0], [4.0, 3.0], [0.0, -1.0, 0.0]),
        sheet(Class::Wall, [0.0, 0.0], [0.0, 3.0], [1.0, 0.0, 0.0]),
        sheet(Class::Wall, [4.0, 0.0], [4.0, 1.0], [-1.0, 0.0, 0.0]),
        sheet(Class::Wall, [4.0, 1.8], [4.0, 3.0], [-1.0, 0.0, 0.0]),
    ];
    let plan = plan_of(&left.concat());
    // Both long walls beside the right room, and the right wall with its corners.
    let unfilmed_m2: f64 = plan.unfilmed_masonry.iter().map(Outline::area_m2).sum();
    let want_m2 = 0.2 * (2.0 * 3.05 + 3.0 + 2.0 * 0.2);
    assert!((unfilmed_m2 - want_m2).abs() < 0.2, "{unfilmed_m2} {want_m2}");
}

#[test]
fn a_home_without_clips_is_drawn_in_one_colour() {
    let plan = plan_of(&[]);
    assert!(plan.walls.iter().all(|wall| wall.filmed_fraction == 0.0) && plan.unfilmed_masonry.is_empty());
    let (svg, dxf) = (plan_svg(&plan), plan_dxf(&plan));
    assert!(!svg.contains("unfilmed-walls") && !svg.contains(LEGEND));
    assert!(!dxf.contains("\n8\nWALLS_UNFILMED\n") && !dxf.contains("\n8\nWALL_LINES_UNFILMED\n"));
}
