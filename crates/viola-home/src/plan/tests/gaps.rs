//! Plans with corridors, beams and recesses.

use super::super::*;
use super::lidar_of;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::{CloudPoint, Label};

/// A corridor of 1.2 m by 8 m with two rooms on each side; the walls between the rooms are in one line.
fn corridor() -> LidarMap {
    let mut walls = vec![
        [[0.0, 0.0], [8.4, 0.0]],
        [[8.4, 0.0], [8.4, 8.0]],
        [[8.4, 8.0], [0.0, 8.0]],
        [[0.0, 8.0], [0.0, 0.0]],
    ];
    // Both faces of the corridor's walls and what is between them, with a door to each room.
    for x in [3.51, 3.535, 3.56, 3.585, 3.61, 4.81, 4.835, 4.86, 4.885, 4.91] {
        walls.extend([[[x, 0.0], [x, 1.5]], [[x, 2.3], [x, 5.5]], [[x, 6.3], [x, 8.0]]]);
    }
    for y in [3.96, 3.985, 4.01, 4.035, 4.06] {
        walls.extend([[[0.0, y], [3.51, y]], [[4.91, y], [8.4, y]]]);
    }
    lidar_of(&walls)
}

fn point(position_m: [f64; 3], normal: [f64; 3], class: Class) -> MapPoint {
    let point = CloudPoint {
        position_m: position_m.map(|c| c as f32),
        normal: normal.map(|c| c as f32),
        color: class.color(),
        label: Label::new(class, 0.9, 3),
        weight: 100,
    };
    MapPoint { point, clip: 0 }
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
    let walls = [
        [[0.0, 0.0], [4.0, 0.0]],
        [[4.0, 0.0], [4.0, 3.0]],
        [[4.0, 3.0], [2.6, 3.0]],
        [[2.6, 3.0], [2.6, 3.3]],
        [[2.6, 3.3], [1.2, 3.3]],
        [[1.2, 3.3], [1.2, 3.0]],
        [[1.2, 3.0], [0.0, 3.0]],
        [[0.0, 3.0], [0.0, 0.0]],
    ];
    let lidar = lidar_of(&walls);
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
