//! Plans of rooms that people merged and divided, and of the robot's rooms with a doorway in them.

use super::unfilmed::cells_of;
use super::*;
use crate::corrections::{RoomCorrection, RoomMerge, RoomSplit};
use crate::describe::{Description, describe_revised};
use crate::points::ClipNumbers;
use viola_formats::lidar::Room as RobotRoom;
use viola_geometry::progress::Silent;

/// Returns the description of a map with a correction of its first room, and with an object.
fn corrected(lidar: &LidarMap, correction: RoomCorrection, thing: Option<Object>) -> Description {
    let revise = |rooms: &mut Vec<Room>, objects: &mut Vec<Object>| {
        objects.extend(thing);
        crate::correct_rooms(rooms, &[("1".to_owned(), correction)]).divisions
    };
    describe_revised(lidar, &[], &ClipNumbers::new(std::iter::empty()), revise, &Silent).unwrap()
}

fn merged(lidar: &LidarMap) -> Description {
    let merge = RoomMerge { with_m: vec![[5.5, 1.5]], order: 1 };
    corrected(lidar, RoomCorrection { name: None, merge: Some(merge), split: None, at_m: [2.0, 1.5] }, None)
}

#[test]
fn a_person_divides_a_computed_room_by_an_oblique_line() {
    let lidar = flat(0.0);
    assert!(crate::rooms(&lidar, &[]).iter().all(|room| room.source == RoomSource::Computed));
    let [from, to] = [[1.0, 0.0], [3.0, 3.0]];
    let split = RoomSplit { from_m: from, to_m: to, order: 1 };
    let correction = RoomCorrection { name: None, merge: None, split: Some(split), at_m: [1.0, 2.0] };
    let bed = object(Class::Bed, 1.7, 0.0);
    let Description { rooms, plan, .. } = corrected(&lidar, correction, Some(bed));
    let ids: Vec<&str> = rooms.iter().map(|room| room.id.as_str()).collect();
    assert_eq!(ids, ["1", "1-b", "2"]);
    let length_m = 13.0f64.sqrt();
    for (room, side) in rooms.iter().zip([1.0, -1.0]) {
        // The line halves the room of 4 m x 3 m, whose faces are in a raster of 5 cm.
        assert!((room.area_m2 - 6.0).abs() < 0.3, "{room:?}");
        let left_m =
            |p: &[f64; 2]| ((to[0] - from[0]) * p[1] - (to[1] - from[1]) * (p[0] - from[0])) / length_m;
        assert!(room.polygon_m.iter().all(|corner| side * left_m(corner) > -0.002), "{room:?}");
        let on_line = room.polygon_m.iter().filter(|corner| left_m(corner).abs() < 0.002);
        assert_eq!(on_line.count(), 2, "{room:?}");
        let drawn: Vec<&PlanRoom> =
            plan.rooms.iter().filter(|drawn| drawn.id.as_ref() == Some(&room.id)).collect();
        assert!(drawn.len() == 1 && (drawn[0].area_m2 - room.area_m2).abs() < 0.006, "{drawn:?}");
    }
    // The line crosses the bed.
    assert_eq!(plan.furniture.len(), 1, "{:?}", plan.furniture);
    for (x, part, other) in [(0.0, "1", "1-b"), (4.05, "1-b", "1")] {
        let is_at = |wall: &&Wall| [wall.from_m, wall.to_m].iter().all(|end| (end[0] - x).abs() < 0.3);
        let wall = plan.walls.iter().find(is_at).expect("the room has a wall there");
        let beside: Vec<&str> = wall.rooms.iter().filter_map(|at| plan.rooms[*at].id.as_deref()).collect();
        assert!(beside.contains(&part) && !beside.contains(&other), "{wall:?} {beside:?}");
    }
}

#[test]
fn the_doorway_of_rooms_that_people_merged_is_an_opening_of_one_room() {
    let Description { rooms, plan, .. } = merged(&flat(0.0));
    assert_eq!((rooms.len(), plan.rooms.len()), (1, 1), "{:?}", plan.rooms);
    assert_eq!(plan.rooms[0].id.as_deref(), Some("1"));
    assert!((plan.rooms[0].area_m2 - 21.1).abs() < 0.8, "{}", plan.rooms[0].area_m2);
    // The wall beside the doorway stays.
    assert!(!plan.rooms[0].contains([4.05, 0.5]) && plan.rooms[0].contains([4.05, 1.4]));
    // As for two rooms: a door that does not interrupt its wall.
    assert_eq!(plan.openings.len(), 1, "{:?}", plan.openings);
    let door = &plan.openings[0];
    assert!(door.kind == OpeningKind::Door && (door.width_m() - 0.8).abs() < 0.16, "{door:?}");
    let between: Vec<&Wall> = plan.walls.iter().filter(|wall| wall.is_measured).collect();
    assert!(between.len() == 1 && (between[0].length_m() - 3.0).abs() < 0.15, "{between:?}");
}

/// Two rooms of 3 m by 5 m with a wall of one row of cells, or of two, and doors in it.
#[test]
fn a_thin_wall_between_rooms_that_people_merged_stays() {
    for (thickness_m, pieces, doors) in
        [(0.05, [0.0..1.2, 2.0..5.0].as_slice(), 1), (0.1, [0.9..4.1].as_slice(), 2)]
    {
        let is_wall = |y: f64| pieces.iter().any(|piece| piece.contains(&y));
        let inner = 3.0..3.0 + thickness_m;
        let lidar = cells_of([6.0 + thickness_m, 5.0], |x, y| inner.contains(&x) && is_wall(y));
        let Description { rooms, plan, .. } = merged(&lidar);
        assert_eq!((rooms.len(), plan.rooms.len()), (1, 1), "{:?}", plan.rooms);
        let kinds: Vec<OpeningKind> = plan.openings.iter().map(|opening| opening.kind).collect();
        assert_eq!(kinds, vec![OpeningKind::Door; doors], "{:?}", plan.openings);
        assert!(plan.walls.iter().any(|wall| wall.is_measured), "{:?}", plan.walls);
    }
}

#[test]
fn rooms_that_people_merged_across_a_wall_keep_the_floor_of_both() {
    let x = [4.0, 4.1].map(|x| [[x, 0.0], [x, 3.0]]);
    let mut walls = ring(&[[0.0, 0.0], [7.1, 0.0], [7.1, 3.0], [0.0, 3.0]]);
    walls.extend(x);
    let lidar = lidar_of(&walls);
    assert_eq!(crate::rooms(&lidar, &[]).len(), 2);
    let Description { rooms, plan, .. } = merged(&lidar);
    assert_eq!(rooms.len(), 1);
    assert!((rooms[0].area_m2 / 21.0 - 1.0).abs() < 0.15, "{}", rooms[0].area_m2);
    for place in [[2.0, 1.5], [5.5, 1.5]] {
        assert!(rooms[0].contains(&Point2::from(place)), "{place:?}");
    }
    // The wall stands, so the plan has both parts of the room.
    let ids: Vec<_> = plan.rooms.iter().map(|room| room.id.as_deref()).collect();
    assert_eq!(ids, [Some("1"), Some("1")]);
    assert!(plan_svg(&plan).contains(">1 room, "));
    let json = plan_geojson(&plan);
    let features = json["features"].as_array().unwrap().iter();
    let parts: Vec<_> = features.filter(|feature| feature["properties"]["kind"] == "room").collect();
    assert!(parts.len() == 2 && parts[0]["id"] != parts[1]["id"], "{parts:?}");
}

/// A segment of the robot may be on both sides of what looks like a doorway, as of a narrow place of a corridor.
#[test]
fn a_gap_in_a_room_of_the_robot_divides_nothing() {
    let mut lidar = flat(0.0);
    let cells =
        (0..138).flat_map(|i| (0..56).map(move |j| [0.125 + 0.05 * i as f64, 0.125 + 0.05 * j as f64]));
    let is_floor = |p: &[f64; 2]| !(3.9..4.2).contains(&p[0]) || (1.1..1.7).contains(&p[1]);
    let cells_m = cells.filter(is_floor).map(Point2::from).collect();
    lidar.rooms = vec![RobotRoom { id: "5".to_owned(), name: None, cells_m, material: None }];
    let numbers = ClipNumbers::new(std::iter::empty());
    let Description { rooms, plan, .. } = crate::describe(&lidar, &[], &numbers, &Silent).unwrap();
    assert_eq!((rooms.len(), plan.rooms.len()), (1, 1), "{:?}", plan.rooms);
    assert_eq!(plan.rooms[0].id.as_deref(), Some("5"));
    assert!((rooms[0].area_m2 - 21.1).abs() < 0.8, "{}", rooms[0].area_m2);
}
