//! Plans with walls that are not along the home's main directions.

use super::super::*;
use super::{lidar_of, ring};
use geo::{Area, BooleanOps, LineString, MultiPolygon, Polygon};

/// The oblique wall: 16.7 degrees off the axis.
const THICKNESS_M: f64 = 0.12;
/// Ends of its left face.
const FACE: [[f64; 2]; 2] = [[3.0, 0.0], [4.2, 4.0]];

/// Two rooms with a cut corner, divided by an oblique wall with a door of 0.8 m.
fn slanted() -> LidarMap {
    let outer = [[0.0, 0.0], [10.0, 0.0], [10.0, 2.5], [8.8, 4.0], [0.0, 4.0]];
    let mut walls = ring(&outer);
    // Both faces and what is between them: no floor is seen in the wall.
    for shift_m in [0.0, 0.03, 0.06, 0.09, THICKNESS_M] {
        let at = |part: f64| [3.0 + 1.2 * part + shift_m * 1.044, 4.0 * part];
        walls.extend([[at(0.0), at(0.4)], [at(0.4 + 0.8 / 4.176), at(1.0)]]);
    }
    lidar_of(&walls)
}

fn polygon(outline: &Outline) -> Polygon {
    let ring = |ring: &Vec<[f64; 2]>| LineString::from(ring.clone());
    Polygon::new(ring(&outline.ring_m), outline.holes_m.iter().map(ring).collect())
}

/// Returns the angle of a way to the first axis, in 0..180 degrees.
fn angle_deg(from_m: [f64; 2], to_m: [f64; 2]) -> f64 {
    (to_m[1] - from_m[1]).atan2(to_m[0] - from_m[0]).to_degrees().rem_euclid(180.0)
}

#[test]
fn oblique_walls_are_straight_and_close_their_rooms() {
    let lidar = slanted();
    let rooms = crate::rooms(&lidar, &[]);
    let plan = plan(&lidar, &[], &rooms, &[]);
    let turned_deg = plan.map_from_plan.yaw_rad.to_degrees();
    assert!(turned_deg.abs() < 0.6, "{turned_deg}");
    assert_eq!(plan.rooms.len(), 2, "{:?}", plan.rooms);
    // Trapezoids of the drawing above; the second one lacks a triangle.
    let left_m2 = (3.0 + 4.2) / 2.0 * 4.0;
    let right_m2 = 40.0 - left_m2 - 4.0 * THICKNESS_M * 1.044 - 1.2 * 1.5 / 2.0;
    for (room, (area_m2, corners)) in plan.rooms.iter().zip([(right_m2, 5), (left_m2, 4)]) {
        assert!((room.area_m2 / area_m2 - 1.0).abs() < 0.03, "{} {area_m2}", room.area_m2);
        assert_eq!(room.outline.ring_m.len(), corners, "{:?}", room.outline.ring_m);
    }
    let off_axis = |wall: &&Wall| {
        let off_deg = angle_deg(wall.from_m, wall.to_m) % 90.0;
        (2.0..88.0).contains(&off_deg)
    };
    let oblique: Vec<&Wall> = plan.walls.iter().filter(off_axis).collect();
    let mut angles: Vec<f64> = oblique.iter().map(|wall| angle_deg(wall.from_m, wall.to_m)).collect();
    angles.sort_by(f64::total_cmp);
    assert_eq!(angles.len(), 2, "{angles:?}");
    for (angle_deg, true_deg) in angles.iter().zip([73.3, 128.66]) {
        assert!((angle_deg - true_deg).abs() < 1.5, "{angles:?}");
    }
    let between = oblique.iter().find(|wall| wall.is_measured).unwrap();
    assert!(between.rooms == [0, 1] && (between.thickness_m - THICKNESS_M).abs() < 0.05, "{between:?}");
    assert_eq!(plan.openings.len(), 1, "{:?}", plan.openings);
    let door = &plan.openings[0];
    assert!((door.width_m() - 0.8).abs() < 0.16, "{door:?}");
    assert!((angle_deg(door.from_m, door.to_m) - angle_deg(FACE[0], FACE[1])).abs() < 1.5, "{door:?}");
}

#[test]
fn masonry_of_oblique_walls_leaves_rooms_and_doors_free() {
    let lidar = slanted();
    let plan = plan(&lidar, &[], &crate::rooms(&lidar, &[]), &[]);
    let masonry = MultiPolygon(plan.masonry.iter().map(polygon).collect());
    let free: Vec<Polygon> = plan.rooms.iter().map(|room| polygon(&room.outline)).collect();
    for room in &free {
        assert!(masonry.intersection(room).unsigned_area() < 1e-3);
    }
    assert!(free[0].intersection(&free[1]).unsigned_area() < 1e-6);
    // The door is free, and no stairs are left: they would have dozens of short sides.
    let door = &plan.openings[0];
    assert!(
        masonry
            .intersection(&polygon(&Outline { ring_m: door.corners_m().to_vec(), holes_m: Vec::new() }))
            .unsigned_area()
            < 1e-3
    );
    let corners: usize = plan.masonry.iter().map(|outline| outline.ring_m.len()).sum();
    assert!(corners <= 24, "{:?}", plan.masonry);
}

/// Rows of points across a wall: no floor is seen in it.
const ROWS_M: [f64; 5] = [0.0, 0.03, 0.06, 0.09, THICKNESS_M];

/// Two rooms in a row of 30 m by 3 m, with a door between them, and a wing of four rooms that is turned by 75 degrees. The
/// second value has places of the wing in the map.
fn with_wing() -> (LidarMap, impl Fn(f64, f64) -> [f64; 2]) {
    let mut walls = vec![[[0.0, 0.0], [0.0, 3.0]], [[30.0, 0.0], [30.0, 3.0]]];
    let (sin, cos) = 75f64.to_radians().sin_cos();
    let at = move |u: f64, v: f64| [40.0 + cos * u - sin * v, 6.0 + sin * u + cos * v];
    walls.extend(ring(&[at(0.0, 0.0), at(24.0, 0.0), at(24.0, 4.0), at(0.0, 4.0)]));
    for row_m in ROWS_M {
        // The long walls make their direction the plan's.
        walls.extend([-row_m, 3.0 + row_m].map(|y| [[0.0, y], [30.0, y]]));
        let x = 12.0 + row_m;
        walls.extend([[[x, 0.0], [x, 1.0]], [[x, 1.8], [x, 3.0]]]);
        walls.extend([6.0, 12.0, 18.0].map(|u| [at(u + row_m, 0.0), at(u + row_m, 4.0)]));
    }
    (lidar_of(&walls), at)
}

/// The stairs of the wing need more than 400 lines across y. The edges of the door come after them.
#[test]
fn a_turned_wing_leaves_a_door_its_lines() {
    let (lidar, in_wing) = with_wing();
    let plan = plan(&lidar, &[], &crate::rooms(&lidar, &[]), &[]);
    assert!(plan.map_from_plan.yaw_rad.to_degrees().abs() < 0.2);
    assert_eq!(plan.openings.len(), 1, "{:?}", plan.openings);
    let door = &plan.openings[0];
    assert!((door.width_m() - 0.8).abs() < 0.16 && (door.from_m[0] - 12.06).abs() < 0.1, "{door:?}");
    let area_m2 = |place: [f64; 2]| {
        let room = plan.rooms.iter().find(|room| room.contains(place));
        room.map_or(0.0, |room| room.area_m2)
    };
    let inner_m2 = 4.0 * (6.0 - THICKNESS_M);
    for (place, true_m2) in [
        ([6.0, 1.5], 36.0),
        ([20.0, 1.5], 53.64),
        (in_wing(3.0, 2.0), 24.0),
        (in_wing(9.06, 2.0), inner_m2),
        (in_wing(15.06, 2.0), inner_m2),
        (in_wing(21.06, 2.0), inner_m2),
    ] {
        assert!((area_m2(place) / true_m2 - 1.0).abs() < 0.05, "{} {true_m2}", area_m2(place));
    }
}
