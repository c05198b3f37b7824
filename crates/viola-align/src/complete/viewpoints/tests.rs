use super::*;
use crate::scan::{Hit, VirtualScan};
use viola_geometry::Pose3;
use viola_reconstruct::{CloudPoint, KeyFrame};

const CAMERA: Pinhole = Pinhole { width: 512, height: 384, fx: 440.0, fy: 440.0, cx: 255.5, cy: 191.5 };
const HEIGHT_M: f64 = 0.12;

/// Returns a room of 4 m x 3 m whose far wall (y = 3) was seen down to the vacuum's height only left of
/// x = 2. The cameras stand at y = 1 and look at the wall, each a little further to the right.
fn room() -> Observation {
    let mut points = Vec::new();
    let mut add = |x: f64, y: f64, z: f64, normal: [f32; 3]| {
        points.push(CloudPoint::new([x as f32, y as f32, z as f32], normal));
    };
    for i in 0..80 {
        let x = f64::from(i) * 0.05;
        for j in 0..48 {
            let z = f64::from(j) * 0.05;
            if x < 2.0 || z > 1.0 {
                add(x, 3.0, z, [0.0, -1.0, 0.0]);
            }
        }
        for j in 0..60 {
            add(x, f64::from(j) * 0.05, 0.0, [0.0, 0.0, 1.0]);
        }
    }
    let hit = |x: f64| Hit::standing(Point2::new(x, 3.0), Vector2::new(0.0, -1.0));
    let hits = (0..40).map(|i| hit(f64::from(i) * 0.05)).collect();
    let key = |x: f64, pitch_rad: f64| {
        let yaw_rad = std::f64::consts::FRAC_PI_2;
        KeyFrame::blind(View { eye_m: [x, 1.0, 1.4], yaw_rad, pitch_rad }.clip_from_camera())
    };
    Observation {
        cloud_in_clip: PointCloud { points, voxel_m: 0.05 },
        scan: VirtualScan { hits, ..VirtualScan::default() },
        keys: vec![key(1.0, 0.2), key(1.5, 0.5), key(1.8, 0.4)],
        clip_from_world: Some(Pose3::identity()),
        ..Observation::default()
    }
}

fn params(strategy: ViewStrategy) -> ViewParams {
    ViewParams { strategy, vacuum_height_m: HEIGHT_M, max_views: 8 }
}

#[test]
fn the_boundary_lies_where_hits_end_and_the_frontier_goes_on() {
    let (_, sets) = views(&room(), &CAMERA, &params(ViewStrategy::Frontier));
    // Hits end at x = 1.95; 30 cm further the wall counts as missing.
    let boundary = sets.boundary_m.unwrap();
    assert!((boundary.x - 1.95).abs() < 0.06 && (boundary.y - 3.0).abs() < 1e-6, "{boundary}");
    assert!(sets.missing_m.iter().all(|p| p.x > 2.2), "only what was not seen is missing");
    assert!(!sets.frontier_m.is_empty());
    let (from, to) = sets.frontier_m.iter().fold((f64::INFINITY, 0f64), |(a, b), p| (a.min(p.x), b.max(p.x)));
    assert!(from > 2.2 && to > 3.5 && to < 4.1, "to the right, two metres at most: {from} {to}");
    assert!(sets.frontier_m.iter().all(|p| p.y > 2.5), "along the wall");
}

#[test]
fn views_begin_at_the_steepest_camera_and_go_back_and_around() {
    let room = room();
    let (views, sets) = views(&room, &CAMERA, &params(ViewStrategy::Frontier));
    assert!((views[0].pitch_rad - 0.5).abs() < 1e-9 && (views[0].eye_m[0] - 1.5).abs() < 1e-9, "{views:?}");
    for pair in views.windows(2) {
        let step_m = (pair[1].eye() - pair[0].eye()).norm();
        let turn_rad = pair[1].yaw_rad - pair[0].yaw_rad;
        let back = (step_m - STEP_BACK_M).abs() < 1e-9 && turn_rad == 0.0;
        // To the right, where the frontier is.
        let turned = step_m < 1e-9 && (turn_rad + TURN_RAD).abs() < 1e-9;
        assert!(back || turned, "{pair:?}");
    }
    let seen = |view: &View| {
        let at = |p: &&Point2| view.sees(&Point3::new(p.x, p.y, HEIGHT_M), &CAMERA);
        sets.frontier_m.iter().filter(at).count()
    };
    assert!(seen(views.last().unwrap()) > seen(&views[0]));
    assert!(views.iter().all(|view| view.eye_m[1] > 0.1), "no camera leaves the room");
}

#[test]
fn the_rivals_move_the_clip_s_own_cameras() {
    let room = room();
    let (back, _) = views(&room, &CAMERA, &params(ViewStrategy::StepBack));
    assert_eq!(back.len(), 3);
    assert!((back[0].eye_m[1] - (1.0 - 0.5 * 0.2f64.cos())).abs() < 1e-9);
    let (low, _) = views(&room, &CAMERA, &params(ViewStrategy::VacuumHeight));
    assert!(low.iter().all(|view| view.eye_m[2] == HEIGHT_M && view.pitch_rad == 0.0));
    let few = ViewParams { max_views: 2, ..params(ViewStrategy::StepBack) };
    assert_eq!(views(&room, &CAMERA, &few).0.len(), 2);
}

#[test]
fn nothing_seen_gives_no_view() {
    let (views, sets) = views(&Observation::default(), &CAMERA, &params(ViewStrategy::Frontier));
    assert!(views.is_empty() && sets.frontier_m.is_empty());
}
