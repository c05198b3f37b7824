//! Planes that may be the floor, and their scores.

use crate::cloud::{CloudPoint, Label};
use nalgebra::Matrix2;
use std::ops::RangeInclusive;
use viola_formats::clip::Up;
use viola_geometry::{Plane, Point3, Vector2, Vector3};

/// Maximum distance of an inlier from the plane.
const INLIER_M: f64 = 0.03;
/// A point further below the plane than this counts against it: nothing is under a floor.
const BELOW_M: f64 = 0.08;

pub(super) struct Candidate {
    pub plane: Plane,
    pub inliers: usize,
    pub below: usize,
    pub score: f64,
}

/// A cloud point with the data that the floor search needs.
pub(super) struct Scored {
    pub position_m: Point3,
    pub normal: Vector3,
    /// False if the pictures label it as another level surface: the top of a bed, a table.
    pub may_be_floor: bool,
}

impl From<&CloudPoint> for Scored {
    fn from(point: &CloudPoint) -> Scored {
        const SURE: f32 = 0.5;
        let Label { class, .. } = point.label;
        let else_for_sure = class.has_level_top() && point.label.probability() > SURE;
        Scored { position_m: point.position(), normal: point.normal(), may_be_floor: !else_for_sure }
    }
}

pub(super) struct Scorer<'a> {
    pub scored: &'a [Scored],
    pub cameras: &'a [Point3],
    pub up: Vector3,
    pub cone: f64,
    /// Allowed height of the first camera above the floor.
    pub heights_m: &'a RangeInclusive<f64>,
}

impl Scorer<'_> {
    /// Grows a plane from one point and its normal by fits with a growing radius and a stricter distance.
    pub fn grow(&self, pick: usize) -> Option<Candidate> {
        let Scored { position_m: point, normal, .. } = self.scored[pick];
        let mut plane = Plane::through(&point, normal);
        let mut near: Vec<&Point3> = Vec::new();
        for (distance_m, radius_m, angle) in [(0.05, 0.6, 0.35), (0.04, 2.0, 0.25), (INLIER_M, 1e3, 0.25)] {
            let min_cosine = f64::cos(angle);
            let is_near = |s: &&Scored| {
                s.may_be_floor
                    && plane.height_m(&s.position_m).abs() < distance_m
                    && s.normal.dot(&plane.normal) > min_cosine
                    && (s.position_m - point).norm_squared() < radius_m * radius_m
            };
            near.clear();
            near.extend(self.scored.iter().filter(is_near).map(|s| &s.position_m));
            plane = Plane::fit(&near)?.facing(&normal);
        }
        self.candidate(plane)
    }

    fn candidate(&self, plane: Plane) -> Option<Candidate> {
        let heights = self.cameras.iter().map(|c| plane.height_m(c));
        let under_all = heights.clone().all(|h| h > 0.0);
        let first = plane.height_m(&self.cameras[0]);
        if plane.normal.dot(&self.up) < self.cone.cos() || !under_all || !self.heights_m.contains(&first) {
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

    /// Returns the floor points within a distance of a plane.
    fn on(&self, plane: &Plane, within_m: f64) -> Vec<&Point3> {
        let is_on = |s: &&Scored| {
            s.may_be_floor
                && plane.height_m(&s.position_m).abs() < within_m
                && s.normal.dot(&plane.normal) > 0.9
        };
        self.scored.iter().filter(is_on).map(|s| &s.position_m).collect()
    }

    /// Returns the middle of the floor points on a plane.
    pub fn middle_on(&self, plane: &Plane) -> Option<Point3> {
        let points = self.on(plane, INLIER_M);
        let sum = || points.iter().map(|p| p.coords).sum::<Vector3>();
        (!points.is_empty()).then(|| Point3::from(sum() / points.len() as f64))
    }

    /// Refits the plane to its inliers until it converges. The inlier distance starts wider, because a bent
    /// floor leaves the narrow band of the first plane.
    pub fn refit_plane(&self, plane: Plane) -> Plane {
        const ROUNDS: i32 = 20;
        const WIDER: f64 = 1.7;
        const NARROWER: f64 = 0.8;
        let mut plane = plane;
        for round in 0..ROUNDS {
            let within_m = INLIER_M * (WIDER * NARROWER.powi(round)).max(1.0);
            let Some(fitted) = Plane::fit(&self.on(&plane, within_m)) else { return plane };
            let fitted = fitted.facing(&plane.normal);
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
    pub fn combined_with_gravity(&self, plane: &Plane, area_m2: f64, known_up: &Up) -> Plane {
        /// Area over which the errors of a floor are correlated.
        const ALIKE_M2: f64 = 0.3;
        /// Lower bound of the measured unevenness.
        const MIN_UNEVENNESS_M: f64 = 0.002;
        /// Standard deviation of a recording's own tilt: poses drift, and parts of the real apartment's
        /// floors tilt by 1.9 degrees.
        const DRIFT_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
        let up = &known_up.direction;
        let seen = self.on(plane, INLIER_M);
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
        let uneven_m2 = (squares_m2 / seen.len() as f64).max(MIN_UNEVENNESS_M * MIN_UNEVENNESS_M);
        let spread: Matrix2<f64> = seen.iter().map(|p| flat(p) * flat(p).transpose()).sum();
        // Inverse covariance of the fitted tilt.
        let by_points = spread * (area_m2 / ALIKE_M2 / seen.len() as f64 / uneven_m2);
        let with_drift = Matrix2::identity() + by_points * DRIFT_RAD.powi(2);
        let Some(known) = with_drift.try_inverse().map(|inverse| by_points * inverse) else { return *plane };
        let level = Matrix2::identity() / known_up.deviation_rad.powi(2);
        let lean = Vector2::new(plane.normal.dot(&east), plane.normal.dot(&north)) / plane.normal.dot(up);
        let Some(covariance) = (known + level).try_inverse() else { return *plane };
        let lean = covariance * known * lean;
        Plane::through(&Point3::from(middle), up + east * lean.x + north * lean.y)
    }
}
