//! Plans where no clip saw what the LiDAR saw.

use super::super::*;
use super::furniture::cabinet;
use super::gaps::face;
use super::{lidar_of, ring};
use viola_formats::lidar::Cell;
use viola_geometry::{Grid, GridFrame};

fn plan_with(lidar: &LidarMap, points: &[MapPoint], objects: &[Object]) -> Plan {
    plan(lidar, points, &crate::rooms(lidar, points), objects)
}

fn areas_m2(plan: &Plan) -> Vec<f64> {
    plan.rooms.iter().map(|room| (room.area_m2 * 10.0).round() / 10.0).collect()
}

/// A wardrobe in a corner of a room of 4 m by 3 m, and a bed at its wall.
#[test]
fn furniture_that_no_clip_saw_is_no_wall() {
    let bed = [[2.0, 3.0], [2.0, 1.4], [3.4, 1.4], [3.4, 3.0]];
    let outline = |corner: &[[f64; 2]], at_wall: &[[f64; 2]]| {
        let corners = [
            corner,
            &[[4.0, 0.0], [4.0, 3.0]],
            &at_wall.iter().rev().copied().collect::<Vec<_>>(),
            &[[0.0, 3.0]],
        ];
        lidar_of(&ring(&corners.concat()))
    };
    let in_corner = [[0.0, 0.6], [0.9, 0.6], [0.9, 0.0]];
    let lidar = outline(&in_corner, &bed);
    let plan = plan_with(&lidar, &[], &[]);
    assert!(
        areas_m2(&plan).len() == 1 && (plan.rooms[0].area_m2 - 12.0).abs() < 0.2,
        "{:?}",
        areas_m2(&plan)
    );
    // A clip saw that the wall ends there.
    let mut filmed = face(0.9, true, [0.0, 0.6], [0.1, 2.5]);
    filmed.extend(face(2.0, false, [1.4, 3.0], [0.1, 2.5]));
    filmed.extend(face(3.4, true, [1.4, 3.0], [0.1, 2.5]));
    let plan = plan_with(&lidar, &filmed, &[]);
    let walled_m2 = 12.0 - 0.9 * 0.6 - 1.4 * 1.6;
    let found_m2: f64 = areas_m2(&plan).iter().sum();
    assert!((found_m2 - walled_m2).abs() < 0.3, "{:?}", areas_m2(&plan));
    // A closet is too large for furniture in a corner.
    let lidar = outline(&[[0.0, 1.7], [1.6, 1.7], [1.6, 0.0]], &[]);
    let plan = plan_with(&lidar, &[], &[]);
    assert!((plan.rooms[0].area_m2 - (12.0 - 1.6 * 1.7)).abs() < 0.3, "{:?}", areas_m2(&plan));
}

/// Two rooms of 3 m by 3 m with a wall of 0.1 m and a door between them. The wardrobe hides the left face of the wall beside the
/// door, of which the LiDAR saw only the right one.
#[test]
fn a_wall_stays_behind_a_wardrobe() {
    let left =
        [[0.0, 0.0], [3.0, 0.0], [3.0, 0.3], [3.1, 0.3], [3.1, 0.0], [6.1, 0.0], [6.1, 3.0], [3.1, 3.0]];
    let right = [[3.1, 1.1], [3.0, 1.1], [3.0, 1.3], [2.4, 1.3], [2.4, 3.0], [0.0, 3.0]];
    let lidar = lidar_of(&ring(&[&left[..], &right[..]].concat()));
    let plan = plan_with(&lidar, &[], &[cabinet([2.7, 2.15], [1.7, 0.6, 2.0], 0.9)]);
    let areas_m2 = areas_m2(&plan);
    assert!(areas_m2.len() == 2 && areas_m2.iter().all(|area| (area - 9.0).abs() < 0.4), "{areas_m2:?}");
    assert!(!plan.rooms.iter().any(|room| room.contains([3.05, 2.2])), "the wall is in a room");
}

/// A piece of wall between two doors of one room, as thin as inner walls are, and a piece of a thicker thing.
#[test]
fn a_thin_wall_by_the_lidar_alone_is_no_furniture() {
    // Lines of points 2.5 cm apart, which fill it.
    for (lines, holes) in [(5, 1), (9, 0)] {
        let mut walls = ring(&[[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]]);
        walls.extend((0..lines).map(|i| 2.0 + 0.025 * f64::from(i)).map(|y| [[2.4, y], [3.7, y]]));
        let plan = plan_with(&lidar_of(&walls), &[], &[]);
        let found: usize = plan.rooms.iter().map(|room| room.outline.holes_m.len()).sum();
        assert_eq!(found, holes, "{lines} lines: {:?}", plan.rooms);
    }
}

/// A room of 4 m by 2 m with a passage of 1.3 m between two screens.
#[test]
fn screens_that_no_clip_saw_do_not_divide_a_small_room() {
    let mut walls = ring(&[[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]);
    for x in [1.5, 1.525, 1.55, 1.575, 1.6] {
        walls.extend([[[x, 0.0], [x, 0.35]], [[x, 1.65], [x, 2.0]]]);
    }
    let lidar = lidar_of(&walls);
    assert_eq!(areas_m2(&plan_with(&lidar, &[], &[])).len(), 1);
    let mut filmed = Vec::new();
    for ys in [[0.0, 0.35], [1.65, 2.0]] {
        filmed.extend(face(1.5, false, ys, [0.1, 2.5]));
        filmed.extend(face(1.6, true, ys, [0.1, 2.5]));
    }
    assert_eq!(areas_m2(&plan_with(&lidar, &filmed, &[])).len(), 2);
}

/// Two rooms of 3 m by 3 m with a wall of 0.1 m and a door between them. Furniture stands along all of the wall before the door.
#[test]
fn a_wall_between_furniture_and_a_room_stays() {
    let left = [[0.0, 0.0], [2.1, 0.0], [2.1, 1.6], [3.1, 1.6], [3.1, 0.0], [6.1, 0.0], [6.1, 3.0]];
    let right = [[3.1, 3.0], [3.1, 2.4], [3.0, 2.4], [3.0, 3.0], [0.0, 3.0]];
    let plan = plan_with(&lidar_of(&ring(&[&left[..], &right[..]].concat())), &[], &[]);
    let areas_m2 = areas_m2(&plan);
    assert!(areas_m2.len() == 2 && areas_m2.iter().all(|area| (area - 9.0).abs() < 0.4), "{areas_m2:?}");
}

/// A table in a room of 5 m by 4 m, of which the LiDAR saw the outline.
#[test]
fn furniture_away_from_walls_that_no_clip_saw_is_no_wall() {
    let check = |[width_m, depth_m]: [f64; 2], filmed: &[MapPoint], wall_m2: f64| {
        let [left, right, low, high] = [1.0, 1.0 + width_m, 1.0, 1.0 + depth_m];
        let mut walls = ring(&[[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]]);
        // Lines of points, which fill it.
        let lines = (0..).map(|i| low + 0.025 * f64::from(i)).take_while(|y| *y < high);
        walls.extend(lines.map(|y| [[left, y], [right, y]]));
        walls.extend(ring(&[[left, low], [right, low], [right, high], [left, high]]));
        let plan = plan_with(&lidar_of(&walls), filmed, &[]);
        let area_m2: f64 = plan.rooms.iter().map(|room| room.area_m2).sum();
        assert!((20.0 - wall_m2 - area_m2).abs() < 0.3, "{width_m} x {depth_m}: {area_m2}");
    };
    check([0.9, 1.1], &[], 0.0);
    // A closet, and a chimney whose faces a clip saw.
    check([1.6, 1.7], &[], 1.6 * 1.7);
    let mut faces = face(1.0, false, [1.0, 2.1], [0.1, 2.5]);
    faces.extend(face(1.9, true, [1.0, 2.1], [0.1, 2.5]));
    check([0.9, 1.1], &faces, 0.9 * 1.1);
}

/// Returns a map of cells of 5 cm around rooms from the origin to a corner; `is_wall` tells their inner walls.
pub(super) fn cells_of(size_m: [f64; 2], is_wall: impl Fn(f64, f64) -> bool) -> LidarMap {
    let count = |axis: usize| (size_m[axis] / 0.05).round() as usize + 20;
    let frame = GridFrame { origin_m: [-0.5; 2], cell_m: 0.05, width: count(0), height: count(1) };
    let cell = |at: usize| {
        let place = frame.centre(at % frame.width, at / frame.width);
        let is_within = |off_m: f64| (0..2).all(|axis| (-off_m..size_m[axis] + off_m).contains(&place[axis]));
        match (is_within(0.0), is_within(0.05)) {
            (true, _) if !is_wall(place.x, place.y) => Cell::Free,
            (false, false) => Cell::Unknown,
            _ => Cell::Occupied,
        }
    };
    let cells: Vec<Cell> = (0..frame.len()).map(cell).collect();
    let mut lidar = lidar_of(&[[[0.0, 0.0], size_m]]);
    let occupied = (0..frame.len()).filter(|at| cells[*at] == Cell::Occupied);
    lidar.occupied_m = occupied.map(|at| frame.centre(at % frame.width, at / frame.width)).collect();
    (lidar.info.min_m, lidar.info.max_m) = ([-0.05; 2], size_m.map(|metres| metres + 0.05));
    lidar.cells = Some(Grid { frame, cells });
    lidar
}

/// Two rooms of 3 m by 5 m. Two rows of cells are the wall between them, with a door at each of its ends.
#[test]
fn a_piece_of_wall_of_two_cells_between_two_rooms_stays() {
    let lidar = cells_of([6.1, 5.0], |x, y| (3.0..3.1).contains(&x) && (0.9..4.1).contains(&y));
    let plan = plan_with(&lidar, &[], &[]);
    let areas_m2 = areas_m2(&plan);
    assert!(areas_m2.len() == 2 && areas_m2.iter().all(|area| (area - 15.0).abs() < 0.6), "{areas_m2:?}");
    let doors = plan.openings.iter().filter(|opening| opening.kind == OpeningKind::Door);
    assert_eq!(doors.count(), 2, "{:?}", plan.openings);
}

/// Two rooms of 3 m by 3 m with a door in the one row of cells between them.
#[test]
fn one_row_of_cells_between_two_rooms_is_a_wall() {
    let lidar = cells_of([6.05, 3.0], |x, y| (3.0..3.05).contains(&x) && !(1.2..2.0).contains(&y));
    let plan = plan_with(&lidar, &[], &[]);
    let areas_m2 = areas_m2(&plan);
    assert!(areas_m2.len() == 2 && areas_m2.iter().all(|area| (area - 9.0).abs() < 0.4), "{areas_m2:?}");
    let [door] = plan.openings.as_slice() else { panic!("{:?}", plan.openings) };
    assert!(door.kind == OpeningKind::Door && (door.width_m() - 0.8).abs() < 0.16, "{door:?}");
}

/// The front of a sofa, or a screen, in the middle of a room.
#[test]
fn one_row_of_cells_within_a_room_is_no_wall() {
    let lidar = cells_of([6.0, 5.0], |x, y| (3.0..3.05).contains(&x) && (1.9..3.1).contains(&y));
    let plan = plan_with(&lidar, &[], &[]);
    assert_eq!(areas_m2(&plan).len(), 1);
    assert!(plan.rooms[0].outline.holes_m.is_empty() && !plan.walls.iter().any(|wall| wall.is_measured));
}
