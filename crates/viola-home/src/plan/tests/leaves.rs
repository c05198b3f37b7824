//! Plans with open leaves of doors that look like walls.

use super::*;
use viola_reconstruct::{CloudPoint, Label};

/// Returns the points of an upright rectangle above a line, 2.5 cm apart along it.
fn sheet(from_m: [f64; 2], to_m: [f64; 2], normal: [f64; 2], top_m: f64) -> Vec<MapPoint> {
    let length_m = (to_m[0] - from_m[0]).hypot(to_m[1] - from_m[1]);
    let (count, rows) = ((length_m / 0.025).round() as usize, ((top_m - 0.1) / 0.075) as usize);
    let point = |i: usize, j: usize| {
        let part = (i as f64 + 0.5) / count as f64;
        let [x, y] = [0, 1].map(|axis| (from_m[axis] + part * (to_m[axis] - from_m[axis])) as f32);
        let point = CloudPoint {
            position_m: [x, y, 0.1 + 0.075 * j as f32],
            normal: [normal[0] as f32, normal[1] as f32, 0.0],
            color: Class::Wall.color(),
            label: Label::new(Class::Wall, 0.9, 3),
            weight: 100,
        };
        MapPoint { point, clip: 0 }
    };
    (0..count).flat_map(|i| (0..rows).map(move |j| [i, j])).map(|[i, j]| point(i, j)).collect()
}

/// Two rooms of 4 m and 3 m by 3 m, and a door of 0.8 m in the wall between them, from `at_m` on.
struct Scene {
    lidar: LidarMap,
    points: Vec<MapPoint>,
    at_m: f64,
}

/// A slab at the lower jamb of the door, in the right room.
struct Slab {
    degrees: f64,
    length_m: f64,
    top_m: f64,
    /// Depth of what is behind it: a piece of furniture.
    depth_m: f64,
}

const LEAF: Slab = Slab { degrees: 90.0, length_m: 0.76, top_m: 2.05, depth_m: 0.0 };

fn scene(at_m: f64, slab: Option<&Slab>) -> Scene {
    let outer = [[0.0, 0.0], [7.1, 0.0], [7.1, 3.0], [0.0, 3.0]];
    let mut walls: Vec<[[f64; 2]; 2]> = (0..4).map(|i| [outer[i], outer[(i + 1) % 4]]).collect();
    let pieces = [[0.0, at_m], [at_m + 0.8, 3.0]];
    for x in [4.0, 4.05, 4.1] {
        walls.extend(
            pieces.iter().filter(|[from, to]| to - from > 0.02).map(|[from, to]| [[x, *from], [x, *to]]),
        );
    }
    let mut points = Vec::new();
    for [from, to] in pieces {
        points.extend(sheet([4.0, from], [4.0, to], [-1.0, 0.0], 2.5));
        points.extend(sheet([4.1, from], [4.1, to], [1.0, 0.0], 2.5));
    }
    points.extend(sheet([4.1, 0.0], [7.1, 0.0], [0.0, 1.0], 2.5));
    points.extend(sheet([4.1, 3.0], [7.1, 3.0], [0.0, -1.0], 2.5));
    if let Some(slab) = slab {
        let (sin, cos) = slab.degrees.to_radians().sin_cos();
        // From the closed leaf, which points up, into the right room.
        let (along, across) = ([sin, cos], [-cos, sin]);
        let hinge = [4.1, at_m + 0.02];
        let place = |along_m: f64, across_m: f64| {
            [0, 1].map(|axis| hinge[axis] + along_m * along[axis] + across_m * across[axis])
        };
        let back_m = if slab.depth_m > 0.0 { -slab.depth_m } else { -0.04 };
        points.extend(sheet(place(0.0, 0.0), place(slab.length_m, 0.0), across, slab.top_m));
        points.extend(sheet(
            place(0.0, back_m),
            place(slab.length_m, back_m),
            across.map(|part| -part),
            slab.top_m,
        ));
        if slab.depth_m > 0.0 {
            points.extend(sheet(place(slab.length_m, 0.0), place(slab.length_m, back_m), along, slab.top_m));
        }
        walls.extend([0.0, back_m].map(|across_m| [place(0.05, across_m), place(slab.length_m, across_m)]));
    }
    Scene { lidar: lidar_of(&walls), points, at_m }
}

impl Scene {
    fn plan(&self) -> Plan {
        let Scene { lidar, points, .. } = self;
        plan(lidar, points, &crate::rooms(lidar, points), &[])
    }
}

/// Returns the area of the right room.
fn area_m2(plan: &Plan) -> f64 {
    plan.rooms.iter().find(|room| room.contains([5.5, 1.5])).map_or(0.0, |room| room.area_m2)
}

#[test]
fn an_open_leaf_that_is_labelled_wall_is_no_wall() {
    for at_m in [0.06, 0.12, 0.2, 1.0] {
        // Further, the leaf would be in the wall below it.
        let widest = if at_m < 0.2 { 90.0 } else { 98.0 };
        for degrees in [70.0, 80.0, 90.0, widest] {
            let case = format!("{at_m} {degrees}");
            let scene = scene(at_m, Some(&Slab { degrees, ..LEAF }));
            let plan = scene.plan();
            assert_eq!(plan.rooms.len(), 2, "{case}: {:?}", plan.rooms);
            assert!((area_m2(&plan) - 9.0).abs() < 0.1, "{case}: {:?}", plan.rooms);
            assert_eq!(plan.openings.len(), 1, "{case}: {:?}", plan.openings);
            let door = &plan.openings[0];
            assert!(
                door.kind == OpeningKind::Door && (door.width_m() - 0.8).abs() < 0.16,
                "{case}: {door:?}"
            );
            let swing = door.swing.expect("the leaf was seen");
            let off_m = (swing.hinge_m[0] - 4.1).hypot(swing.hinge_m[1] - scene.at_m);
            assert!(off_m < 0.16 && swing.open_m[0] > 4.7, "{case}: {swing:?}");
        }
    }
}

#[test]
fn a_slab_that_is_no_leaf_stays() {
    let cases = [
        ("up to the ceiling", Slab { top_m: 2.5, ..LEAF }),
        ("shorter than a leaf", Slab { length_m: 0.5, ..LEAF }),
        ("longer than the doorway", Slab { length_m: 1.05, ..LEAF }),
        ("low", Slab { top_m: 1.2, ..LEAF }),
        ("the side of a wardrobe", Slab { depth_m: 0.5, ..LEAF }),
    ];
    for (case, slab) in cases {
        let plan = scene(1.0, Some(&slab)).plan();
        let doors = plan.openings.iter().filter(|opening| opening.kind == OpeningKind::Door);
        assert!(doors.into_iter().all(|door| door.swing.is_none()), "{case}: {:?}", plan.openings);
    }
    // Without any slab, too.
    assert!(scene(1.0, None).plan().openings.iter().all(|opening| opening.swing.is_none()));
}

/// One of two segments of the robot has both rooms; the other one is a corner of the right room. No clip saw the wall above the
/// doorway.
#[test]
fn a_leaf_makes_a_gap_in_a_robots_room_a_door() {
    let doors = |slab: Option<&Slab>| {
        let Scene { mut lidar, points, .. } = scene(1.0, slab);
        let cells = (0..138).flat_map(|i| (0..56).map(move |j| [i, j].map(|i| 0.125 + 0.05 * f64::from(i))));
        let is_floor = |p: &[f64; 2]| !(3.9..4.2).contains(&p[0]) || (1.1..1.7).contains(&p[1]);
        let (all, corner): (Vec<_>, Vec<_>) = cells.filter(is_floor).partition(|p| p[0] < 5.8);
        let room = |(id, cells): (&str, Vec<[f64; 2]>)| viola_formats::lidar::Room {
            id: id.to_owned(),
            name: None,
            cells_m: cells.into_iter().map(Point2::from).collect(),
            material: None,
        };
        lidar.rooms = [("1", all), ("2", corner)].map(room).into();
        let plan = plan(&lidar, &points, &crate::rooms(&lidar, &points), &[]);
        plan.openings.iter().filter(|opening| opening.kind == OpeningKind::Door).count()
    };
    assert_eq!(doors(None), 0);
    assert_eq!(doors(Some(&LEAF)), 1);
}
