//! The readers read the files of the simulation.

use std::collections::BTreeSet;
use std::io::Write;
use viola_formats::clip::Clip;
use viola_formats::lidar::{Cell, LidarMap};
use viola_geometry::{Point2, angle_between};
use viola_lab::simulate::{
    ClipParams, Home, HomeParams, Sensor, Set, Survey, points_csv, ros_pgm, ros_yaml, write_scannet_zip,
};

fn survey(seed: u64) -> Survey {
    Home::generate(&HomeParams::new(Set::Normal, seed)).survey()
}

fn sorted(points: &[Point2]) -> BTreeSet<(i64, i64)> {
    points.iter().map(|p| ((p.x * 1e4).round() as i64, (p.y * 1e4).round() as i64)).collect()
}

#[test]
fn valetudo_is_read_back_as_the_survey() {
    for seed in [1, 6, 14] {
        let survey = survey(seed);
        let map = survey.lidar_map().unwrap();
        assert_eq!(map.info.format, "valetudo");
        let frame = &survey.cells.frame;
        let valetudo_from_robot = survey.valetudo_from_home().compose(&survey.robot_from_home.inverse());
        let centre =
            |index: usize| valetudo_from_robot.apply(&frame.centre(index % frame.width, index / frame.width));
        let centres = |is_wanted: &dyn Fn(usize) -> bool| -> Vec<Point2> {
            (0..frame.len()).filter(|index| is_wanted(*index)).map(centre).collect()
        };
        let occupied_m = centres(&|index| survey.cells.cells[index] == Cell::Occupied);
        assert_eq!(sorted(&map.occupied_m), sorted(&occupied_m));
        let cells = map.cells.unwrap();
        for (index, expected) in survey.cells.cells.iter().enumerate() {
            assert_eq!(cells.at(&centre(index)).unwrap_or(Cell::Unknown), *expected, "cell {index}");
        }
        let known = survey.cells.cells.iter().filter(|cell| **cell != Cell::Unknown).count();
        assert_eq!(map.info.occupied_points + map.info.free_cells, known);
        // The file has whole centimetres and degrees.
        let charger = map.charger.unwrap();
        let expected = valetudo_from_robot.compose(&survey.charger);
        assert!((charger.x_m - expected.x_m).abs().max((charger.y_m - expected.y_m).abs()) < 0.005 + 1e-6);
        assert!(angle_between(charger.yaw_rad, expected.yaw_rad).to_degrees() < 0.5 + 1e-6);
        assert_eq!(map.rooms.len(), survey.segment_names.len());
        for (room, (number, name)) in map.rooms.iter().zip((1u16..).zip(&survey.segment_names)) {
            assert_eq!((&room.id, room.name.as_ref()), (&number.to_string(), Some(name)));
            let cells_m = centres(&|index| survey.segments[index] == number);
            assert_eq!(sorted(&room.cells_m), sorted(&cells_m));
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
