//! Furniture of one room of 4 by 4 metres.

use super::super::room;
use super::super::symbols::strokes;
use super::*;
use crate::rooms::outline::Outline;
use viola_reconstruct::{CloudPoint, Label};

fn object(class: Class, confidence: f64, [x, y]: [f64; 2], size_m: [f64; 3]) -> Object {
    Object {
        id: format!("{}-1", class.name()),
        class,
        confidence,
        centre_m: [x, y, size_m[2] / 2.0],
        size_m,
        yaw_rad: 0.0,
        room: None,
        points: 100,
        clips: vec![0],
        samples: Vec::new(),
    }
}

fn drawn(objects: &[Object], points: &[MapPoint]) -> Vec<Furniture> {
    let ring_m = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
    let rooms = [room(Outline { ring_m, holes_m: Vec::new() }, 0, &[])];
    furniture(objects, points, &rooms, &Pose2::IDENTITY)
}

/// Returns points of an unturned seat at half of its height, and of its backrest at +y, turned as the object.
fn seat_points(seat: &Object, turn_rad: f64) -> Vec<MapPoint> {
    const STEPS: i32 = 10;
    let placed = Pose2::new(seat.centre_m[0], seat.centre_m[1], turn_rad);
    let point = |[along, across, up]: [f64; 3]| {
        let at = placed.apply(&Point2::new(along * seat.size_m[0], across * seat.size_m[1]));
        let point = CloudPoint {
            position_m: [at.x, at.y, up * seat.size_m[2]].map(|c| c as f32),
            normal: [0.0, 0.0, 1.0],
            color: seat.class.color(),
            label: Label::new(seat.class, 0.9, 3),
            weight: 100,
        };
        MapPoint { point, clip: 0 }
    };
    let part = |i: i32| f64::from(i) / f64::from(STEPS);
    let raster = || (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |j| (i, j)));
    let seats = raster().map(|(i, j)| point([part(i) - 0.5, part(j) - 0.5, 0.5]));
    let backrest = raster().map(|(i, j)| point([part(i) - 0.5, 0.5, 0.5 + part(j) / 2.0]));
    seats.chain(backrest).collect()
}

#[test]
fn a_chair_has_its_back_at_its_high_points() {
    for (quarter, off_rad) in (0..4u8).flat_map(|quarter| [(quarter, 0.0), (quarter, 0.1)]) {
        let turn_rad = f64::from(quarter) * FRAC_PI_2 + off_rad;
        // The wall beside it does not tell the back.
        let mut chair = object(Class::Chair, 0.8, [2.0, 0.4], [0.46, 0.44, 0.9]);
        // A half turn does not change a box.
        chair.yaw_rad = turn_rad.rem_euclid(std::f64::consts::PI);
        let points = seat_points(&chair, turn_rad);
        let pieces = drawn(std::slice::from_ref(&chair), &points);
        assert_eq!(pieces.len(), 1, "{turn_rad}");
        assert_eq!(pieces[0].back, Some((2 + quarter) % 4), "{turn_rad}");
        assert_eq!(strokes(&pieces[0]).len(), 2, "{turn_rad}");
        // Its outline alone, without a line at any side.
        let unseen = drawn(&[chair], &[]);
        assert!(unseen[0].back.is_none() && strokes(&unseen[0]).len() == 1, "{turn_rad}");
    }
}

#[test]
fn a_sofa_without_a_wall_has_its_back_at_its_high_points() {
    for (y, back) in [(2.0, 2), (0.5, 0)] {
        let sofa = object(Class::Sofa, 0.8, [2.0, y], [1.8, 0.9, 0.9]);
        let points = seat_points(&sofa, 0.0);
        assert_eq!(drawn(&[sofa], &points)[0].back, Some(back), "{y}");
    }
}

#[test]
fn a_thin_piece_that_a_wall_cuts_is_drawn() {
    for y in [0.05, 0.06, 3.94, 3.95] {
        let radiator = object(Class::Radiator, 0.8, [2.0, y], [0.9, 0.11, 0.6]);
        assert_eq!(drawn(&[radiator], &[]).len(), 1, "{y}");
    }
}

#[test]
fn surer_and_standing_pieces_keep_their_place() {
    let table = object(Class::Table, 0.65, [2.0, 1.5], [1.2, 0.8, 0.75]);
    // Three fifths of it are below the table; it is placed before the table or after it.
    let chair = |confidence| object(Class::Chair, confidence, [2.0, 1.145], [0.45, 0.45, 0.9]);
    let toilet = object(Class::Toilet, 0.84, [2.0, 1.5], [0.65, 0.4, 0.8]);
    let shelf = object(Class::Shelf, 0.46, [2.0, 1.5], [0.9, 0.7, 0.8]);
    let washing = object(Class::WashingMachine, 0.5, [2.0, 1.5], [0.6, 0.6, 0.85]);
    let mut hung = object(Class::Cabinet, 0.9, [2.0, 1.5], [1.2, 0.6, 0.7]);
    hung.centre_m[2] = 1.75;
    let counter = object(Class::Counter, 0.5, [2.0, 1.5], [2.0, 0.6, 0.9]);
    let sink = object(Class::Sink, 0.8, [2.0, 1.5], [0.5, 0.4, 0.2]);
    let cases = [
        (vec![table.clone(), chair(0.6)], vec![Class::Chair, Class::Table]),
        (vec![table.clone(), chair(0.9)], vec![Class::Chair, Class::Table]),
        (vec![shelf, toilet], vec![Class::Toilet]),
        (vec![hung, washing], vec![Class::WashingMachine]),
        (vec![sink, counter], vec![Class::Counter, Class::Sink]),
    ];
    for (objects, want) in cases {
        let pieces = drawn(&objects, &[]);
        let classes: Vec<Class> = pieces.iter().map(|piece| piece.class).collect();
        assert_eq!(classes, want);
        for piece in pieces {
            let object = objects.iter().find(|object| object.id == piece.id).unwrap();
            let off = [0, 1].map(|axis| (piece.centre_m[axis] - object.centre_m[axis]).abs());
            assert!(off.iter().all(|off| *off < 1e-6), "{piece:?}");
            assert_eq!(piece.is_set_in, piece.class == Class::Sink);
        }
    }
}
