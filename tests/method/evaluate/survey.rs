//! The LiDAR map cut from a real mesh, against one that was cut independently by the same protocol.

use viola_geometry::Point2;
use viola_lab::evaluate::{Scene, SurveyParams};
use viola_lab::paper::Nearest;

#[test]
fn agrees_with_the_map_of_the_apartment() {
    let Some(folder) = viola_testing::data::folder("scannet/scene0000_00") else { return };
    let lidar = folder.join("lidar");
    let given = Scene::open(&folder, &lidar.join("points.csv"), &lidar.join("ground_truth.json")).unwrap();
    let params = SurveyParams { height_m: 0.15, ..SurveyParams::default() };
    let (cut, survey) = Scene::open_with_mesh(&folder, &params).unwrap();
    assert!((-0.05..0.1).contains(&survey.floor_m), "{}", survey.floor_m);
    let in_world = |scene: &Scene| -> Vec<Point2> {
        scene.lidar.occupied_m.iter().map(|p| scene.map_from_world.inverse().apply(p)).collect()
    };
    let (given, cut) = (in_world(&given), in_world(&cut));
    let share = |of: &[Point2], near: &[Point2]| {
        let nearest = Nearest::new(near);
        of.iter().filter(|p| nearest.distance_m(p) < 0.08).count() as f64 / of.len() as f64
    };
    // Sensors stand elsewhere, so each sees corners that the other does not.
    let (found, invented) = (share(&given, &cut), 1.0 - share(&cut, &given));
    eprintln!("{} points, {found:.3} of the given ones found, {invented:.3} new", cut.len());
    assert!(found > 0.9 && invented < 0.2, "{found} {invented}");
}
