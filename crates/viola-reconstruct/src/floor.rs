//! Finds the floor plane, which defines the clip frame (paper III-B).

use super::cloud::{CloudPoint, Label, PointCloud};
use super::fuse::mean_camera_up;
use super::key_frame::KeyFrame;
use super::reason::Reason;
use nalgebra::{Matrix2, Matrix3, Rotation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use viola_formats::clip::Up;
use viola_geometry::{Plane, Point3, Pose3, Vector2, Vector3};

/// Number of RANSAC hypotheses.
const HYPOTHESES: usize = 400;
/// Maximum number of points that score a hypothesis; larger clouds are subsampled evenly.
const SCORED_POINTS: usize = 30_000;
/// Maximum distance of an inlier from the plane.
const INLIER_M: f64 = 0.03;
/// A point further below the plane than this counts against it: nothing is under a floor.
const BELOW_M: f64 = 0.08;
/// Maximum angle between the normal and the capture's gravity.
const GRAVITY_CONE_RAD: f64 = 10f64.to_radians();
/// Maximum angle between the normal and the mean of the cameras' upward axes, if gravity is unknown.
const CAMERA_CONE_RAD: f64 = 50f64.to_radians();
/// Allowed height of the first camera above the floor.
const CAMERA_HEIGHT_M: RangeInclusive<f64> = 0.25..=2.6;
/// Assumed heights of the first camera if no floor is in sight.
const ASSUMED_HEIGHTS_M: [f64; 3] = [1.45, 1.25, 1.65];
/// Minimum visible area of a floor, in square metres.
const MIN_AREA_M2: f64 = 0.15;
/// Maximum fraction of the cloud below the floor.
const MAX_BELOW_SHARE: f64 = 0.02;

/// Summary of the floor for the answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FloorReport {
    /// True if the floor was not seen; its height is then the assumed one that fits the map best.
    pub assumed: bool,
    /// Height of the first camera above it, in metres.
    pub camera_height_m: f64,
    /// Fused points within 2 cm of the plane.
    pub support_points: usize,
    /// Angle to the capture's gravity in degrees, if the capture knows gravity.
    pub gravity_angle_deg: Option<f64>,
}

/// The floor of a clip.
#[derive(Debug, Clone, PartialEq)]
pub struct Floor {
    pub plane_in_world: Plane,
    pub clip_from_world: Pose3,
    pub first_camera_height_m: f64,
    pub support_points: usize,
    pub gravity_angle_rad: Option<f64>,
    /// True if the floor was not seen; see [`assume`].
    pub assumed: bool,
}

/// Reason why no floor was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoFloor {
    /// Nothing was fused.
    EmptyCloud,
    /// Gravity is unknown and the cameras' upward axes contradict each other.
    UpUnknown,
    /// No level plane under the cameras has enough area and nothing below it. The fields are the best
    /// plane's area and the fraction of the cloud below it.
    NoPlane { best_area_m2: f64, below_share: f64 },
}

impl NoFloor {
    /// Returns the reason for the answer.
    pub fn reason(&self) -> Reason {
        match self {
            NoFloor::EmptyCloud => {
                Reason::new("nothing_fused", "the depth pictures hold no surface within the sensor's range")
            }
            NoFloor::UpUnknown => Reason::new(
                "up_unknown",
                "the capture has no gravity and its cameras point every way, so the floor cannot be told from a wall",
            ),
            NoFloor::NoPlane { best_area_m2, below_share } => Reason::new(
                "no_floor",
                format!(
                    "no floor in sight: the best flat surface below the camera shows {best_area_m2:.2} square metres and {:.0} % of the clip lies under it; include some floor in the recording",
                    below_share * 100.0
                ),
            ),
        }
    }
}

impl Floor {
    /// Returns the summary for the answer.
    pub fn report(&self) -> FloorReport {
        FloorReport {
            assumed: self.assumed,
            camera_height_m: self.first_camera_height_m,
            support_points: self.support_points,
            gravity_angle_deg: self.gravity_angle_rad.map(f64::to_degrees),
        }
    }
}

/// Finds the floor by seeded RANSAC among nearly level planes, in a world of any orientation.
pub fn find_floor(
    cloud: &PointCloud,
    key_frames: &[KeyFrame],
    up_in_world: Option<&Up>,
    seed: u64,
) -> Result<Floor, NoFloor> {
    let first = key_frames.first().ok_or(NoFloor::EmptyCloud)?;
    let known = up_in_world.map(|up| up.direction);
    let up = known.or_else(|| mean_camera_up(key_frames)).ok_or(NoFloor::UpUnknown)?.normalize();
    let cone = if up_in_world.is_some() { GRAVITY_CONE_RAD } else { CAMERA_CONE_RAD };
    let stride = cloud.points.len().div_ceil(SCORED_POINTS).max(1);
    let scored: Vec<Scored> = cloud.points.iter().step_by(stride).map(Scored::from).collect();
    let flat: Vec<usize> = (0..scored.len())
        .filter(|&i| scored[i].may_be_floor && scored[i].normal.dot(&up) > cone.cos())
        .collect();
    if flat.is_empty() {
        return Err(if scored.is_empty() { NoFloor::EmptyCloud } else { NO_PLANE_AT_ALL });
    }
    let cameras: Vec<Point3> =
        key_frames.iter().map(|k| Point3::from(k.world_from_camera.translation.vector)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let picks: Vec<usize> = (0..HYPOTHESES).map(|_| flat[rng.random_range(0..flat.len())]).collect();
    let scorer = Scorer { scored: &scored, cameras: &cameras, up, cone };
    // Ties go to the earlier pick, so that the answer does not depend on threads.
    let best = picks
        .par_iter()
        .enumerate()
        .filter_map(|(order, &pick)| scorer.grow(pick).map(|candidate| (order, candidate)))
        .max_by(|(i, a), (j, b)| a.score.total_cmp(&b.score).then(j.cmp(i)))
        .map(|(_, candidate)| candidate)
        .ok_or(NO_PLANE_AT_ALL)?;
    // A flat surface changes sign along about one axis, so each point stands for one voxel face.
    let area_m2 = best.inliers as f64 * stride as f64 * cloud.voxel_m * cloud.voxel_m;
    let below_share = best.below as f64 / scored.len() as f64;
    if area_m2 < MIN_AREA_M2 || below_share > MAX_BELOW_SHARE {
        return Err(NoFloor::NoPlane { best_area_m2: area_m2, below_share });
    }
    let settled = scorer.settled(best.plane);
    let plane = match up_in_world {
        Some(up) => scorer.steadied(&settled, area_m2, up),
        None => settled,
    };
    Ok(Floor {
        plane_in_world: plane,
        clip_from_world: clip_from_world(&plane, &first.world_from_camera),
        first_camera_height_m: plane.height_m(&cameras[0]),
        support_points: cloud.points.iter().filter(|p| plane.height_m(&p.position()).abs() < 0.02).count(),
        assumed: false,
        gravity_angle_rad: known.map(|up| plane.normal.dot(&up).clamp(-1.0, 1.0).acos()),
    })
}

/// Returns assumed level floors for a clip that shows none (the paper's future work): the first camera is
/// at heights at which people hold a phone, and no floor is above the lowest seen surface.
pub fn assume(cloud: &PointCloud, key_frames: &[KeyFrame], up: &Up) -> Vec<Floor> {
    let Some(first) = key_frames.first() else { return Vec::new() };
    let up = up.direction;
    let camera = Point3::from(first.world_from_camera.translation.vector);
    let stride = cloud.points.len().div_ceil(SCORED_POINTS).max(1);
    let mut depths_m: Vec<f64> =
        cloud.points.iter().step_by(stride).map(|p| up.dot(&(camera - p.position()))).collect();
    if depths_m.is_empty() {
        return Vec::new();
    }
    // The lowest half percent may be noise.
    depths_m.sort_by(f64::total_cmp);
    let lowest_m = depths_m[(depths_m.len() - 1) * 199 / 200];
    let mut heights_m: Vec<f64> =
        ASSUMED_HEIGHTS_M.iter().copied().filter(|height| *height > lowest_m).collect();
    if heights_m.is_empty() {
        heights_m.push(lowest_m);
    }
    heights_m
        .into_iter()
        .map(|height_m| {
            let plane = Plane::through(&(camera - up * height_m), up);
            Floor {
                plane_in_world: plane,
                clip_from_world: clip_from_world(&plane, &first.world_from_camera),
                first_camera_height_m: height_m,
                support_points: 0,
                gravity_angle_rad: Some(0.0),
                assumed: true,
            }
        })
        .collect()
}

const NO_PLANE_AT_ALL: NoFloor = NoFloor::NoPlane { best_area_m2: 0.0, below_share: 0.0 };

struct Candidate {
    plane: Plane,
    inliers: usize,
    below: usize,
    score: f64,
}

/// A cloud point with the data that the floor search needs.
struct Scored {
    position_m: Point3,
    normal: Vector3,
    /// False if the pictures label it as another level surface: the top of a bed, a table.
    may_be_floor: bool,
}

impl From<&CloudPoint> for Scored {
    fn from(point: &CloudPoint) -> Scored {
        const SURE: f32 = 0.5;
        let Label { class, .. } = point.label;
        let else_for_sure = class.has_level_top() && point.label.probability() > SURE;
        Scored { position_m: point.position(), normal: point.normal(), may_be_floor: !else_for_sure }
    }
}

struct Scorer<'a> {
    scored: &'a [Scored],
    cameras: &'a [Point3],
    up: Vector3,
    cone: f64,
}

impl Scorer<'_> {
    /// Grows a plane from one point and its normal by fits with a growing radius and a stricter distance.
    fn grow(&self, pick: usize) -> Option<Candidate> {
        let Scored { position_m: point, normal, .. } = self.scored[pick];
        let mut plane = Plane::through(&point, normal);
        for (distance_m, radius_m, angle) in [(0.05, 0.6, 0.35), (0.04, 2.0, 0.25), (INLIER_M, 1e3, 0.25)] {
            let near = self.scored.iter().filter(|s| {
                s.may_be_floor
                    && plane.height_m(&s.position_m).abs() < distance_m
                    && s.normal.dot(&plane.normal) > f64::cos(angle)
                    && (s.position_m - point).norm_squared() < radius_m * radius_m
            });
            let fitted = Plane::fit(near.map(|s| &s.position_m))?;
            plane = if fitted.normal.dot(&normal) < 0.0 { fitted.flipped() } else { fitted };
        }
        self.candidate(plane)
    }

    fn candidate(&self, plane: Plane) -> Option<Candidate> {
        let heights = self.cameras.iter().map(|c| plane.height_m(c));
        let under_all = heights.clone().all(|h| h > 0.0);
        let first = plane.height_m(&self.cameras[0]);
        if plane.normal.dot(&self.up) < self.cone.cos() || !under_all || !CAMERA_HEIGHT_M.contains(&first) {
            return None;
        }
        let (mut inliers, mut below) = (0, 0);
        for Scored { position_m, normal, may_be_floor } in self.scored {
            let height_m = plane.height_m(position_m);
            if height_m < -BELOW_M {
                below += 1;
            } else if height_m.abs() < INLIER_M && *may_be_floor && normal.dot(&plane.normal) > 0.9 {
                inliers += 1;
            }
        }
        // A table top has the floor below it; each point below outweighs several inliers.
        let score = inliers as f64 - 5.0 * below as f64;
        Some(Candidate { plane, inliers, below, score })
    }
}

impl Scorer<'_> {
    /// Returns the floor points within a distance of a plane.
    fn on<'a>(&'a self, plane: &'a Plane, within_m: f64) -> impl Iterator<Item = &'a Point3> + Clone {
        let is_on = move |s: &&Scored| {
            s.may_be_floor
                && plane.height_m(&s.position_m).abs() < within_m
                && s.normal.dot(&plane.normal) > 0.9
        };
        self.scored.iter().filter(is_on).map(|s| &s.position_m)
    }

    /// Refits the plane to its inliers until it converges. The inlier distance starts wider, because a bent
    /// floor leaves the narrow band of the first plane.
    fn settled(&self, plane: Plane) -> Plane {
        const ROUNDS: i32 = 20;
        const WIDER: f64 = 1.7;
        const NARROWER: f64 = 0.8;
        let mut plane = plane;
        for round in 0..ROUNDS {
            let within_m = INLIER_M * (WIDER * NARROWER.powi(round)).max(1.0);
            let Some(fitted) = Plane::fit(self.on(&plane, within_m)) else { return plane };
            let fitted = if fitted.normal.dot(&plane.normal) < 0.0 { fitted.flipped() } else { fitted };
            let moved = (fitted.normal - plane.normal).norm() + (fitted.offset_m - plane.offset_m).abs();
            plane = fitted;
            if moved < 1e-9 && within_m == INLIER_M {
                break;
            }
        }
        plane
    }

    /// Combines the fitted tilt and gravity by inverse covariance. The tilt's covariance comes from the
    /// unevenness and extent of the seen floor, and from the drift of recordings.
    fn steadied(&self, plane: &Plane, area_m2: f64, known_up: &Up) -> Plane {
        /// Area over which the errors of a floor are correlated.
        const ALIKE_M2: f64 = 0.3;
        /// Lower bound of the measured unevenness.
        const LEAST_UNEVEN_M: f64 = 0.002;
        /// Standard deviation of a recording's own tilt: poses drift, and parts of the real apartment's
        /// floors tilt by 1.9 degrees.
        const DRIFT_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
        let up = &known_up.direction;
        let seen: Vec<&Point3> = self.on(plane, INLIER_M).collect();
        if seen.is_empty() {
            return *plane;
        }
        let east = up.cross(&plane.normal).try_normalize(1e-9);
        // A level plane stays as it is.
        let Some(east) = east else { return *plane };
        let north = up.cross(&east);
        let middle = seen.iter().map(|p| p.coords).sum::<Vector3>() / seen.len() as f64;
        let flat = |p: &Point3| Vector2::new((p.coords - middle).dot(&east), (p.coords - middle).dot(&north));
        let squares_m2: f64 = seen.iter().map(|p| plane.height_m(p).powi(2)).sum();
        let uneven_m2 = (squares_m2 / seen.len() as f64).max(LEAST_UNEVEN_M * LEAST_UNEVEN_M);
        let spread: Matrix2<f64> = seen.iter().map(|p| flat(p) * flat(p).transpose()).sum();
        // Inverse covariance of the fitted tilt.
        let by_points = spread * (area_m2 / ALIKE_M2 / seen.len() as f64 / uneven_m2);
        let with_drift = Matrix2::identity() + by_points * DRIFT_RAD.powi(2);
        let Some(known) = with_drift.try_inverse().map(|inverse| by_points * inverse) else { return *plane };
        let level = Matrix2::identity() / known_up.deviation_rad.powi(2);
        let lean = Vector2::new(plane.normal.dot(&east), plane.normal.dot(&north)) / plane.normal.dot(up);
        let Some(share) = (known + level).try_inverse() else { return *plane };
        let lean = share * known * lean;
        Plane::through(&Point3::from(middle), up + east * lean.x + north * lean.y)
    }
}

/// Returns the clip frame: z up, origin on the floor below the first camera, x along its heading.
fn clip_from_world(plane: &Plane, world_from_first: &Pose3) -> Pose3 {
    let z = plane.normal;
    let camera = Point3::from(world_from_first.translation.vector);
    let origin = camera - z * plane.height_m(&camera);
    let x = heading(world_from_first, &z);
    let y = z.cross(&x);
    let clip_from_world = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(clip_from_world));
    Pose3::from_parts((rotation * -origin.coords).into(), rotation)
}

/// Returns a camera's heading along the floor: its viewing direction projected to the floor, or the
/// picture's upward axis if the camera looks straight down (its downward axis if straight up).
pub fn heading(world_from_camera: &Pose3, up: &Vector3) -> Vector3 {
    let flat = |v: Vector3| v - up * up.dot(&v);
    let forward = world_from_camera.rotation * Vector3::z();
    let along = flat(forward);
    // Within about three degrees of the vertical, the viewing direction gives no heading.
    let along = if along.norm() > 0.05 {
        along
    } else {
        flat(world_from_camera.rotation * (Vector3::y() * forward.dot(up).signum()))
    };
    along.normalize()
}

#[cfg(test)]
mod tests;
