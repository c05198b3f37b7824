//! Finds the floor plane, which defines the clip frame (paper III-B).

mod scorer;

use super::cloud::{CloudPoint, PointCloud};
use super::fuse::mean_camera_up;
use super::key_frame::KeyFrame;
use super::reason::Reason;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use scorer::{Candidate, Scored, Scorer};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use viola_formats::clip::Up;
use viola_geometry::{Plane, Point3, Pose3, Vector3};

/// Number of RANSAC hypotheses.
const HYPOTHESES: usize = 400;
/// Maximum number of points that score a hypothesis; larger clouds are subsampled evenly.
const SCORED_POINTS: usize = 30_000;
/// Maximum angle between the normal and the capture's gravity.
const GRAVITY_CONE_RAD: f64 = 10f64.to_radians();
/// Maximum angle between the normal and the mean of the cameras' upward axes, if gravity is unknown.
const CAMERA_CONE_RAD: f64 = 50f64.to_radians();
/// Allowed height of the first camera above the floor.
const CAMERA_HEIGHT_M: RangeInclusive<f64> = 0.25..=2.6;
/// Heights of most phones above the floor, as in `viola-align`'s search for the scale.
const USUAL_HEIGHT_M: RangeInclusive<f64> = 1.0..=1.8;
/// Floors within this height are one.
pub const SAME_FLOOR_M: f64 = 0.08;
/// Minimum area of another possible floor, and its minimum ratio to that of the best one.
const RIVAL_AREA_M2: f64 = 0.5;
const RIVAL_RATIO: usize = 3;
/// Assumed heights of the first camera if no floor is in sight.
const ASSUMED_HEIGHTS_M: [f64; 3] = [1.45, 1.25, 1.65];
/// Minimum visible area of a floor, in square metres.
const MIN_AREA_M2: f64 = 0.15;
/// Maximum fraction of the cloud below the floor.
const MAX_BELOW_FRACTION: f64 = 0.02;

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
    /// True if the floor was not seen; see [`floors`].
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
    /// plane's area and the fraction of the cloud below it, and whether gravity is known.
    NoPlane { best_area_m2: f64, below_fraction: f64, is_up_known: bool },
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
            NoFloor::NoPlane { best_area_m2, below_fraction, is_up_known } => {
                let upright = if *is_up_known {
                    ""
                } else {
                    ", and set its pictures upright: it has no gravity, so their upper side counts as up"
                };
                Reason::new(
                    "no_floor",
                    format!(
                        "no floor in sight: the best flat surface below the camera shows {best_area_m2:.2} square metres and {:.0} % of the clip lies under it; include some floor in the recording{upright}",
                        below_fraction * 100.0
                    ),
                )
            }
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

/// Returns the possible floors of a clip, the likeliest first, and the reason if none of them was seen. Several compete if
/// the seen floor lies at an unusual height, since it may be a bed or a step, if something lies below it, or if a level
/// surface at another, usual height has at least three times its area.
pub fn floors(
    cloud: &PointCloud,
    key_frames: &[KeyFrame],
    up_in_world: Option<&Up>,
    seed: u64,
) -> (Vec<Floor>, Option<NoFloor>) {
    let planes = Planes::grow(cloud, key_frames, up_in_world, &CAMERA_HEIGHT_M, seed);
    let best = planes.as_ref().map_err(|why| *why).and_then(Planes::best);
    let mut floors: Vec<Floor> = best.iter().cloned().collect();
    let Some(up) = up_in_world else { return (floors, best.err()) };
    if let Ok(planes) = &planes {
        floors.extend(planes.rival(best.as_ref().ok()));
    }
    let cameras: Vec<Point3> = key_frames.iter().map(position).collect();
    let is_usual = |floor: &Floor| USUAL_HEIGHT_M.contains(&median_height_m(&floor.plane_in_world, &cameras));
    let none_seen = best.as_ref().err().copied().filter(|_| floors.is_empty());
    if !best.as_ref().is_ok_and(is_usual) {
        for assumed in assume(cloud, key_frames, up) {
            let height_m = assumed.first_camera_height_m;
            let is_near = |f: &Floor| (f.first_camera_height_m - height_m).abs() < SAME_FLOOR_M;
            // A height that is assumed only because something lies that low: false depth is below a seen floor, too.
            let is_less_likely = !floors.is_empty() && !USUAL_HEIGHT_M.contains(&height_m);
            if !floors.iter().any(is_near) && !is_less_likely {
                floors.push(assumed);
            }
        }
    }
    (floors, none_seen)
}

/// Finds the floor by seeded RANSAC among nearly level planes, in a world of any orientation. `heights_m` are the allowed
/// heights of the first camera above it.
pub fn find_floor(
    cloud: &PointCloud,
    key_frames: &[KeyFrame],
    up_in_world: Option<&Up>,
    heights_m: &RangeInclusive<f64>,
    seed: u64,
) -> Result<Floor, NoFloor> {
    Planes::grow(cloud, key_frames, up_in_world, heights_m, seed)?.best()
}

/// The nearly level planes of a clip.
struct Planes<'a> {
    cloud: &'a PointCloud,
    first: &'a KeyFrame,
    cameras: Vec<Point3>,
    up_in_world: Option<&'a Up>,
    /// Every `stride`th point of the cloud.
    scored: Vec<Scored>,
    stride: usize,
    up: Vector3,
    cone: f64,
    heights_m: &'a RangeInclusive<f64>,
    /// By descending score. If gravity is unknown and the best one is not walked on, floors that are walked on come first.
    /// Ties go to the earlier pick, so that the answer does not depend on threads.
    candidates: Vec<Candidate>,
}

impl<'a> Planes<'a> {
    fn grow(
        cloud: &'a PointCloud,
        key_frames: &'a [KeyFrame],
        up_in_world: Option<&'a Up>,
        heights_m: &'a RangeInclusive<f64>,
        seed: u64,
    ) -> Result<Planes<'a>, NoFloor> {
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
            return Err(if scored.is_empty() { NoFloor::EmptyCloud } else { no_plane_at_all(up_in_world) });
        }
        let cameras = key_frames.iter().map(position).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let picks: Vec<usize> = (0..HYPOTHESES).map(|_| flat[rng.random_range(0..flat.len())]).collect();
        let candidates = Vec::new();
        let mut planes =
            Planes { cloud, first, cameras, up_in_world, scored, stride, up, cone, heights_m, candidates };
        let scorer = planes.scorer();
        let mut candidates: Vec<Candidate> = picks.par_iter().filter_map(|&pick| scorer.grow(pick)).collect();
        candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
        let is_likely = |candidate: &Candidate| planes.is_floor(candidate) && planes.is_walked_on(candidate);
        if up_in_world.is_none() && candidates.first().is_some_and(|best| !planes.is_walked_on(best)) {
            // Stable: planes of either kind stay in the order of their scores.
            candidates.sort_by_key(|candidate| !is_likely(candidate));
        }
        planes.candidates = candidates;
        Ok(planes)
    }

    /// Returns whether nearly all cameras are at an allowed height above a plane. A wall may be as near to the first one, but
    /// a person walks along a floor, and away from a wall.
    fn is_walked_on(&self, candidate: &Candidate) -> bool {
        let heights_m = self.cameras.iter().map(|camera| candidate.plane.height_m(camera));
        let allowed = heights_m.filter(|height_m| self.heights_m.contains(height_m)).count();
        10 * allowed >= 9 * self.cameras.len()
    }

    fn scorer(&self) -> Scorer<'_> {
        let Planes { scored, cameras, up, cone, heights_m, .. } = self;
        Scorer { scored, cameras, up: *up, cone: *cone, heights_m }
    }

    /// Returns the best plane, if it is large enough and little lies below it.
    fn best(&self) -> Result<Floor, NoFloor> {
        let best = self.candidates.first().ok_or_else(|| no_plane_at_all(self.up_in_world))?;
        if self.is_floor(best) {
            return Ok(self.floor(best));
        }
        let (best_area_m2, below_fraction) = (self.area_m2(best), self.below_fraction(best));
        Err(NoFloor::NoPlane { best_area_m2, below_fraction, is_up_known: self.up_in_world.is_some() })
    }

    /// Returns whether a plane is large enough and little lies below it.
    fn is_floor(&self, candidate: &Candidate) -> bool {
        self.area_m2(candidate) >= MIN_AREA_M2 && self.below_fraction(candidate) <= MAX_BELOW_FRACTION
    }

    fn below_fraction(&self, candidate: &Candidate) -> f64 {
        candidate.below as f64 / self.scored.len() as f64
    }

    /// Returns the largest plane at a usual height. If the best plane is a floor, it needs [`RIVAL_RATIO`] times its inliers,
    /// and is made parallel to it: scans above other floors differ by their height only.
    fn rival(&self, floor: Option<&Floor>) -> Option<Floor> {
        let best = self.candidates.first().filter(|_| floor.is_some());
        let least = best.map_or(0, |best| RIVAL_RATIO * best.inliers);
        let first_m = |candidate: &Candidate| candidate.plane.height_m(&self.cameras[0]);
        let rivals = self.candidates.iter().filter(|candidate| {
            candidate.inliers >= least
                && self.area_m2(candidate) >= RIVAL_AREA_M2
                && best.is_none_or(|best| (first_m(best) - first_m(candidate)).abs() >= SAME_FLOOR_M)
                && USUAL_HEIGHT_M.contains(&median_height_m(&candidate.plane, &self.cameras))
        });
        let largest = rivals.enumerate().max_by(|(i, a), (j, b)| a.inliers.cmp(&b.inliers).then(j.cmp(i)));
        let rival = self.floor(largest?.1);
        let Some(floor) = floor else { return Some(rival) };
        let middle = self.scorer().middle_on(&rival.plane_in_world)?;
        Some(self.floor_at(Plane::through(&middle, floor.plane_in_world.normal)))
    }

    /// A flat surface changes sign along about one axis, so each point stands for one voxel face.
    fn area_m2(&self, candidate: &Candidate) -> f64 {
        candidate.inliers as f64 * self.stride as f64 * self.cloud.voxel_m * self.cloud.voxel_m
    }

    fn floor(&self, candidate: &Candidate) -> Floor {
        let scorer = self.scorer();
        let refitted = scorer.refit_plane(candidate.plane);
        let plane = match self.up_in_world {
            Some(up) => scorer.combined_with_gravity(&refitted, self.area_m2(candidate), up),
            None => refitted,
        };
        self.floor_at(plane)
    }

    fn floor_at(&self, plane: Plane) -> Floor {
        let is_on = |point: &&CloudPoint| plane.height_m(&point.position()).abs() < 0.02;
        let known = self.up_in_world.map(|up| up.direction);
        Floor {
            plane_in_world: plane,
            clip_from_world: clip_from_world(&plane, &self.first.world_from_camera),
            first_camera_height_m: plane.height_m(&self.cameras[0]),
            support_points: self.cloud.points.iter().filter(is_on).count(),
            assumed: false,
            gravity_angle_rad: known.map(|up| plane.normal.dot(&up).clamp(-1.0, 1.0).acos()),
        }
    }
}

fn position(key: &KeyFrame) -> Point3 {
    Point3::from(key.world_from_camera.translation.vector)
}

/// Returns the median height of cameras above a plane.
fn median_height_m(plane: &Plane, cameras: &[Point3]) -> f64 {
    let mut heights_m: Vec<f64> = cameras.iter().map(|camera| plane.height_m(camera)).collect();
    heights_m.sort_by(f64::total_cmp);
    heights_m.get(heights_m.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns assumed level floors for a clip that shows none (the paper's future work): the first camera is
/// at heights at which people hold a phone, and no floor is above the lowest seen surface.
fn assume(cloud: &PointCloud, key_frames: &[KeyFrame], up: &Up) -> Vec<Floor> {
    let Some(first) = key_frames.first() else { return Vec::new() };
    let up = up.direction;
    let camera = position(first);
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

fn no_plane_at_all(up_in_world: Option<&Up>) -> NoFloor {
    NoFloor::NoPlane { best_area_m2: 0.0, below_fraction: 0.0, is_up_known: up_in_world.is_some() }
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
