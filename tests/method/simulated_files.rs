//! The readers read the files of the simulation.

use std::collections::BTreeSet;
use std::io::Write;
use viola_formats::clip::Clip;
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::{Point2, angle_between};
use viola_lab::simulate::{
    ClipParams, Home, HomeParams, Sensor, Set, Survey, points_csv, ros_pgm, ros_yaml, valetudo_json,
    write_scannet_zip,
};

fn survey(seed: u64) -> Survey {
    Home::generate(&HomeParams::new(Set::Normal, seed)).survey()
}

fn sorted(points: &[Point2]) -> BTreeSet<(i64, i64)> {
    points.iter().map(|p| ((p.x * 1e4).round() as i64, (p.y * 1e4).round() as i64)).collect()
}

#[test]
fn valetudo_is_read_back_as_the_map_in_memory() {
    for seed in [1, 6, 14] {
        let survey = survey(seed);
        let map = survey.lidar_map();
        let read = LidarMap::read(valetudo_json(&survey).to_string().as_bytes()).unwrap();
        assert_eq!(read.info.format, map.info.format);
        assert_eq!(sorted(&read.occupied_m), sorted(&map.occupied_m));
        let (cells, expected) = (read.cells.unwrap(), map.cells.unwrap());
        for y in 0..expected.frame.height {
            for x in 0..expected.frame.width {
                let there = cells.at(&expected.frame.centre(x, y)).unwrap_or(Cell::Unknown);
                assert_eq!(there, expected.get(x, y), "cell {x} {y}");
            }
        }
        let charger = read.charger.unwrap();
        let expected = map.charger.unwrap();
        assert!(
            charger.distance_m(&expected) < 1e-6 && angle_between(charger.yaw_rad, expected.yaw_rad) < 1e-6
        );
        assert_eq!(read.rooms.len(), map.rooms.len());
        for (room, expected) in read.rooms.iter().zip(&map.rooms) {
            assert_eq!((&room.id, &room.name), (&expected.id, &expected.name));
            assert_eq!(sorted(&room.cells_m), sorted(&expected.cells_m));
        }
    }
}

#[test]
fn ros_and_points_are_read_back_in_the_robots_frame() {
    let survey = survey(3);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("map.pgm"), ros_pgm(&survey)).unwrap();
    std::fs::write(folder.path().join("map.yaml"), ros_yaml(&survey, "map.pgm")).unwrap();
    let ros = LidarMap::open(&folder.path().join("map.yaml")).unwrap();
    let frame = &survey.cells.frame;
    let cells = (0..frame.len()).filter(|&index| survey.cells.cells[index] == Cell::Occupied);
    let centres: Vec<Point2> =
        cells.map(|index| frame.centre(index % frame.width, index / frame.width)).collect();
    assert_eq!(sorted(&ros.occupied_m), sorted(&centres));
    let free = survey.cells.cells.iter().filter(|cell| **cell == Cell::Free).count();
    assert_eq!(ros.info.free_cells, free);
    let points = LidarMap::read(points_csv(&survey).as_bytes()).unwrap();
    assert_eq!(sorted(&points.occupied_m), sorted(&survey.points_m));
}

#[test]
fn a_clip_is_read_back_as_the_frames_in_memory() {
    let home = Home::generate(&HomeParams::new(Set::Normal, 2));
    let survey = home.survey();
    for sensor in [Sensor::PhoneLidar, Sensor::StructuredLight] {
        let clip = home.clip(&survey, 0, &ClipParams { frames: 6, sensor, ..ClipParams::default() });
        let mut file = tempfile::NamedTempFile::new().unwrap();
        write_scannet_zip(&clip, &mut file).unwrap();
        file.flush().unwrap();
        let read = Clip::open(file.path()).unwrap();
        assert_eq!(read.frames().len(), 6);
        for index in 0..6 {
            let (frame, expected) = (read.load(index).unwrap(), clip.frame(index));
            let pose = |frame: &viola_formats::clip::Frame| frame.header.world_from_camera.unwrap();
            let error = pose(&expected).inverse() * pose(&frame);
            assert!(error.translation.vector.norm() < 1e-5 && error.rotation.angle() < 1e-5);
            for (camera, same) in
                [(frame.color_camera, expected.color_camera), (frame.depth_camera, expected.depth_camera)]
            {
                assert_eq!((camera.width, camera.height), (same.width, same.height));
                let off =
                    [camera.fx - same.fx, camera.fy - same.fy, camera.cx - same.cx, camera.cy - same.cy];
                assert!(off.iter().all(|v| v.abs() < 1e-5), "{off:?}");
            }
            let depths = frame.depth.depth_m.iter().zip(&expected.depth.depth_m);
            assert!(depths.into_iter().all(|(a, b)| (a - b).abs() < 1e-5), "depth of frame {index}");
            let (color, expected) = (frame.color.unwrap(), expected.color.unwrap());
            let colours = color.iter().zip(expected.iter());
            let sum: u64 = colours.map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
            let mean = sum as f64 / expected.len() as f64;
            // JPEG changes a little.
            assert!(mean < 6.0, "colours of frame {index} are off by {mean} on average");
        }
    }
}
