//! Plans with standing furniture.

use super::super::*;
use super::{lidar_of, ring, standing, upright};
use crate::rooms::tests::flat;
use std::f64::consts::FRAC_PI_2;
use viola_geometry::taxonomy::Class;
use viola_reconstruct::Label;

/// Returns the points of a cabinet's surface above a line: 2.5 cm apart along it, up to 2 m. Most of its labels are wrong.
fn front(from_m: [f64; 2], to_m: [f64; 2], normal: [f32; 3]) -> Vec<MapPoint> {
    upright(Class::Other, [from_m, to_m], normal, 0.025, (0.1, 20))
}

/// Returns a cabinet along y.
pub(super) fn cabinet(place_m: [f64; 2], size_m: [f64; 3], confidence: f64) -> Object {
    Object { yaw_rad: FRAC_PI_2, ..standing(Class::Cabinet, confidence, place_m, size_m) }
}

/// The robot and the clips saw the front and the side of a wardrobe in a corner, and nobody the walls behind it.
#[test]
fn a_wardrobe_is_no_wall() {
    let outer = [[0.9, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0], [0.0, 1.5], [0.9, 1.5]];
    let lidar = lidar_of(&ring(&outer));
    let mut points = front([0.9, 0.0], [0.9, 1.5], [1.0, 0.0, 0.0]);
    points.extend(front([0.9, 1.5], [0.0, 1.5], [0.0, 1.0, 0.0]));
    // Without a sure object the clips must have called its front wall.
    for (confidence, called, area_m2) in
        [(0.7, Class::Cabinet, 12.0), (0.4, Class::Cabinet, 12.0), (0.4, Class::Wall, 10.65)]
    {
        points.iter_mut().for_each(|point| point.point.label = Label::new(called, 0.9, 3));
        let objects = [cabinet([0.45, 0.75], [1.5, 0.9, 2.0], confidence)];
        let plan = plan(&lidar, &points, &crate::rooms(&lidar, &points), &objects);
        let found_m2: f64 = plan.rooms.iter().map(|room| room.area_m2).sum();
        assert!((found_m2 - area_m2).abs() < 0.3, "{confidence}, {called:?}: {found_m2}");
        let is_drawn = plan
            .furniture
            .iter()
            .any(|piece| [0, 1].iter().all(|axis| (piece.centre_m[*axis] - [0.45, 0.75][*axis]).abs() < 0.1));
        assert_eq!(is_drawn, called == Class::Cabinet, "{:?}", plan.furniture);
    }
}

/// The box of a cabinet reaches 6 cm into the wall of 10 cm behind it, or through it.
#[test]
fn a_cabinet_opens_no_wall() {
    let lidar = flat(0.0);
    let rooms = crate::rooms(&lidar, &[]);
    let bare = plan(&lidar, &[], &rooms, &[]);
    assert_eq!(bare.rooms.len(), 2);
    for reach_m in [0.06, 0.16] {
        let deep_m = 0.4 + reach_m;
        let objects = [cabinet([4.0 + reach_m - deep_m / 2.0, 0.5], [0.9, deep_m, 2.0], 0.9)];
        let plan = plan(&lidar, &[], &rooms, &objects);
        assert!(plan.rooms == bare.rooms && plan.masonry == bare.masonry, "{reach_m}: {:?}", plan.rooms);
    }
}
