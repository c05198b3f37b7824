//! Furniture of one room of 4 by 4 metres.

use super::super::room;
use super::super::symbols::{outline_m as outline_of, strokes};
use super::super::tests::{point, standing as object};
use super::*;
use crate::rooms::outline::Outline;

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
        self::point([at.x, at.y, up * seat.size_m[2]], [0.0, 0.0, 1.0], seat.class)
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
fn furniture_of_a_room_within_another_one_is_drawn() {
    let ring = |low: f64, high: f64| vec![[low, low], [high, low], [high, high], [low, high]];
    let around =
        Outline { ring_m: ring(0.0, 8.0), holes_m: vec![ring(2.0, 6.0).into_iter().rev().collect()] };
    let within = Outline { ring_m: ring(2.2, 5.8), holes_m: Vec::new() };
    let rooms = [around, within].map(|outline| room(outline, 0, &[]));
    let bed = object(Class::Bed, 0.8, [4.0, 4.0], [2.0, 1.6, 0.5]);
    assert_eq!(furniture(&[bed], &[], &rooms, &Pose2::IDENTITY).len(), 1);
}

#[test]
fn a_stool_has_no_back() {
    let stool = object(Class::Chair, 0.8, [2.0, 2.0], [0.4, 0.38, 0.65]);
    let mut points = seat_points(&stool, 0.0);
    points.truncate(points.len() / 2);
    let mut top = points.clone();
    top.iter_mut().for_each(|point| point.point.position_m[2] = 0.65);
    points.extend_from_slice(&top);
    // More points at one edge: a twelfth of all.
    points.extend_from_slice(&top[..11]);
    let pieces = drawn(&[stool], &points);
    assert!(pieces.len() == 1 && pieces[0].back.is_none() && strokes(&pieces[0]).len() == 1, "{pieces:?}");
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
        }
    }
}

/// The same pairs as in `objects/nesting.rs`: what the list of objects allows is drawn, whole and in its place.
#[test]
fn pieces_share_their_place_as_objects_do() {
    use Class::*;
    let at = |class, x: f64, y: f64, size_m| object(class, 0.8, [x, y], size_m);
    let raised = |class, bottom_m: f64, size_m: [f64; 3]| {
        let mut raised = at(class, 2.0, 2.0, size_m);
        raised.centre_m[2] += bottom_m;
        raised
    };
    let (counter, cabinet) = ([2.0, 0.6, 0.9], [2.4, 0.6, 0.86]);
    for (name, objects, want) in [
        (
            "a washing machine in a counter",
            [at(Counter, 2.0, 2.0, counter), at(WashingMachine, 2.5, 2.0, [0.6, 0.6, 0.85])],
            [Counter, WashingMachine],
        ),
        (
            "a refrigerator at the end of cabinets",
            [at(Cabinet, 2.0, 2.0, cabinet), at(Refrigerator, 3.1, 2.0, [0.6, 0.6, 1.8])],
            [Cabinet, Refrigerator],
        ),
        (
            "drawers below a desk",
            [at(Desk, 2.0, 2.0, [1.4, 0.7, 0.8]), at(Cabinet, 2.4, 2.0, [0.4, 0.6, 0.6])],
            [Cabinet, Desk],
        ),
        (
            "a chair below a counter",
            [at(Counter, 2.0, 2.0, counter), at(Chair, 2.0, 2.2, [0.45, 0.45, 0.8])],
            [Chair, Counter],
        ),
        (
            "a worktop on cabinets",
            [at(Cabinet, 2.0, 2.0, cabinet), raised(Counter, 0.86, [2.4, 0.6, 0.04])],
            [Cabinet, Counter],
        ),
        (
            "a television that is wider than its cabinet",
            [at(Cabinet, 2.0, 2.0, [0.8, 0.4, 0.5]), raised(Television, 1.0, [1.6, 0.12, 0.6])],
            [Cabinet, Television],
        ),
    ] {
        assert_drawn_whole(name, &objects, &[], want);
    }
}

/// Returns a sofa of 2.4 m by 2.4 m, and the points of its seats. Its recess of 1.6 m by 1.6 m is at +x and +y.
fn corner_sofa() -> (Object, Vec<MapPoint>) {
    const STEPS: usize = 24;
    let part = |i: usize| (i as f64 + 0.5) / STEPS as f64 - 0.5;
    let places = (0..STEPS * STEPS).map(|i| [part(i % STEPS), part(i / STEPS)]);
    let is_seat = |[x, y]: &[f64; 2]| 2.4 * x < -0.4 || 2.4 * y < -0.4;
    let seat = |[x, y]: [f64; 2]| point([2.0 + 2.4 * x, 2.0 + 2.4 * y, 0.4], [0.0, 0.0, 1.0], Class::Sofa);
    (object(Class::Sofa, 0.6, [2.0, 2.0], [2.4, 2.4, 0.8]), places.filter(is_seat).map(seat).collect())
}

#[test]
fn a_table_stands_in_the_recess_of_a_corner_sofa() {
    let (sofa, points) = corner_sofa();
    let objects = [sofa, object(Class::Table, 0.9, [2.4, 2.4], [0.8, 0.6, 0.4])];
    assert_drawn_whole("a table in a recess", &objects, &points, [Class::Sofa, Class::Table]);
    // Without the points of its seats, no recess is known.
    assert_eq!(drawn(&objects, &[]).len(), 1);
}

/// Turned by quarters, and by a little more.
#[test]
fn a_corner_sofa_is_an_l() {
    for (quarter, off_rad) in (0..4u8).flat_map(|quarter| [(quarter, 0.0), (quarter, 0.2)]) {
        let (mut sofa, mut points) = corner_sofa();
        let turn = Pose2::new(2.0, 2.0, f64::from(quarter) * FRAC_PI_2 + off_rad);
        for position_m in points.iter_mut().map(|point| &mut point.point.position_m) {
            let at = turn.apply(&Point2::new(f64::from(position_m[0]) - 2.0, f64::from(position_m[1]) - 2.0));
            (position_m[0], position_m[1]) = (at.x as f32, at.y as f32);
        }
        sofa.yaw_rad = turn.yaw_rad.rem_euclid(std::f64::consts::PI);
        let pieces = drawn(&[sofa], &points);
        let name = format!("{quarter} {off_rad}: {pieces:?}");
        assert_eq!(pieces.len(), 1, "{name}");
        let is_near = |metres: f64, of: f64| (metres - of).abs() < 1e-6;
        assert!((0..2).all(|axis| is_near(pieces[0].size_m[axis], 2.4)), "{name}");
        assert!((0..2).all(|axis| is_near(pieces[0].centre_m[axis], 2.0)), "{name}");
        // Along the axes, as the sofa nearly is.
        let straight = Pose2::new(2.0, 2.0, f64::from(quarter) * FRAC_PI_2);
        let l = [[-1.2, -1.2], [1.2, -1.2], [1.2, -0.4], [-0.4, -0.4], [-0.4, 1.2], [-1.2, 1.2]];
        let symbol = strokes(&pieces[0]);
        let outline_m = &symbol[0].points_m;
        assert_eq!(*outline_m, outline_of(&pieces[0]), "{name}");
        for (corner, [x, y]) in outline_m.iter().zip(l) {
            let off_m = (Point2::from(*corner) - straight.apply(&Point2::new(x, y))).norm();
            assert!(off_m < 1e-6, "{name} {outline_m:?}");
        }
        // The seats have the same shape, between backs of 0.22 m and arms of 0.16 m, and a seat is in the corner.
        assert_eq!((outline_m.len(), symbol[1].points_m.len(), symbol.len()), (6, 6, 6), "{name}");
        for stroke in &symbol[1..] {
            for corner in &stroke.points_m {
                let [x, y]: [f64; 2] = straight.inverse().apply(&Point2::from(*corner)).into();
                let is_on_seats = x.min(y) < -0.4 + 1e-6 && x.min(y) > -0.99 && x.max(y) < 1.05;
                assert!(is_on_seats, "{name} {corner:?}");
            }
        }
    }
}

fn assert_drawn_whole(name: &str, objects: &[Object], points: &[MapPoint], want: [Class; 2]) {
    let pieces = drawn(objects, points);
    let found: Vec<Class> = pieces.iter().map(|piece| piece.class).collect();
    assert_eq!(found, want, "{name}");
    for piece in pieces {
        let object = objects.iter().find(|object| object.id == piece.id).unwrap();
        for axis in 0..2 {
            assert!((piece.centre_m[axis] - object.centre_m[axis]).abs() < 1e-6, "{name}: {piece:?}");
            assert!((piece.size_m[axis] - object.size_m[axis]).abs() < 1e-6, "{name}: {piece:?}");
        }
    }
}
