//! Rules of shapes that decide the class and the size of an object.

use super::{classes, found, surface};
use crate::MapPoint;
use crate::objects::Object;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::Label;

/// A box with boards inside, open at the front, whose points are called shelf or cabinet by turns.
fn storage(boards_m: &[f64], high_m: f64) -> Vec<MapPoint> {
    let mut points = surface(Class::Cabinet, [0.0, 0.0, 0.1], [1.0, 0.4, high_m], 0);
    if !boards_m.is_empty() {
        points.retain(|p| p.point.normal[1] > -0.5);
    }
    for z in boards_m {
        points.extend(surface(Class::Cabinet, [0.03, 0.0, *z], [0.97, 0.37, *z], 0));
    }
    points.iter_mut().step_by(2).for_each(|p| p.point.label = Label::new(Class::Shelf, 0.8, 4));
    points
}

#[test]
fn boards_make_a_shelf() {
    for (boards_m, high_m, class) in [
        (&[0.5, 0.85, 1.2][..], 1.6, Class::Shelf),
        (&[], 1.6, Class::Cabinet),
        // The top, with things on it up to 1.6 m.
        (&[1.2], 1.6, Class::Cabinet),
    ] {
        let mut points = storage(boards_m, if boards_m.len() == 1 { 1.2 } else { high_m });
        if boards_m.len() == 1 {
            points.extend(surface(Class::Cabinet, [0.4, 0.1, 1.2], [0.6, 0.3, high_m], 0));
        }
        let objects = found(&points);
        assert_eq!(classes(&objects), [class], "{boards_m:?}");
    }
}

#[test]
fn what_is_low_and_hangs_is_a_shelf() {
    for (low_m, class) in [(1.4, Class::Shelf), (0.1, Class::Cabinet)] {
        let mut points = surface(Class::Cabinet, [0.0, 0.0, low_m], [0.9, 0.25, low_m + 0.3], 0);
        points.iter_mut().step_by(2).for_each(|p| p.point.label = Label::new(Class::Shelf, 0.8, 4));
        assert_eq!(found(&points)[0].class, class, "{low_m}");
    }
}

/// The surface at y = 0 of a washing machine between two cabinets.
#[test]
fn the_front_of_an_appliance_has_a_depth() {
    let mut points = surface(Class::Cabinet, [-1.0, 0.02, 0.06], [0.0, 0.05, 0.86], 0);
    points.extend(surface(Class::Cabinet, [0.6, 0.02, 0.06], [1.6, 0.05, 0.86], 0));
    let mut front = surface(Class::WashingMachine, [0.0, 0.0, 0.12], [0.6, 0.03, 0.84], 0);
    front.retain(|p| p.point.normal[1] < -0.5);
    points.extend(front);
    points.retain(|p| p.point.normal[1] < -0.5);
    let objects = found(&points);
    let machine = objects.iter().find(|object| object.class == Class::WashingMachine);
    let Object { centre_m, size_m, .. } = machine.unwrap_or_else(|| panic!("{objects:?}"));
    // The cabinets beside it may cut off a little.
    assert!((size_m[0] - 0.6).abs() < 0.1 && (size_m[1] - 0.6).abs() < 0.1, "{size_m:?}");
    assert!((centre_m[1] - 0.3).abs() < 0.1 && (centre_m[2] - 0.42).abs() < 0.1, "{centre_m:?}");
}

/// A fridge at a wall shows its front and a bit of one side.
#[test]
fn a_bit_of_a_side_does_not_tell_the_depth_of_an_appliance() {
    for (name, is_at_wall, depth_m) in [("at a wall", true, 0.6), ("seen from all sides", false, 0.3)] {
        let mut points = surface(Class::Refrigerator, [0.0, 0.0, 0.1], [0.8, 0.3, 1.9], 0);
        points.retain(|p| !is_at_wall || p.point.normal[0] < -0.5 || p.point.normal[1] < -0.5);
        let label = Label::new(Class::Refrigerator, 0.56, 0).with_others([(Class::Cabinet, 0.25)]);
        points.iter_mut().for_each(|p| p.point.label = label);
        let objects = found(&points);
        assert_eq!(objects.len(), 1, "{name}: {objects:?}");
        let Object { class, centre_m, size_m, .. } = &objects[0];
        assert_eq!(*class == Class::Refrigerator, depth_m > 0.5, "{name}: {objects:?}");
        assert!((size_m[0] - 0.8).abs() < 0.1 && (size_m[1] - depth_m).abs() < 0.1, "{name}: {size_m:?}");
        assert!((centre_m[1] - depth_m / 2.0).abs() < 0.1, "{name}: {centre_m:?}");
    }
}

#[test]
fn a_basin_with_a_foot_stands_on_the_floor() {
    for (foot, bottom_m) in
        [(Some(Class::Sink), 0.0), (Some(Class::Wall), 0.0), (None, 0.7), (Some(Class::Cabinet), 0.7)]
    {
        let mut points = surface(Class::Sink, [0.0, 0.0, 0.7], [0.6, 0.45, 0.88], 0);
        if let Some(class) = foot {
            points.extend(surface(class, [0.2, 0.15, 0.1], [0.4, 0.3, 0.66], 0));
        }
        let objects = found(&points);
        let sink = objects.iter().find(|object| object.class == Class::Sink).expect("a sink");
        assert!((sink.bounds().bottom_m() - bottom_m).abs() < 0.1, "{foot:?} {sink:?}");
    }
}

#[test]
fn a_rim_in_a_worktop_has_a_basin_and_a_tap() {
    let points = surface(Class::Sink, [0.0, 0.0, 0.88], [0.8, 0.45, 0.9], 0);
    let sink = &found(&points)[0];
    assert!(sink.bounds().bottom_m() < 0.8 && sink.bounds().top_m() > 1.0, "{sink:?}");
}

/// A half of a table is called desk.
#[test]
fn parts_of_one_top_are_one_table() {
    let top = |class: Class, low_x: f64, high_x: f64, z: f64| {
        surface(class, [low_x, 0.0, z - 0.03], [high_x, 0.8, z], 0)
    };
    for (z, count) in [(0.74, 1), (0.6, 2)] {
        let mut points = top(Class::Table, 0.0, 0.9, 0.74);
        points.extend(top(Class::Desk, 0.93, 1.6, z));
        assert_eq!(found(&points).len(), count, "{z}");
    }
}

/// A patch in the corner of a room, called cabinet. Both walls go on beside it and above.
#[test]
fn the_corner_of_a_room_is_no_cabinet() {
    let mut points = surface(Class::Wall, [0.0, 3.0, 0.0], [3.0, 3.0, 2.4], 0);
    points.extend(surface(Class::Wall, [0.0, 0.0, 0.0], [0.0, 3.0, 2.4], 0));
    for p in &mut points {
        let [x, y, z] = p.point.position_m;
        let is_on_back = y > 2.99;
        p.point.normal = if is_on_back { [0.0, -1.0, 0.0] } else { [1.0, 0.0, 0.0] };
        if x < 0.45 && y > 2.7 && z < 0.7 {
            p.point.label = Label::new(Class::Cabinet, 0.8, 4);
        }
    }
    assert_eq!(found(&points), []);
}

/// Things in the label of a chair beyond it: 2.5 to 5 % of its points.
#[test]
fn the_box_of_a_chair_leaves_out_what_touches_it() {
    let mut points = surface(Class::Chair, [0.0, 0.0, 0.0], [0.5, 0.5, 0.9], 0);
    let beside = surface(Class::Chair, [0.53, 0.2, 0.6], [0.74, 0.29, 0.66], 0);
    assert!((points.len() / 40..points.len() / 20).contains(&beside.len()), "{}", beside.len());
    points.extend(beside);
    let objects = found(&points);
    assert!((objects[0].size_m[0] - 0.5).abs() < 0.05, "{objects:?}");
}
