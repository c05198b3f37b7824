//! Plans with corridors, beams and recesses.

use super::super::*;
use super::{lidar_of, point, ring};
use viola_geometry::taxonomy::Class;
use viola_reconstruct::Label;

/// A corridor of 1.2 m by 8 m with two rooms on each side; the walls between the rooms are in one line.
fn corridor() -> LidarMap {
    let mut walls = ring(&[[0.0, 0.0], [8.4, 0.0], [8.4, 8.0], [0.0, 8.0]]);
    // Both faces of the corridor's walls and what is between them, with a door to each room.
    for x in [3.51, 3.535, 3.56, 3.585, 3.61, 4.81, 4.835, 4.86, 4.885, 4.91] {
        walls.extend([[[x, 0.0], [x, 1.5]], [[x, 2.3], [x, 5.5]], [[x, 6.3], [x, 8.0]]]);
    }
    for y in [3.96, 3.985, 4.01, 4.035, 4.06] {
        walls.extend([[[0.0, y], [3.51, y]], [[4.91, y], [8.4, y]]]);
    }
    lidar_of(&walls)
}

#[test]
fn walls_in_one_line_do_not_divide_a_corridor() {
    let lidar = corridor();
    let plan = plan(&lidar, &[], &crate::rooms(&lidar, &[]), &[]);
    assert_eq!((plan.rooms.len(), plan.openings.len()), (5, 4), "{:?}", plan.openings);
    let corridor = plan.rooms.iter().find(|room| room.contains([4.2, 1.0])).unwrap();
    assert!(corridor.contains([4.2, 7.0]) && (corridor.area_m2 - 9.6).abs() < 0.5, "{corridor:?}");
}

#[test]
fn a_room_ends_at_the_recess_of_its_window() {
    let recess = [[2.6, 3.0], [2.6, 3.3], [1.2, 3.3], [1.2, 3.0]];
    let corners = [&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]][..], &recess, &[[0.0, 3.0]]].concat();
    let lidar = lidar_of(&ring(&corners));
    let panes = (0..28).flat_map(|i| (0..40).map(move |j| [1.2 + 0.05 * i as f64, 0.2 + 0.05 * j as f64]));
    let window: Vec<MapPoint> =
        panes.map(|[x, z]| point([x, 3.3, z], [0.0, -1.0, 0.0], Class::Window)).collect();
    let area_m2 = |points: &[MapPoint]| {
        let plan = plan(&lidar, points, &crate::rooms(&lidar, points), &[]);
        assert_eq!(plan.rooms.len(), 1);
        (plan.rooms[0].area_m2, plan)
    };
    let (bare_m2, _) = area_m2(&[]);
    assert!((bare_m2 - 12.42).abs() < 0.3, "{bare_m2}");
    let (closed_m2, plan) = area_m2(&window);
    assert!((closed_m2 - 12.0).abs() < 0.2, "{closed_m2}");
    assert_eq!(plan.openings.len(), 1);
    let opening = &plan.openings[0];
    assert!(opening.kind == OpeningKind::Window && (opening.from_m[1] - 3.1).abs() < 0.06, "{opening:?}");
}

/// Returns points of a face across x, 5 cm apart.
pub(super) fn face(x: f64, up: bool, ys: [f64; 2], zs: [f64; 2]) -> Vec<MapPoint> {
    let count = |[low, high]: [f64; 2]| ((high - low) / 0.05) as usize;
    let normal = [if up { 1.0 } else { -1.0 }, 0.0, 0.0];
    let at = |i: usize, j: usize| [x, ys[0] + 0.05 * i as f64, zs[0] + 0.05 * j as f64];
    (0..count(ys)).flat_map(|i| (0..count(zs)).map(move |j| point(at(i, j), normal, Class::Wall))).collect()
}

#[test]
fn a_wall_of_one_row_of_points_divides_two_rooms() {
    let mut walls = ring(&[[0.0, 0.0], [7.0, 0.0], [7.0, 3.0], [0.0, 3.0]]);
    walls.extend([[[4.0, 0.0], [4.0, 1.1]], [[4.0, 1.9], [4.0, 3.0]]]);
    let lidar = lidar_of(&walls);
    // Noise reverses the faces.
    let mut points = Vec::new();
    for ys in [[0.0, 1.1], [1.9, 3.0]] {
        points.extend(face(4.01, false, ys, [0.1, 2.5]));
        points.extend(face(3.99, true, ys, [0.1, 2.5]));
    }
    let plan = plan(&lidar, &points, &crate::rooms(&lidar, &points), &[]);
    assert_eq!((plan.rooms.len(), plan.openings.len()), (2, 1), "{:?}", plan.openings);
    assert!((plan.openings[0].width_m() - 0.8).abs() < 0.16, "{:?}", plan.openings);
    assert!((plan.rooms[0].area_m2 - 12.0).abs() < 0.5 && (plan.rooms[1].area_m2 - 9.0).abs() < 0.5);
}

/// The clips called the wardrobe's front wall, and saw the wall above it.
#[test]
fn a_room_does_not_end_at_a_wardrobe() {
    let outer = [[0.6, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0], [0.0, 1.5], [0.6, 1.5]];
    let lidar = lidar_of(&ring(&outer));
    let mut points = face(0.6, true, [0.0, 1.5], [0.1, 1.8]);
    let area_m2 = |points: &[MapPoint]| {
        let plan = plan(&lidar, points, &crate::rooms(&lidar, points), &[]);
        plan.rooms.iter().map(|room| room.area_m2).sum::<f64>()
    };
    assert!((area_m2(&points) - 11.1).abs() < 0.3, "{}", area_m2(&points));
    points.extend(face(0.0, true, [0.0, 1.5], [1.9, 2.5]));
    points.extend(face(0.0, true, [1.5, 3.0], [0.1, 2.5]));
    assert!((area_m2(&points) - 12.0).abs() < 0.3, "{}", area_m2(&points));
}

/// The LiDAR saw an open leaf; clips saw floor on both sides of it, and nothing at the ceiling.
#[test]
fn an_open_leaf_is_no_wall() {
    let mut walls = ring(&[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]);
    walls.push([[2.0, 0.0], [2.0, 0.7]]);
    let lidar = lidar_of(&walls);
    let corners = |points: &[MapPoint]| {
        let plan = plan(&lidar, points, &crate::rooms(&lidar, points), &[]);
        assert_eq!(plan.rooms.len(), 1, "{:?}", plan.rooms);
        plan.rooms[0].outline.ring_m.len()
    };
    let floor = (0..80).flat_map(|i| (0..60).map(move |j| [0.05 * i as f64, 0.05 * j as f64]));
    let mut points: Vec<MapPoint> =
        floor.map(|[x, y]| point([x, y, 0.0], [0.0, 0.0, 1.0], Class::Floor)).collect();
    assert_eq!(corners(&points), 4);
    // The same in a wall up to the ceiling.
    for (x, up) in [(1.98, false), (2.02, true)] {
        points.extend(face(x, up, [0.0, 0.7], [0.1, 2.5]));
    }
    assert_eq!(corners(&points), 8);
}

#[test]
fn a_doorway_between_staggered_walls_divides_two_rooms() {
    // Two thin walls whose ends are 25 cm apart across the wall.
    let mut walls = ring(&[[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [0.0, 6.0]]);
    for off in [0.0, 0.025, 0.05, 0.075, 0.1] {
        walls.extend([[[0.0, 2.8 + off], [1.6, 2.8 + off]], [[2.35, 3.1 + off], [4.0, 3.1 + off]]]);
    }
    let lidar = lidar_of(&walls);
    let rooms = crate::rooms(&lidar, &[]);
    let plan = plan(&lidar, &[], &rooms, &[]);
    assert_eq!((rooms.len(), plan.rooms.len(), plan.openings.len()), (2, 2, 1), "{:?}", plan.openings);
    let door = &plan.openings[0];
    assert!(door.kind == OpeningKind::Door && (0.7..1.1).contains(&door.width_m()), "{door:?}");
    let areas_m2: f64 = plan.rooms.iter().map(|room| room.area_m2).sum();
    assert!((22.5..24.0).contains(&areas_m2), "{areas_m2}");
}

/// Two rooms of 4 m depth with a wall of several pieces between them.
fn divided(pieces: &[[f64; 2]]) -> LidarMap {
    let mut walls = ring(&[[0.0, 0.0], [7.0, 0.0], [7.0, 4.0], [0.0, 4.0]]);
    for x in [4.0, 4.025, 4.05, 4.075, 4.1] {
        walls.extend(pieces.iter().map(|[from, to]| [[x, *from], [x, *to]]));
    }
    lidar_of(&walls)
}

/// Clips saw both faces of the pier, but not the ceiling.
#[test]
fn a_pier_divides_two_doors() {
    let pieces = [[0.0, 0.6], [1.4, 2.0], [2.8, 4.0]];
    let lidar = divided(&pieces);
    let mut points = Vec::new();
    // Points 2.5 cm apart, so that no column is without any.
    for [from, to] in pieces {
        for off in [0.0, 0.025] {
            points.extend(face(4.0, false, [from + off, to], [0.1, 1.9]));
            points.extend(face(4.1, true, [from + off, to], [0.1, 1.9]));
        }
    }
    let plan = plan(&lidar, &points, &crate::rooms(&lidar, &points), &[]);
    let is_door =
        |opening: &Opening| opening.kind == OpeningKind::Door && (opening.width_m() - 0.8).abs() < 0.16;
    assert_eq!(plan.openings.len(), 2, "{:?}", plan.openings);
    assert!(plan.openings.iter().all(is_door), "{:?}", plan.openings);
}

/// The label network called the right face of the wall a door.
#[test]
fn a_door_whose_back_is_wall_is_none() {
    let pieces = [[0.0, 1.6], [2.4, 4.0]];
    let lidar = divided(&pieces);
    let mut points = Vec::new();
    for [from, to] in pieces {
        for off in [0.0, 0.025] {
            points.extend(face(4.0, false, [from + off, to], [0.1, 1.9]));
            let mut back = face(4.1, true, [from + off, to], [0.1, 1.9]);
            back.iter_mut().for_each(|point| point.point.label = Label::new(Class::Door, 0.9, 3));
            points.extend(back);
        }
    }
    let plan = plan(&lidar, &points, &crate::rooms(&lidar, &points), &[]);
    assert_eq!((plan.rooms.len(), plan.openings.len()), (2, 1), "{:?}", plan.openings);
    assert!((plan.openings[0].width_m() - 0.8).abs() < 0.16, "{:?}", plan.openings);
}

/// Clips saw both faces of two walls that meet at a corner, each with a doorway at its other end, but not the ceiling.
#[test]
fn a_corner_between_two_doors_stays() {
    let mut walls = ring(&[[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [0.0, 5.0]]);
    for at in [1.8, 1.825, 1.85, 1.875, 1.9] {
        walls.extend([[[at, 0.8], [at, 1.9]], [[0.8, at], [1.9, at]]]);
    }
    let lidar = lidar_of(&walls);
    let mut across_x = Vec::new();
    for off in [0.0, 0.025] {
        across_x.extend(face(1.8, false, [0.8 + off, 1.8], [0.1, 1.9]));
        across_x.extend(face(1.9, true, [0.8 + off, 1.9], [0.1, 1.9]));
    }
    let mirrored = |point: &MapPoint| {
        let mut point = *point;
        point.point.position_m.swap(0, 1);
        point.point.normal.swap(0, 1);
        point
    };
    let points: Vec<MapPoint> = across_x.iter().map(mirrored).chain(across_x.iter().copied()).collect();
    let plan = plan(&lidar, &points, &crate::rooms(&lidar, &points), &[]);
    let is_door =
        |opening: &Opening| opening.kind == OpeningKind::Door && (opening.width_m() - 0.8).abs() < 0.16;
    assert_eq!((plan.rooms.len(), plan.openings.len()), (2, 2), "{:?}", plan.openings);
    assert!(plan.openings.iter().all(is_door), "{:?}", plan.openings);
}

/// Clips saw a window as wide as the room, and the floor of a terrace through it.
#[test]
fn floor_behind_glass_is_outside() {
    let walls = [[[4.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 3.0]], [[0.0, 3.0], [4.0, 3.0]]];
    let lidar = lidar_of(&walls);
    let rooms = [Room::rectangle("1", [0.0, 0.0], [4.0, 3.0])];
    let floor = (0..320).flat_map(|i| (0..120).map(move |j| [i, j].map(|k| 0.0125 + 0.025 * f64::from(k))));
    let mut points: Vec<MapPoint> =
        floor.map(|[x, y]| point([x, y, 0.0], [0.0, 0.0, 1.0], Class::Floor)).collect();
    // Of the room and of the terrace.
    let outside = |points: &[MapPoint]| {
        let space = Space::reaching(&lidar, points);
        let (level, _) = raster::level_cells(&space, points);
        let owner = raster::owners(&space, &rooms);
        let beyond = glass::beyond(&space, raster::glass_cells(&space, points), &level, &owner);
        [[2.0, 1.5], [6.0, 1.5]].map(|at| space.index(&Point2::from(at)).map(|at| beyond[at]))
    };
    assert_eq!(outside(&points), [Some(false), Some(false)]);
    for off in [0.0, 0.025] {
        let mut glass = face(4.0, false, [off, 3.0], [0.1, 2.2]);
        glass.iter_mut().for_each(|point| point.point.label = Label::new(Class::Window, 0.9, 3));
        points.extend(glass);
    }
    assert_eq!(outside(&points), [Some(false), Some(true)]);
}
