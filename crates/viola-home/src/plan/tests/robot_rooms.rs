//! Plans of rooms that the robot's software divided, with and without walls between them.

use super::*;
use viola_formats::lidar::Room as RobotRoom;

/// Returns the map with the robot's rooms `a` and `b`: floor within the outer walls of `flat`, for which `is_a` is true and false.
/// Cells in the wall at x = 4 m are no floor if it `has_wall`.
fn divided(mut lidar: LidarMap, has_wall: bool, is_a: impl Fn([f64; 2]) -> bool) -> LidarMap {
    let cells = (0..138).flat_map(|i| (0..56).map(move |j| [i, j].map(|i| 0.125 + 0.05 * f64::from(i))));
    let is_floor = |p: &[f64; 2]| !has_wall || !(3.9..4.2).contains(&p[0]) || (1.1..1.7).contains(&p[1]);
    let (a, b): (Vec<[f64; 2]>, Vec<[f64; 2]>) = cells.filter(is_floor).partition(|p| is_a(*p));
    let room = |(id, cells): (&str, Vec<[f64; 2]>)| RobotRoom {
        id: id.to_owned(),
        name: None,
        cells_m: cells.into_iter().map(Point2::from).collect(),
        material: None,
    };
    let rooms = [("a", a), ("b", b)].into_iter().filter(|(_, cells)| !cells.is_empty());
    lidar.rooms = rooms.map(room).collect();
    lidar
}

/// A room of 7.1 m by 3 m, and walls in it.
fn hall(walls: &[[[f64; 2]; 2]]) -> LidarMap {
    let outer = [[0.0, 0.0], [7.1, 0.0], [7.1, 3.0], [0.0, 3.0]];
    let outer = (0..4).map(|i| [outer[i], outer[(i + 1) % 4]]);
    lidar_of(&outer.chain(walls.iter().copied()).collect::<Vec<_>>())
}

fn plan_by_robot(lidar: &LidarMap) -> Plan {
    plan(lidar, &[], &crate::rooms(lidar, &[]), &[])
}

fn area_m2(plan: &Plan, id: &str) -> f64 {
    plan.rooms.iter().filter(|room| room.id.as_deref() == Some(id)).map(|room| room.area_m2).sum()
}

fn ids(plan: &Plan) -> Vec<&str> {
    let mut ids: Vec<&str> = plan.rooms.iter().filter_map(|room| room.id.as_deref()).collect();
    ids.sort_unstable();
    ids
}

/// The robot's software divides its rooms somewhere before or behind the doorway.
#[test]
fn a_doorway_near_the_robots_border_divides_its_rooms() {
    for off_m in [-0.55, -0.3, 0.0, 0.2, 0.4, 0.55] {
        let is_a = |p: [f64; 2]| p[0] < 4.05 || (p[0] < 4.05 + off_m && (1.0..1.8).contains(&p[1]));
        let is_a = |p: [f64; 2]| is_a(p) && !(p[0] > 4.05 + off_m && (1.0..1.8).contains(&p[1]));
        let plan = plan_by_robot(&divided(flat(0.0), true, is_a));
        assert_eq!(ids(&plan), ["a", "b"], "{off_m}: {:?}", plan.rooms);
        assert_eq!(plan.openings.len(), 1, "{off_m}: {:?}", plan.openings);
        let door = &plan.openings[0];
        assert!(door.kind == OpeningKind::Door && (door.width_m() - 0.8).abs() < 0.16, "{off_m}: {door:?}");
        for (id, want_m2) in [("a", 12.0), ("b", 9.0)] {
            assert!((area_m2(&plan, id) / want_m2 - 1.0).abs() < 0.05, "{off_m} {id}: {:?}", plan.rooms);
        }
    }
}

#[test]
fn the_robots_border_is_a_straight_passage() {
    // The robot's border from the lower wall to the upper one.
    for (from, to) in [(2.0, 2.0), (3.3, 3.3), (5.02, 5.02), (1.0, 3.0), (4.5, 2.5), (2.0, 2.9), (5.5, 4.1)] {
        let at = |y: f64| from + (to - from) * y / 3.0;
        let plan = plan_by_robot(&divided(hall(&[]), false, |[x, y]| x < at(y)));
        let case = format!("{from} {to}");
        assert_eq!(ids(&plan), ["a", "b"], "{case}: {:?}", plan.rooms);
        assert_eq!(plan.openings.len(), 1, "{case}: {:?}", plan.openings);
        let passage = &plan.openings[0];
        let length_m = (to - from).hypot(3.0);
        assert!(passage.kind == OpeningKind::Passage, "{case}: {passage:?}");
        assert!((passage.width_m() - length_m).abs() < 0.12, "{case}: {passage:?}");
        for [x, y] in [passage.from_m, passage.to_m] {
            assert!((x - at(y)).abs() < 0.12 && y.min(3.0 - y).abs() < 0.05, "{case}: {passage:?}");
        }
        // Both rooms have the whole border as one side.
        for (id, want_m2) in [("a", 3.0 * (from + to) / 2.0), ("b", 3.0 * (7.1 - (from + to) / 2.0))] {
            assert!((area_m2(&plan, id) - want_m2).abs() < 0.5, "{case} {id}: {:?}", plan.rooms);
            let room = plan.rooms.iter().find(|room| room.id.as_deref() == Some(id)).unwrap();
            assert_eq!(room.outline.ring_m.len(), 4, "{case}: {room:?}");
        }
        let is_at_border = |wall: &Wall| {
            let middle = [0, 1].map(|axis| (wall.from_m[axis] + wall.to_m[axis]) / 2.0);
            (0.3..2.7).contains(&middle[1]) && (middle[0] - at(middle[1])).abs() < 0.3
        };
        assert!(!plan.walls.iter().any(is_at_border), "{case}: {:?}", plan.walls);
    }
}

/// Two piers of masonry, too thick for a wall, leave 1.6 m between them.
#[test]
fn the_border_moves_to_the_walls_that_end_beside_it() {
    let pier = |y: f64, to: f64| [[[2.5, y], [2.5, to]], [[2.5, to], [3.2, to]], [[3.2, to], [3.2, y]]];
    let lidar = || hall(&[pier(0.0, 0.7), pier(3.0, 2.3)].concat());
    for border_m in [2.2, 2.6, 2.85, 3.0, 3.5] {
        let is_pier = |[x, y]: [f64; 2]| (2.5..3.2).contains(&x) && !(0.7..2.3).contains(&y);
        let mut map = divided(lidar(), false, |p| p[0] < border_m);
        for room in &mut map.rooms {
            room.cells_m.retain(|p| !is_pier([p.x, p.y]));
        }
        let plan = plan_by_robot(&map);
        assert_eq!(ids(&plan), ["a", "b"], "{border_m}: {:?}", plan.rooms);
        assert_eq!(plan.openings.len(), 1, "{border_m}: {:?}", plan.openings);
        assert!((plan.openings[0].width_m() - 1.6).abs() < 0.12, "{border_m}: {:?}", plan.openings);
        assert_eq!(plan.openings[0].kind, OpeningKind::Passage);
        for end in [plan.openings[0].from_m, plan.openings[0].to_m] {
            assert!((2.4..3.3).contains(&end[0]), "{border_m}: {:?}", plan.openings);
        }
    }
}

/// Three rooms meet: the border of two of them ends at the third.
#[test]
fn a_border_ends_at_a_third_room() {
    let mut lidar = divided(hall(&[]), false, |[x, _]| x < 3.5);
    let mut third = Vec::new();
    for room in &mut lidar.rooms {
        third.extend(room.cells_m.iter().copied().filter(|p| p.y > 1.8));
        room.cells_m.retain(|p| p.y <= 1.8);
    }
    lidar.rooms.push(RobotRoom { id: "c".to_owned(), name: None, cells_m: third, material: None });
    let plan = plan_by_robot(&lidar);
    assert_eq!(ids(&plan), ["a", "b", "c"], "{:?}", plan.rooms);
    let mut widths_m: Vec<f64> = plan.openings.iter().map(Opening::width_m).collect();
    widths_m.sort_by(f64::total_cmp);
    let want = [1.8, 3.5, 3.6];
    assert_eq!(widths_m.len(), want.len(), "{:?}", plan.openings);
    for (width_m, want_m) in widths_m.iter().zip(want) {
        assert!((width_m - want_m).abs() < 0.25, "{:?}", plan.openings);
    }
}

/// The robot divided nothing yet, and no clip saw the walls above the doorway.
#[test]
fn a_home_of_one_segment_keeps_its_doors() {
    let plan = plan_by_robot(&divided(flat(0.0), true, |_| true));
    assert_eq!((ids(&plan), plan.openings.len()), (vec!["a"], 1), "{:?}", plan.openings);
    let door = &plan.openings[0];
    assert!(door.kind == OpeningKind::Door && (door.width_m() - 0.8).abs() < 0.16, "{door:?}");
    assert!((area_m2(&plan, "a") - 21.1).abs() < 0.8, "{:?}", plan.rooms);
}
