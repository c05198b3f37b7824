//! Look-alike poses of a clip in a home with repeated rooms.

use super::home::Home;
use super::scene::Primitive;
use viola_geometry::{Pinhole, Point3, Pose2, Pose3, Vector3};

const RAYS: usize = 41;
/// Frames of the clip to compare.
const FRAMES: usize = 24;
/// Tolerance of equal hits: the map's cells are 5 cm.
const SAME_M: f64 = 0.05;
/// Fraction of rays that may differ.
const DIFFERENT: f64 = 0.01;
/// Height of the comparison of the building above furniture.
const STRUCTURE_M: f64 = 1.6;

/// Returns motions of the home that take the clip to places where the vacuum's map looks the same within the
/// clip's view; the identity first.
///
/// Compares horizontal rays within the frames' views: at the vacuum's height, and to the building alone above
/// the furniture. Candidates are the motions between copies of the repeated unit.
pub(super) fn look_alikes(
    home: &Home,
    vacuum_height_m: f64,
    home_from_camera: &[Pose3],
    camera: &Pinhole,
    range_m: f64,
) -> Vec<Pose2> {
    let mut motions = vec![Pose2::IDENTITY];
    for from in &home.plan.units {
        for to in home.plan.units.iter().filter(|to| to.mirrored == from.mirrored) {
            let motion = to.home_from_unit.compose(&from.home_from_unit.inverse());
            let known = |m: &Pose2| m.is_within(&motion, 0.01, 0.01);
            if !motions.iter().any(known) {
                motions.push(motion);
            }
        }
    }
    let step = home_from_camera.len().div_ceil(FRAMES).max(1);
    let rays: Vec<Pose2> =
        home_from_camera.iter().step_by(step).flat_map(|pose| level_rays(pose, camera)).collect();
    let profile = |motion: &Pose2| -> Vec<f64> {
        let ranges = rays.iter().flat_map(|ray| {
            let moved = motion.compose(ray);
            [vacuum_height_m, STRUCTURE_M].map(|height| level_range(home, &moved, height, range_m))
        });
        ranges.collect()
    };
    let truth = profile(&motions[0]);
    let same = |motion: &Pose2| {
        let other = profile(motion);
        let differ = truth.iter().zip(&other).filter(|(a, b)| (**a - **b).abs() > SAME_M).count();
        differ as f64 <= DIFFERENT * truth.len() as f64
    };
    motions.retain(same);
    motions
}

/// Returns horizontal rays in a frame's view: origins, with x along the ray.
fn level_rays(home_from_camera: &Pose3, camera: &Pinhole) -> Vec<Pose2> {
    let at = home_from_camera.translation.vector;
    let columns = (0..RAYS).map(|k| k as f64 / (RAYS - 1) as f64 * f64::from(camera.width - 1));
    columns
        .filter_map(|u| {
            let ray = home_from_camera.rotation * camera.ray(u, camera.cy);
            // Skip columns that look straight down: they have no heading.
            (ray.xy().norm() > 0.2 * ray.norm()).then(|| Pose2::new(at.x, at.y, ray.y.atan2(ray.x)))
        })
        .collect()
}

fn level_range(home: &Home, from: &Pose2, height_m: f64, range_m: f64) -> f64 {
    let (s, c) = from.yaw_rad.sin_cos();
    let origin = Point3::new(from.x_m, from.y_m, height_m);
    let high = height_m >= STRUCTURE_M;
    // The vacuum's LiDAR rarely sees glass.
    let counts = |primitive: &Primitive| primitive.is_solid() && (!high || primitive.class.is_structure());
    let hit = home.vacuum_day.scene.cast_where(&origin, &Vector3::new(c, s, 0.0), range_m, counts);
    hit.map_or(range_m, |hit| hit.distance)
}
