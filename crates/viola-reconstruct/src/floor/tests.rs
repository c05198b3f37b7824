//! Tests of the floor search in rooms of any orientation.

use super::*;
use crate::cloud::Label;
use proptest::prelude::*;
use viola_geometry::taxonomy::Class;

const VOXEL_M: f64 = 0.05;

/// Returns a level rectangle at `z`, seen from above, with a ripple of a centimetre.
fn level(x: (f64, f64), y: (f64, f64), z: f64) -> Vec<(Point3, Vector3)> {
    let steps = |range: (f64, f64)| ((range.1 - range.0) / VOXEL_M) as usize;
    let at = |i: usize, j: usize| {
        let ripple = 0.01 * ((i * 7 + j * 13) % 5) as f64 / 5.0 - 0.005;
        Point3::new(x.0 + i as f64 * VOXEL_M, y.0 + j as f64 * VOXEL_M, z + ripple)
    };
    (0..steps(x)).flat_map(|i| (0..steps(y)).map(move |j| (at(i, j), Vector3::z()))).collect()
}

fn wall(height_m: f64) -> Vec<(Point3, Vector3)> {
    let turned = level((0.0, 3.0), (0.0, height_m), 0.0);
    turned.into_iter().map(|(p, _)| (Point3::new(p.x, 3.0 + p.z, p.y), -Vector3::y())).collect()
}

/// Returns a room seen from 1.4 m above its floor, looking slightly down along y, in a world moved by `turn`.
fn room(surfaces: &[Vec<(Point3, Vector3)>], turn: &Pose3) -> (PointCloud, Vec<KeyFrame>) {
    let point = |(p, n): &(Point3, Vector3)| {
        CloudPoint::new((turn * p).map(|c| c as f32).into(), (turn * n).map(|c| c as f32).into())
    };
    let points = surfaces.iter().flatten().map(point).collect();
    let looking = UnitQuaternion::face_towards(&Vector3::new(0.0, 1.0, -0.4), &-Vector3::z());
    let camera = Pose3::from_parts(Vector3::new(1.5, 0.2, 1.4).into(), looking);
    (PointCloud { points, voxel_m: VOXEL_M }, vec![KeyFrame::blind(turn * camera)])
}

fn turned(axis: [f64; 3], angle: f64) -> Pose3 {
    let axis = Vector3::from(axis).try_normalize(1e-3).unwrap_or(Vector3::x());
    Pose3::new(Vector3::new(3.0, -2.0, 1.0), axis * angle)
}

fn z_up() -> Up {
    Up::of_device(Vector3::z())
}

/// Checks that the floor is found 1.4 m below the camera, level to half a degree.
fn check(surfaces: &[Vec<(Point3, Vector3)>], turn: &Pose3, gravity_known: bool) {
    let (cloud, keys) = room(surfaces, turn);
    let up = turn * Vector3::z();
    let known = gravity_known.then(|| Up::of_device(up));
    let floor = find_floor(&cloud, &keys, known.as_ref(), &CAMERA_HEIGHT_M, 5).unwrap();
    assert!((floor.first_camera_height_m - 1.4).abs() < 0.01, "{floor:?}");
    assert!(floor.plane_in_world.normal.dot(&up) > 0.5f64.to_radians().cos(), "{floor:?}");
    // The clip frame: the first camera stands over the origin and faces along x.
    let camera = floor.clip_from_world * keys[0].world_from_camera;
    assert!(camera.translation.vector.xy().norm() < 1e-6);
    let facing = heading(&camera, &Vector3::z());
    assert!((facing - Vector3::x()).norm() < 1e-6, "{facing:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn the_floor_is_found_in_any_world(axis in prop::array::uniform3(-1.0..1.0f64), angle in -3.1..3.1f64) {
        let surfaces = [level((0.0, 3.0), (0.5, 3.0), 0.0), wall(2.4)];
        check(&surfaces, &turned(axis, angle), true);
        check(&surfaces, &turned(axis, angle), false);
    }
}

#[test]
fn a_table_or_a_bed_is_not_the_floor() {
    let little_floor = level((0.0, 3.0), (0.5, 1.0), 0.0);
    for top in [level((0.2, 2.8), (1.0, 3.0), 0.75), level((0.2, 2.8), (1.0, 3.0), 0.45)] {
        check(&[little_floor.clone(), top, wall(2.4)], &Pose3::identity(), true);
    }
}

#[test]
fn what_pictures_call_a_bed_is_not_the_floor() {
    let surfaces = [level((0.2, 2.8), (0.5, 3.0), 0.45)];
    let (mut cloud, keys) = room(&surfaces, &Pose3::identity());
    let find = |cloud: &PointCloud| find_floor(cloud, &keys, Some(&z_up()), &CAMERA_HEIGHT_M, 5);
    // By its shape alone the only level surface in sight passes for the floor.
    assert!((find(&cloud).unwrap().first_camera_height_m - 0.95).abs() < 0.01);
    for point in cloud.points.iter_mut().filter(|point| point.normal[2] > 0.9) {
        point.label = Label::new(Class::Bed, 0.8, 3);
    }
    assert_eq!(find(&cloud).unwrap_err().reason().code, "no_floor");
    for point in cloud.points.iter_mut().filter(|point| point.normal[2] > 0.9) {
        point.label = Label::new(Class::Rug, 0.8, 3);
    }
    assert!(find(&cloud).is_ok());
}

/// Walls have no level top, so a level surface that pictures mislabel as a wall stays a candidate.
#[test]
fn a_floor_that_pictures_call_a_wall_is_the_floor() {
    let surfaces = [level((0.0, 3.0), (0.5, 3.0), 0.0), wall(2.4)];
    let (mut cloud, keys) = room(&surfaces, &Pose3::identity());
    for class in [Class::Wall, Class::Door, Class::Curtain, Class::Mirror] {
        for point in &mut cloud.points {
            point.label = Label::new(class, 0.9, 3);
        }
        let floor = find_floor(&cloud, &keys, Some(&z_up()), &CAMERA_HEIGHT_M, 5).unwrap();
        assert!((floor.first_camera_height_m - 1.4).abs() < 0.01, "{class:?} {floor:?}");
    }
}

/// Gravity levels a strip of a tilted floor; a broad part keeps most of its own tilt. An accelerometer that
/// may be mounted askew has little weight.
#[test]
fn the_less_of_a_floor_is_seen_the_more_gravity_levels_it() {
    const LEAN_RAD: f64 = 0.03;
    let lean = Pose3::new(Vector3::zeros(), Vector3::x() * LEAN_RAD);
    let leaning = |y_end_m: f64, up: &Up| {
        let surfaces = [level((0.0, 3.0), (0.5, y_end_m), 0.0)];
        let (cloud, keys) = room(&surfaces, &lean);
        find_floor(&cloud, &keys, Some(up), &CAMERA_HEIGHT_M, 5).unwrap().gravity_angle_rad.unwrap()
    };
    let of_device = z_up();
    let (strip, broad) = (leaning(0.7, &of_device), leaning(3.0, &of_device));
    assert!(strip < 0.3 * LEAN_RAD && 0.5 * LEAN_RAD < broad && broad < 0.8 * LEAN_RAD, "{strip} {broad}");
    let askew = Up { deviation_rad: 3f64.to_radians(), ..of_device };
    assert!(leaning(3.0, &askew) > 0.95 * LEAN_RAD);
}

#[test]
fn without_a_floor_there_is_a_reason() {
    let (cloud, keys) = room(&[wall(2.4)], &Pose3::identity());
    let none = find_floor(&cloud, &keys, Some(&z_up()), &CAMERA_HEIGHT_M, 5).unwrap_err();
    assert_eq!(none.reason().code, "no_floor");
    assert!(!none.reason().detail.contains("upright"), "{none:?}");
    let none = find_floor(&PointCloud::default(), &keys, None, &CAMERA_HEIGHT_M, 5).unwrap_err();
    assert_eq!(none.reason().code, "nothing_fused");
    // The wall's foot is 1.4 m below the camera, so lower assumed floors remain.
    let guesses = assume(&cloud, &keys, &z_up());
    assert!(guesses.iter().all(|g| g.assumed && g.first_camera_height_m > 1.39), "{guesses:?}");
    assert!(!guesses.is_empty());
}

/// A phone that is held sideways has walls above and below its pictures.
#[test]
fn without_gravity_a_sideways_recording_is_told() {
    let (cloud, mut keys) = room(&[level((0.0, 3.0), (0.5, 3.0), 0.0), wall(2.4)], &Pose3::identity());
    for key in &mut keys {
        key.world_from_camera.rotation *=
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    }
    let find = |up: Option<&Up>| find_floor(&cloud, &keys, up, &CAMERA_HEIGHT_M, 5);
    let none = find(None).unwrap_err().reason();
    assert!(none.code == "no_floor" && none.detail.contains("upright"), "{none:?}");
    assert!(find(Some(&z_up())).is_ok());
}

/// The floor, and the wall before a camera that looks up, are equally far from its upward axis.
#[test]
fn without_gravity_a_wall_that_the_camera_leaves_is_not_the_floor() {
    let (cloud, _) = room(&[level((0.0, 3.0), (0.5, 2.0), 0.0), wall(2.4)], &Pose3::identity());
    let looking = UnitQuaternion::face_towards(&Vector3::new(0.0, 1.0, 1.0), &-Vector3::z());
    let camera = |y: f64| Pose3::from_parts(Vector3::new(1.5, y, 1.4).into(), looking);
    let find = |step_m: f64| {
        let keys: Vec<KeyFrame> =
            (0..20).map(|i| KeyFrame::blind(camera(1.0 - step_m * f64::from(i)))).collect();
        find_floor(&cloud, &keys, None, &CAMERA_HEIGHT_M, 5).unwrap().first_camera_height_m
    };
    assert!((find(0.13) - 1.4).abs() < 0.01);
    // Without a step nothing tells them apart: the wall is larger.
    assert!((find(0.0) - 2.0).abs() < 0.01);
}

/// A phone that is laid down is too near to the floor, and false depth lies below it.
#[test]
fn without_gravity_a_scrap_below_all_cameras_is_not_the_floor() {
    let scrap = level((1.0, 1.32), (1.0, 1.32), -0.4);
    let (cloud, _) = room(&[level((0.0, 3.0), (0.5, 3.0), 0.0), scrap], &Pose3::identity());
    let looking = UnitQuaternion::face_towards(&Vector3::new(0.0, 1.0, -0.4), &-Vector3::z());
    let camera = |z: f64| KeyFrame::blind(Pose3::from_parts(Vector3::new(1.5, 0.2, z).into(), looking));
    let keys: Vec<KeyFrame> = (0..20).map(|i| camera(if i < 16 { 1.4 } else { 0.1 })).collect();
    let floor = find_floor(&cloud, &keys, None, &CAMERA_HEIGHT_M, 5).unwrap();
    assert!((floor.first_camera_height_m - 1.4).abs() < 0.01, "{floor:?}");
}

/// Checks the heights of the camera above the possible floors, and whether each is assumed.
fn check_floors(surfaces: &[Vec<(Point3, Vector3)>], expected: &[(f64, bool)]) {
    let (cloud, keys) = room(surfaces, &Pose3::identity());
    let (floors, none_seen) = floors(&cloud, &keys, Some(&z_up()), 5);
    let told: Vec<_> = floors.iter().map(|f| (f.first_camera_height_m, f.assumed)).collect();
    let is_near = |(a, b): (&(f64, bool), &(f64, bool))| (a.0 - b.0).abs() < 0.02 && a.1 == b.1;
    assert!(told.len() == expected.len() && told.iter().zip(expected).all(is_near), "{told:?}");
    assert!(none_seen.is_none());
}

#[test]
fn other_floors_compete_where_the_seen_one_is_doubtful() {
    let floor = || level((0.0, 3.0), (0.5, 3.0), 0.0);
    let assumed = [(1.45, true), (1.25, true), (1.65, true)];
    check_floors(&[floor(), wall(2.4)], &[(1.4, false)]);
    // Only a bed is in sight.
    let bed = level((0.2, 2.8), (0.5, 3.0), 0.5);
    check_floors(&[bed], &[&[(0.9, false)], &assumed[..]].concat());
    // A platform with little floor beside it.
    let (platform, strip) = (level((0.2, 2.8), (0.8, 3.0), 0.3), level((0.0, 3.0), (0.5, 0.61), 0.0));
    check_floors(&[platform, strip, wall(2.4)], &[(1.1, false), (1.45, true), (1.65, true)]);
    // A sunken entrance beside a floor of seven times its area, and of five times.
    let entrance = || level((0.0, 1.0), (3.0, 4.1), -0.15);
    check_floors(&[floor(), entrance(), wall(2.4)], &[(1.4, false), (1.65, true)]);
    let smaller = level((0.0, 3.0), (0.5, 2.35), 0.0);
    check_floors(&[smaller, entrance(), wall(2.4)], &[(1.55, false), (1.4, false)]);
    // The lowest step in sight below a landing.
    let steps: Vec<_> = (1..=6)
        .map(|i| {
            level((3.0 + 0.25 * f64::from(i), 3.25 + 0.25 * f64::from(i)), (0.5, 1.5), -0.18 * f64::from(i))
        })
        .collect();
    check_floors(&[vec![floor()], steps].concat(), &[(2.48, false), (1.4, false)]);
    // The false depth of a mirror reaches below the floor.
    let mirrored = wall(0.6).into_iter().map(|(p, n)| (p - 0.6 * Vector3::z(), n)).collect();
    check_floors(&[floor(), wall(2.4), mirrored], &[(1.4, false)]);
}

#[test]
fn a_camera_that_looks_straight_down_heads_where_its_picture_is_up() {
    let down = UnitQuaternion::face_towards(&-Vector3::z(), &-Vector3::y());
    let camera = Pose3::from_parts(Vector3::zeros().into(), down);
    assert!((heading(&camera, &Vector3::z()) - Vector3::y()).norm() < 1e-6);
}
