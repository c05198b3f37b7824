//! CARMEN logs: a map made by scan matching, against the home in which the log was made.

use crate::robot_files::carmen;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;
use viola_formats::lidar::LidarMap;
use viola_geometry::{Point2, Point3, Pose2, Vector3};
use viola_lab::simulate::{Home, HomeParams, Set};

#[test]
fn a_short_log_is_a_map() {
    for (name, is_old) in [("FLASER", true), ("ROBOTLASER1", false)] {
        let map = LidarMap::read(&carmen(name)).unwrap();
        assert_eq!(map.info.format, "carmen_log", "{name}");
        assert_eq!(map.info.notes.iter().any(|note| note.contains("half a circle")), is_old, "{name}");
        // The walls of the room that are ahead of the robot: y = -1, x = 4, y = 2 up to x = 3.
        for point in [[2.5, -1.0], [4.0, 0.5], [2.0, 2.0], [3.0, 1.5], [3.5, 1.0]] {
            let at = Point2::from(point);
            let nearest = map.occupied_m.iter().map(|p| (p - at).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.08, "{name}: {nearest} m from {point:?} to a wall");
        }
        let grid = map.cells.as_ref().unwrap();
        assert_eq!(grid.at(&Point2::new(2.5, 0.3)), Some(viola_formats::lidar::Cell::Free), "{name}");
    }
}

#[test]
fn other_messages_may_come_first() {
    for name in ["FLASER", "ROBOTLASER1"] {
        let log = carmen(name);
        let plain = LidarMap::read(&log).unwrap();
        let laser =
            String::from_utf8(log.clone()).unwrap().replace("PARAM", "SETTING").replace("ODOM", "WHEELS");
        for (what, log) in [
            ("another sensor", [b"NMEAGGA 1 52.1 8.0 0.0 host 0.0\n".as_slice(), log.as_slice()].concat()),
            (
                "empty lines and a synchronisation",
                [b"\r\n\n# drawn\nSYNC\r\n".as_slice(), log.as_slice()].concat(),
            ),
            ("no known message but the laser's", laser.into_bytes()),
            ("indented lines", log.split(|byte| *byte == b'\n').collect::<Vec<_>>().join(&b"\n  "[..])),
        ] {
            let map = LidarMap::read(&log).unwrap_or_else(|error| panic!("{name}, {what}: {error}"));
            assert_eq!(
                (map.info, map.occupied_m),
                (plain.info.clone(), plain.occupied_m.clone()),
                "{name}, {what}"
            );
        }
    }
    let other = LidarMap::read(b"NMEAGGA 1 52.1 8.0 0.0 host 0.0\nIMU 1 2 3\n").unwrap_err();
    assert_eq!(other.code(), "unknown_format");
}

/// The robot of a home drives through it with wheels that slip; its laser has 1 cm of noise.
struct Drive {
    log: String,
    /// Error of the odometry at the end, in metres.
    drift_m: f64,
}

/// Returns a path to all scan poses of the vacuum, from one to the next in sight: to a new one if there is
/// any, else back. It has a pose each 30 cm and each 30 degrees.
fn way(home: &Home, scans: &[Pose2], height_m: f64) -> Vec<Pose2> {
    let scene = home.vacuum_scene();
    let is_open = |a: &Pose2, b: &Pose2| {
        let way = b.translation() - a.translation();
        let (length, from) = (way.norm(), Point3::new(a.x_m, a.y_m, height_m));
        length < 0.75
            && scene.cast(&from, &(Vector3::new(way.x, way.y, 0.0) / length), length + 0.1).is_none()
    };
    let mut is_new = vec![true; scans.len()];
    is_new[0] = false;
    let (mut stack, mut stops) = (vec![0], vec![0]);
    while let Some(&at) = stack.last() {
        let near = (0..scans.len()).filter(|&next| is_new[next] && is_open(&scans[at], &scans[next]));
        let next =
            near.min_by(|&a, &b| scans[a].distance_m(&scans[at]).total_cmp(&scans[b].distance_m(&scans[at])));
        match next {
            Some(next) => {
                is_new[next] = false;
                stack.push(next);
                stops.push(next);
            }
            None => {
                stack.pop();
                stops.extend(stack.last());
            }
        }
    }
    let mut poses = vec![Pose2::new(scans[0].x_m, scans[0].y_m, 0.0)];
    for stop in stops {
        let from = poses[poses.len() - 1];
        let way = scans[stop].translation() - from.translation();
        if way.norm() < 1e-9 {
            continue;
        }
        let yaw_rad = way.y.atan2(way.x);
        let turn = viola_geometry::wrap_angle(yaw_rad - from.yaw_rad);
        let turns = (turn.abs() / 0.53).ceil().max(1.0);
        for step in 1..=turns as usize {
            let yaw_rad = yaw_rad - turn * (1.0 - step as f64 / turns);
            poses.push(Pose2::new(from.x_m, from.y_m, yaw_rad));
        }
        let steps = (way.norm() / 0.3).ceil();
        for step in 1..=steps as usize {
            let at = from.translation() + way * (step as f64 / steps);
            poses.push(Pose2::new(at.x, at.y, yaw_rad));
        }
    }
    poses
}

fn drive(home: &Home, seed: u64) -> Drive {
    let survey = home.survey();
    let scene = home.vacuum_scene();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sigma: f64| {
        // The sum of twelve numbers from 0 to 1 has a variance of one.
        let sum: f64 = (0..12).map(|_| random.random::<f64>()).sum();
        sigma * (sum - 6.0)
    };
    let way = way(home, &survey.scans, survey.vacuum_height_m);
    let (mut odometry, mut last) = (way[0], way[0]);
    let mut log = String::from("# CARMEN Logfile\n");
    for (index, pose) in way.iter().enumerate() {
        let step = last.inverse().compose(pose);
        if index > 0 {
            // 2 % too far, a turn that is 1 % too wide, and noise with both.
            let slipped = Pose2::new(
                step.x_m * (1.02 + noise(0.02)),
                step.y_m + noise(0.002),
                step.yaw_rad * (1.01 + noise(0.01)) + noise(0.1f64.to_radians()),
            );
            odometry = odometry.compose(&slipped);
        }
        last = *pose;
        let at = Point3::new(pose.x_m, pose.y_m, survey.vacuum_height_m);
        let ranges: Vec<String> = (0..361)
            .map(|index| {
                let angle = pose.yaw_rad + (f64::from(index) * 0.5 - 90.0).to_radians();
                let hit = scene.cast(&at, &Vector3::new(angle.cos(), angle.sin(), 0.0), 12.0);
                format!("{:.3}", hit.map_or(80.0, |hit| (hit.distance + noise(0.01)).max(0.0)))
            })
            .collect();
        let pose = format!("{:.4} {:.4} {:.5}", odometry.x_m, odometry.y_m, odometry.yaw_rad);
        let ranges = ranges.join(" ");
        writeln!(log, "FLASER 361 {ranges} {pose} {pose} 0.0 simulated 0.0").unwrap();
    }
    Drive { log, drift_m: odometry.distance_m(&last) }
}

#[test]
fn a_log_of_a_home_becomes_its_map() {
    let seed = 4;
    let home = Home::generate(&HomeParams::new(Set::Normal, seed));
    let drive = drive(&home, seed);
    let map = LidarMap::read(drive.log.as_bytes()).unwrap();
    let survey = home.survey();
    let home_from_robot = survey.robot_from_home.inverse();
    // Points of the vacuum's own map, which was made with poses exact to a centimetre.
    let truth: Vec<Point2> = survey.points_m.iter().map(|p| home_from_robot.apply(p)).collect();
    let shares = |from: &[Point2], to: &[Point2], within_m: f64| {
        let near = |p: &&Point2| to.iter().any(|q| (*p - q).norm() < within_m);
        from.iter().filter(near).count() as f64 / from.len() as f64
    };
    // The log's frame is that of its first pose, which has no drift.
    let exact = shares(&map.occupied_m, &truth, 0.15);
    let complete = shares(&truth, &map.occupied_m, 0.15);
    println!(
        "home {seed}: drift {:.2} m; {exact:.3} of the map's walls are walls, {complete:.3} of the walls are there; {:?}",
        drive.drift_m, map.info.notes
    );
    assert!(drive.drift_m > 0.5, "the odometry of home {seed} drifts by {} m", drive.drift_m);
    assert!(exact > 0.95 && complete > 0.85, "home {seed}: {exact} {complete}");
}
