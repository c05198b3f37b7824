//! LiDAR map of a mesh by the paper's protocol (paper IV): virtual sensors at the vacuum's height inside the
//! mesh, rays in all directions, noise, and lost hits.

use super::{Mesh, Section};
use crate::simulate::{csv, gaussian};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustc_hash::FxHashSet;
use std::f64::consts::TAU;
use viola_align::VACUUM_HEIGHT_M;
use viola_geometry::{DistanceField, Grid, GridFrame, Point2, Point3, Pose2, Pose3, Vector2};

/// Each cell of this side keeps one hit, as robots' maps do.
const CELL_M: f64 = 0.02;

/// Distance between sensors.
const SPACING_M: f64 = 0.8;
/// Minimum distance of sensors from obstacles.
const BODY_RADIUS_M: f64 = 0.17;
const RAYS: usize = 720;
const RANGE_M: f64 = 8.0;

/// Parameters of a survey.
#[derive(Debug, Clone, PartialEq)]
pub struct SurveyParams {
    pub seed: u64,
    /// Height of the sensor above the floor.
    pub height_m: f64,
    /// Standard deviation of a hit in x and in y.
    pub noise_m: f64,
    /// Fraction of lost hits.
    pub drop_out: f64,
}

impl Default for SurveyParams {
    fn default() -> Self {
        SurveyParams { seed: 0, height_m: VACUUM_HEIGHT_M, noise_m: 0.01, drop_out: 0.1 }
    }
}

/// A virtual vacuum's map.
#[derive(Debug, Clone)]
pub struct Survey {
    /// In the map's frame. The seed moves it against the world, so no pose is the identity.
    pub points_m: Vec<Point2>,
    pub map_from_world: Pose2,
    /// Height of the floor in the world.
    pub floor_m: f64,
    /// Sensor positions in the map's frame.
    pub sensors_m: Vec<Point2>,
}

#[derive(Debug, thiserror::Error)]
pub enum SurveyError {
    #[error("no level surface lies below the cameras, so there is no floor")]
    NoFloor,
    #[error("nothing stands at {height_m} m above the floor")]
    NothingThere { height_m: f64 },
    #[error("the vacuum fits nowhere below the cameras' way")]
    NoRoom,
}

impl Survey {
    /// Surveys the mesh wherever the vacuum fits and can reach from below the cameras, where people walked.
    /// The world's z is up.
    pub fn new(
        mesh: &Mesh,
        world_from_cameras: &[Pose3],
        params: &SurveyParams,
    ) -> Result<Survey, SurveyError> {
        let floor_m = floor(mesh, world_from_cameras).ok_or(SurveyError::NoFloor)?;
        let height_m = floor_m + params.height_m;
        let section = Section::new(mesh, height_m).ok_or(SurveyError::NothingThere { height_m })?;
        let below = world_from_cameras.iter().map(|pose| Point3::from(pose.translation.vector).xy());
        let sensors = sensors(mesh, &below.collect::<Vec<_>>(), floor_m, params);
        if sensors.is_empty() {
            return Err(SurveyError::NoRoom);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(params.seed);
        let map_from_world = Pose2::new(
            rng.random_range(-20.0..20.0),
            rng.random_range(-20.0..20.0),
            rng.random_range(-std::f64::consts::PI..std::f64::consts::PI),
        );
        let mut points_m = Vec::new();
        let mut taken = FxHashSet::default();
        for sensor in &sensors {
            for ray in 0..RAYS {
                let angle = TAU * ray as f64 / RAYS as f64;
                let toward = Vector2::new(angle.cos(), angle.sin());
                // Random numbers for every ray, so that a sensor's hits do not depend on another's misses.
                let noise = Vector2::new(gaussian(&mut rng), gaussian(&mut rng)) * params.noise_m;
                let is_lost = rng.random_bool(params.drop_out);
                let Some(range_m) = section.range_m(sensor, &toward, RANGE_M) else { continue };
                let point = map_from_world.apply(&(sensor + toward * range_m + noise));
                let cell = [point.x, point.y].map(|c| (c / CELL_M).floor() as i64);
                if !is_lost && taken.insert(cell) {
                    points_m.push(point);
                }
            }
        }
        let sensors_m = sensors.iter().map(|sensor| map_from_world.apply(sensor)).collect();
        Ok(Survey { points_m, map_from_world, floor_m, sensors_m })
    }

    /// Returns the points as CSV that the map readers accept.
    pub fn points_csv(&self) -> String {
        csv(&self.points_m)
    }
}

/// Returns the height with the most level surface below all cameras.
fn floor(mesh: &Mesh, world_from_cameras: &[Pose3]) -> Option<f64> {
    const BIN_M: f64 = 0.02;
    const BELOW_CAMERAS_M: f64 = 0.3;
    let lowest = world_from_cameras.iter().map(|pose| pose.translation.z).fold(f64::INFINITY, f64::min);
    let mut area: std::collections::BTreeMap<i64, f64> = Default::default();
    for [a, b, c] in mesh.corners() {
        let twice_area = (b - a).cross(&(c - a));
        let z = (a.z + b.z + c.z) / 3.0;
        if z < lowest - BELOW_CAMERAS_M && twice_area.z.abs() > 0.9 * twice_area.norm() {
            *area.entry((z / BIN_M).floor() as i64).or_default() += twice_area.z.abs();
        }
    }
    let near = |bin: i64| (-1..=1).map(|d| area.get(&(bin + d)).copied().unwrap_or(0.0)).sum::<f64>();
    let best = area.keys().max_by(|a, b| near(**a).total_cmp(&near(**b)))?;
    Some((*best as f64 + 0.5) * BIN_M)
}

/// Returns sensor positions on free floor that the robot can reach from below the cameras, in the world.
fn sensors(mesh: &Mesh, cameras: &[Point2], floor_m: f64, params: &SurveyParams) -> Vec<Point2> {
    const STANDING_CELL_M: f64 = 0.05;
    /// Unevenness of a scanned floor; higher surface is an obstacle.
    const LEVEL_M: f64 = 0.05;
    /// Maximum radius of holes in scanned floors.
    const HOLE_M: f64 = 0.15;
    /// Maximum distance of a start from a camera, which is held beside the body and over furniture.
    const BESIDE_M: f64 = 0.7;
    let top_m = floor_m + params.height_m + LEVEL_M;
    let inf = f64::INFINITY;
    let (min, max) = cameras.iter().fold(([inf; 2], [-inf; 2]), |(min, max), p| {
        ([min[0].min(p.x), min[1].min(p.y)], [max[0].max(p.x), max[1].max(p.y)])
    });
    // The map extends this far beyond the cameras: the sensor's range.
    let frame = GridFrame::covering(min, max, RANGE_M, STANDING_CELL_M);
    let mut floor = Grid::filled(frame, false);
    let mut standing = Grid::filled(frame, false);
    for corners in mesh.corners() {
        if corners.iter().all(|c| c.z > top_m) || corners.iter().all(|c| c.z < floor_m - LEVEL_M) {
            continue;
        }
        for point in spread(&corners, 0.5 * STANDING_CELL_M) {
            if let Some((x, y)) = frame.cell(&point.xy()) {
                if (point.z - floor_m).abs() <= LEVEL_M {
                    floor.set(x, y, true);
                } else if (floor_m..=top_m).contains(&point.z) {
                    standing.set(x, y, true);
                }
            }
        }
    }
    let (to_floor, to_standing) = (DistanceField::new(&floor), DistanceField::new(&standing));
    let is_free = |x: usize, y: usize| {
        f64::from(to_floor.grid().get(x, y)) <= HOLE_M
            && f64::from(to_standing.grid().get(x, y)) >= BODY_RADIUS_M
    };
    let mut reached = Grid::filled(frame, false);
    let mut open = Vec::new();
    for y in 0..frame.height {
        for x in 0..frame.width {
            let centre = frame.centre(x, y);
            if is_free(x, y) && cameras.iter().any(|camera| (camera - centre).norm() < BESIDE_M) {
                reached.set(x, y, true);
                open.push((x, y));
            }
        }
    }
    while let Some((x, y)) = open.pop() {
        let around = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
        for (x, y) in around {
            if x < frame.width && y < frame.height && !reached.get(x, y) && is_free(x, y) {
                reached.set(x, y, true);
                open.push((x, y));
            }
        }
    }
    let mut sensors: Vec<Point2> = Vec::new();
    for y in 0..frame.height {
        for x in 0..frame.width {
            let centre = frame.centre(x, y);
            if reached.get(x, y) && sensors.iter().all(|s| (s - centre).norm() >= SPACING_M) {
                sensors.push(centre);
            }
        }
    }
    sensors
}

/// Returns points on a triangle, at most `step_m` apart; a triangle of kilometres gets fewer.
fn spread([a, b, c]: &[Point3; 3], step_m: f64) -> impl Iterator<Item = Point3> {
    let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
    let steps = ((longest / step_m).ceil() as usize).clamp(1, 2000);
    let (a, along, across) = (*a, (b - a) / steps as f64, (c - a) / steps as f64);
    (0..=steps).flat_map(move |i| (0..=steps - i).map(move |j| a + along * i as f64 + across * j as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of 4 x 3 m with a pillar of 0.4 m in the middle, and an unreachable room beyond a wall.
    fn rooms() -> Mesh {
        let mut mesh = Mesh { vertices_m: Vec::new(), triangles: Vec::new(), labels: Vec::new() };
        let mut quad = |corners: [[f64; 3]; 4]| {
            let first = mesh.vertices_m.len() as u32;
            mesh.vertices_m.extend(corners.map(Point3::from));
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        };
        let mut wall = |x0: f64, y0: f64, x1: f64, y1: f64| {
            quad([[x0, y0, 0.0], [x1, y1, 0.0], [x1, y1, 2.5], [x0, y0, 2.5]]);
        };
        for [x0, y0, x1, y1] in [[0.0, 0.0, 4.0, 3.0], [1.8, 1.3, 2.2, 1.7], [4.0, 0.0, 6.0, 3.0]] {
            wall(x0, y0, x1, y0);
            wall(x1, y0, x1, y1);
            wall(x1, y1, x0, y1);
            wall(x0, y1, x0, y0);
        }
        quad([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 3.0, 0.0], [0.0, 3.0, 0.0]]);
        // A table whose top is neither floor nor obstacle.
        quad([[0.5, 0.5, 0.7], [1.2, 0.5, 0.7], [1.2, 1.0, 0.7], [0.5, 1.0, 0.7]]);
        mesh
    }

    fn survey(params: &SurveyParams) -> Survey {
        let camera = Pose3::translation(1.0, 1.5, 1.4);
        Survey::new(&rooms(), &[camera], params).unwrap()
    }

    #[test]
    fn hits_lie_on_the_room_and_only_on_it() {
        let quiet = SurveyParams { noise_m: 0.0, drop_out: 0.0, ..SurveyParams::default() };
        let survey = survey(&quiet);
        assert!(survey.floor_m.abs() < 0.02, "{}", survey.floor_m);
        assert!((6..=25).contains(&survey.sensors_m.len()), "{:?}", survey.sensors_m);
        let world_from_map = survey.map_from_world.inverse();
        let mut on_pillar = 0;
        for point in &survey.points_m {
            let p = world_from_map.apply(point);
            let off = |x0: f64, y0: f64, x1: f64, y1: f64| {
                let outside =
                    Vector2::new((x0 - p.x).max(p.x - x1).max(0.0), (y0 - p.y).max(p.y - y1).max(0.0));
                let inside = (p.x - x0).min(x1 - p.x).min(p.y - y0).min(y1 - p.y).max(0.0);
                outside.norm().max(inside)
            };
            let pillar = off(1.8, 1.3, 2.2, 1.7);
            on_pillar += usize::from(pillar < 1e-6);
            assert!(pillar.min(off(0.0, 0.0, 4.0, 3.0)) < 1e-6, "{p:?} hangs in the air");
        }
        // 14 m of walls and 1.6 m of pillar, a point every 2 cm.
        assert!((500..=1100).contains(&survey.points_m.len()), "{}", survey.points_m.len());
        assert!(on_pillar > 50, "{on_pillar}");
    }

    #[test]
    fn the_seed_moves_the_frame_and_the_noise() {
        let [a, again, b] = [1, 1, 2].map(|seed| survey(&SurveyParams { seed, ..SurveyParams::default() }));
        assert_eq!(a.points_m, again.points_m);
        assert_ne!(a.map_from_world, b.map_from_world);
        assert!(a.map_from_world.distance_m(&Pose2::IDENTITY) > 0.1);
    }

    #[test]
    fn says_what_is_missing() {
        let low = Pose3::translation(1.0, 1.5, 0.1);
        let params = SurveyParams::default();
        assert!(matches!(Survey::new(&rooms(), &[low], &params), Err(SurveyError::NoFloor)));
        let outside = Pose3::translation(-9.0, 1.5, 1.4);
        assert!(matches!(Survey::new(&rooms(), &[outside], &params), Err(SurveyError::NoRoom)));
        let high = SurveyParams { height_m: 3.0, ..params };
        let camera = Pose3::translation(1.0, 1.5, 1.4);
        assert!(matches!(Survey::new(&rooms(), &[camera], &high), Err(SurveyError::NothingThere { .. })));
    }
}
