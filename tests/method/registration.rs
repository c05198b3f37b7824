//! Registration on rooms drawn by hand: the answer follows the map in any pose.

use proptest::prelude::*;
use std::f64::consts::PI;
use viola_align as align;
use viola_align::{
    AlignParams, Alignment, AlignmentState, Alternative, FloorHypothesis, Hit, Landmark, Observation, Target,
    VirtualScan,
};
use viola_formats::lidar::LidarMap;
use viola_geometry::progress::Silent;
use viola_geometry::taxonomy::Class;
use viola_geometry::{Point2, Pose2, Vector2, angle_between};
use viola_reconstruct::FloorReport;

type Corner = (f64, f64);

/// A flat of two rooms with a bay, a chimney breast and a door between them: no symmetry.
const OUTLINE: &[Corner] = &[
    (0.0, 0.0),
    (5.0, 0.0),
    (5.0, 1.2),
    (6.0, 1.2),
    (6.0, 2.4),
    (5.0, 2.4),
    (5.0, 4.0),
    (3.1, 4.0),
    (3.1, 3.6),
    (2.2, 3.6),
    (2.2, 4.0),
    (0.0, 4.0),
    (0.0, 0.0),
];
const ANNEX: &[Corner] = &[(5.0, 4.0), (5.0, 7.0), (1.5, 7.0), (1.5, 5.2), (0.6, 5.2), (0.6, 4.0)];

/// Returns points every 2 cm along walls.
fn walls(lines: &[&[Corner]]) -> Vec<Point2> {
    let mut points = Vec::new();
    for line in lines {
        for ends in line.windows(2) {
            let (a, b) = (Point2::new(ends[0].0, ends[0].1), Point2::new(ends[1].0, ends[1].1));
            let steps = ((b - a).norm() / 0.02).round() as usize;
            points.extend((0..steps).map(|i| a + (b - a) * (i as f64 / steps as f64)));
        }
    }
    points
}

fn target(points: Vec<Point2>) -> Target {
    Target::from_points(points, None, None).unwrap()
}

/// Returns the observation of these points by a clip that starts at `map_from_clip`.
fn observation(seen: &[Point2], map_from_clip: &Pose2) -> Observation {
    let clip_from_map = map_from_clip.inverse();
    let hit = |p: &Point2| Hit { extent_m: 2.0, ..Hit::standing(clip_from_map.apply(p), Vector2::x()) };
    Observation {
        scan: VirtualScan {
            hits: seen.iter().map(hit).collect(),
            cameras: vec![Pose2::IDENTITY],
            ..VirtualScan::default()
        },
        key_frames: 10,
        floor: Some(FloorReport {
            assumed: false,
            camera_height_m: 1.4,
            support_points: 1000,
            gravity_angle_deg: None,
        }),
        ..Observation::default()
    }
}

fn register(observation: &Observation, target: &Target) -> Alignment {
    align::register(observation, &[target], &AlignParams::default(), &Silent).unwrap()
}

/// Returns every fifth point of the living room: 10 cm apart.
fn seen() -> Vec<Point2> {
    walls(&[OUTLINE]).into_iter().step_by(5).collect()
}

fn check(answer: &Alignment, truth: &Pose2) {
    let pose = answer.map_from_clip.unwrap_or_else(|| panic!("no pose: {:?}", answer.reasons));
    assert!(pose.distance_m(truth) < 0.02, "{pose:?} is not {truth:?}");
    assert!(angle_between(pose.yaw_rad, truth.yaw_rad) < 0.5f64.to_radians(), "{pose:?} is not {truth:?}");
    assert_eq!(answer.state, AlignmentState::Aligned, "{:?}", answer.reasons);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn any_place_and_heading_is_found(x in 0.5..4.5f64, y in 0.5..3.5f64, yaw in -PI..PI) {
        let truth = Pose2::new(x, y, yaw);
        check(&register(&observation(&seen(), &truth), &target(walls(&[OUTLINE, ANNEX]))), &truth);
    }

    #[test]
    fn moving_the_map_moves_the_answer(dx in -30.0..30.0f64, dy in -30.0..30.0f64, turn in -PI..PI) {
        let truth = Pose2::new(2.0, 1.5, 0.7);
        let moved = Pose2::new(dx, dy, turn);
        let points = walls(&[OUTLINE, ANNEX]).iter().map(|p| moved.apply(p)).collect();
        check(&register(&observation(&seen(), &truth), &target(points)), &moved.compose(&truth));
    }
}

#[test]
fn the_order_of_points_does_not_matter() {
    let truth = Pose2::new(2.0, 1.5, 0.7);
    let (points, hits) = (walls(&[OUTLINE, ANNEX]), seen());
    let (mut points_back, mut hits_back) = (points.clone(), hits.clone());
    points_back.reverse();
    hits_back.reverse();
    let one = register(&observation(&hits, &truth), &target(points)).map_from_clip.unwrap();
    let other = register(&observation(&hits_back, &truth), &target(points_back)).map_from_clip.unwrap();
    // Sums in another order differ in the last bits.
    assert!(one.distance_m(&other) < 1e-6 && angle_between(one.yaw_rad, other.yaw_rad) < 1e-6);
}

#[test]
fn a_mirrored_map_is_not_matched() {
    let truth = Pose2::new(2.0, 1.5, 0.7);
    let mirrored = walls(&[OUTLINE, ANNEX]).iter().map(|p| Point2::new(-p.x, p.y)).collect();
    let answer = register(&observation(&seen(), &truth), &target(mirrored));
    assert_ne!(answer.state, AlignmentState::Aligned, "{answer:?}");
}

#[test]
fn twin_rooms_are_ambiguous_and_both_listed() {
    let twin = walls(&[OUTLINE]);
    let across = Pose2::new(12.0, 3.0, 2.0);
    let points = twin.iter().copied().chain(twin.iter().map(|p| across.apply(p))).collect();
    let truth = Pose2::new(2.0, 1.5, 0.7);
    let answer = register(&observation(&seen(), &truth), &target(points));
    assert_eq!(answer.state, AlignmentState::Ambiguous, "{:?}", answer.alternatives);
    assert!(answer.reasons.iter().any(|reason| reason.code == "several_modes"), "{:?}", answer.reasons);
    for pose in [truth, across.compose(&truth)] {
        assert!(answer.alternatives.iter().any(|a| a.map_from_clip.distance_m(&pose) < 0.05), "{pose:?}");
    }
}

#[test]
fn too_little_is_said_to_be_too_little() {
    let few: Vec<Point2> = seen().into_iter().take(10).collect();
    let answer = register(&observation(&few, &Pose2::IDENTITY), &target(walls(&[OUTLINE])));
    assert_eq!((answer.state, answer.map_from_clip), (AlignmentState::Failed, None));
    assert_eq!(answer.reasons[0].code, "too_few_hits");
}

#[test]
fn a_clip_without_a_pose_has_no_probability() {
    let map = vec![Point2::new(0.0, 0.0), Point2::new(0.1, 0.0)];
    let answer = register(&observation(&seen(), &Pose2::IDENTITY), &target(map));
    assert!(answer.reasons.iter().any(|reason| reason.code == "no_support"), "{:?}", answer.reasons);
    assert_eq!((answer.map_from_clip, answer.probability, answer.covariance), (None, None, None));
    assert!(!answer.alternatives.is_empty());
    assert!(answer.alternatives.iter().all(|one| one.probability.is_none()), "{:?}", answer.alternatives);
}

/// The clip shows the room as from one pose above the first floor, and as from another one above the second floor.
#[test]
fn an_alternative_above_another_floor_has_the_height_between_the_floors() {
    let target = target(walls(&[OUTLINE, ANNEX]));
    let poses = [Pose2::new(2.0, 1.5, 0.7), Pose2::new(3.5, 2.0, -1.2)];
    for heights_m in [[1.0, 1.45], [1.45, 1.0]] {
        let [mut clip, other] = poses.map(|pose| observation(&seen(), &pose));
        let floors = heights_m.map(|camera_height_m| FloorReport {
            assumed: true,
            camera_height_m,
            support_points: 0,
            gravity_angle_deg: Some(0.0),
        });
        let [first, second] = floors;
        clip.floor = Some(first);
        clip.other_floors = vec![FloorHypothesis { scan: other.scan, floor: second }];
        let answer = register(&clip, &target);
        let answer_m = answer.floor.as_ref().unwrap().camera_height_m;
        for (pose, camera_height_m) in poses.iter().zip(heights_m) {
            let near = |one: &&Alternative| one.map_from_clip.distance_m(pose) < 0.05;
            let one = answer.alternatives.iter().find(near).unwrap();
            assert!((answer_m + one.rise_m - camera_height_m).abs() < 1e-9, "{heights_m:?}: {one:?}");
        }
        // Above the answer's own floor an alternative is written as in earlier versions.
        let written = serde_json::to_value(&answer.alternatives[0]).unwrap();
        assert_eq!((answer.alternatives[0].rise_m, written.get("rise_m")), (0.0, None));
        assert_eq!(serde_json::from_value::<Alternative>(written).unwrap().rise_m, 0.0);
    }
}

fn of_level(level: &str, points: Vec<Point2>) -> Target {
    let mut target = target(points);
    target.level = level.parse().unwrap();
    target
}

fn register_to(observation: &Observation, targets: &[&Target]) -> Alignment {
    align::register(observation, targets, &AlignParams::default(), &Silent).unwrap()
}

/// Two storeys of the same size. Only the upper one has a bay and a chimney breast.
#[test]
fn walls_tell_one_level_from_another() {
    const PLAIN: &[Corner] = &[(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0), (0.0, 0.0)];
    let main = of_level("main", walls(&[PLAIN]));
    let across = Pose2::new(-7.0, 4.0, 1.0);
    let upper = of_level("upper", walls(&[OUTLINE]).iter().map(|p| across.apply(p)).collect());
    let truth = Pose2::new(2.0, 1.5, 0.7);
    let answer = register_to(&observation(&seen(), &truth), &[&main, &upper]);
    let pose = answer.map_from_clip.unwrap();
    assert!(pose.distance_m(&across.compose(&truth)) < 0.02, "{answer:?}");
    assert_eq!((answer.level.as_str(), answer.level), ("upper", answer.alternatives[0].level));
    // The best pose on the other level is among the rivals.
    let rival = answer.alternatives.iter().find(|one| one.level.is_main()).unwrap();
    assert!(rival.probability.unwrap() < 0.2 && answer.probability.unwrap() > 0.8, "{answer:?}");
    // Alone the level is the whole home, and the pose the same.
    let alone = register_to(&observation(&seen(), &truth), &[&upper]);
    assert_eq!((alone.map_from_clip, alone.level), (answer.map_from_clip, answer.level));
}

/// A clip that shows only things that both storeys have is ambiguous between them.
#[test]
fn levels_that_look_alike_share_the_probability() {
    let truth = Pose2::new(2.0, 1.5, 0.7);
    let [main, upper] = ["main", "upper"].map(|level| of_level(level, walls(&[OUTLINE])));
    let answer = register_to(&observation(&seen(), &truth), &[&main, &upper]);
    assert_eq!(answer.state, AlignmentState::Ambiguous, "{:?}", answer.alternatives);
    assert!(answer.reasons.iter().any(|reason| reason.code == "several_modes"), "{:?}", answer.reasons);
    // Both are listed, at the same place of their maps.
    let [best, rival] = &answer.alternatives[..2] else { panic!("{answer:?}") };
    assert_eq!([best.level.as_str(), rival.level.as_str()], ["main", "upper"]);
    assert!([best, rival].iter().all(|one| one.map_from_clip.distance_m(&truth) < 0.05), "{answer:?}");
    assert!((best.probability.unwrap() - rival.probability.unwrap()).abs() < 0.15, "{answer:?}");
    let sum: f64 = answer.alternatives.iter().filter_map(|one| one.probability).sum();
    assert!(sum <= 1.0 + 1e-9, "{sum}");
}

/// Returns a Valetudo map of two adjacent rooms with the same walls, 4 m apart.
fn twin_rooms(names: [&str; 2]) -> LidarMap {
    let (mut wall, mut floors) = (Vec::new(), [Vec::new(), Vec::new()]);
    for (room, floor) in floors.iter_mut().enumerate() {
        let left = 10 + 80 * room;
        for y in 0..60 {
            for x in 0..70 {
                // A notch in one corner, so that a room has no symmetry.
                let is_inside =
                    |x: i32, y: i32| (1..69).contains(&x) && (1..59).contains(&y) && !(x > 48 && y > 44);
                if is_inside(x, y) {
                    floor.extend([left as i32 + x, 10 + y, 1]);
                } else if (-1..=1).any(|dx| (-1..=1).any(|dy| is_inside(x + dx, y + dy))) {
                    wall.extend([left as i32 + x, 10 + y, 1]);
                }
            }
        }
    }
    let mut layers = vec![serde_json::json!({"type": "wall", "compressedPixels": wall, "metaData": {}})];
    for ((name, floor), id) in names.iter().zip(&floors).zip(["1", "2"]) {
        let meta = serde_json::json!({"segmentId": id, "name": name});
        layers.push(serde_json::json!({"type": "segment", "compressedPixels": floor, "metaData": meta}));
    }
    let map = serde_json::json!({
        "__class": "ValetudoMap",
        "metaData": {"version": 2},
        "size": {"x": 1000, "y": 400},
        "pixelSize": 5,
        "layers": layers,
        "entities": [],
    });
    LidarMap::read(map.to_string().as_bytes()).unwrap()
}

#[test]
fn a_bed_tells_a_bedroom_from_a_kitchen_with_the_same_walls() {
    // For a clip in either room, and for several names of the rooms.
    for (names, is_told) in [
        (["Bedroom", "Kitchen"], true),
        (["Küche", "Schlafzimmer"], true),
        (["Anna", "room2"], false),
        (["Bedroom 1", "Bedroom 2"], false),
    ] {
        let lidar = twin_rooms(names);
        let target = Target::new(&lidar).unwrap();
        for room in 0..2 {
            let middle = lidar.info.rooms[room].centre_m;
            let truth = Pose2::new(middle[0], middle[1], 0.7);
            let seen: Vec<Point2> =
                lidar.occupied_m.iter().filter(|p| (p.x - middle[0]).abs() < 2.0).copied().collect();
            let mut clip = observation(&seen, &truth);
            assert_eq!(register(&clip, &target).state, AlignmentState::Ambiguous, "{names:?}");
            let class = if names[room].starts_with(['K', 'k']) { Class::Stove } else { Class::Bed };
            let thing =
                Landmark { point_m: Point2::new(0.5, 0.5), from_m: Point2::origin(), class, fraction: 0.15 };
            clip.scan.landmarks = vec![thing];
            let answer = register(&clip, &target);
            let [best, rival] = &answer.alternatives[..2] else { panic!("{answer:?}") };
            if is_told {
                assert!(best.map_from_clip.distance_m(&truth) < 0.05, "{names:?} {room}: {answer:?}");
                assert_eq!((best.misplaced, rival.misplaced), (Some(0.0), Some(0.15)), "{names:?}");
            } else {
                assert!(rival.loss_m - best.loss_m < 0.005, "{names:?} {room}: {answer:?}");
                assert_eq!(best.misplaced.unwrap_or(0.0), 0.0, "{names:?}");
            }
        }
    }
}
