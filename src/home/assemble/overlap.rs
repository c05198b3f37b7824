//! How two clips that saw the same place lie to each other.

use super::surface::{Surface, SurfacePoint};
use crate::geometry::{Point3, Pose2, Vector3, angle_between};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// How two clips are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct OverlapParams {
    /// Points of one clip that are looked for in the other.
    pub samples: usize,
    /// Scales of the robust kernel, wide to narrow, and the steps at each.
    pub kernel_m: [f64; 3],
    pub steps: usize,
    /// A point this near to the other clip's surface, measured along its normal, has been found there.
    pub near_m: f64,
    /// Fewer found points are no overlap.
    pub min_found: usize,
    /// Clips that would have to move further than this to agree do not see the same thing.
    pub max_shift_m: f64,
    pub max_turn_rad: f64,
    /// Standard deviation of one found point's distance, and how many neighbouring ones share their errors.
    pub noise_m: f64,
    pub correlated: f64,
}

impl Default for OverlapParams {
    fn default() -> Self {
        OverlapParams {
            samples: 2_500,
            kernel_m: [0.12, 0.06, 0.03],
            steps: 5,
            near_m: 0.05,
            min_found: 120,
            max_shift_m: 0.25,
            max_turn_rad: 5f64.to_radians(),
            noise_m: 0.02,
            correlated: 20.0,
        }
    }
}

/// What two clips say about each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Overlap {
    pub b_from_a: Pose2,
    /// Of (x_m, y_m, yaw_rad) of `b_from_a`.
    pub information: [[f64; 3]; 3],
    /// Points of `a` that were found in `b`.
    pub found: usize,
}

/// Point-to-plane registration of the upright surfaces of `a` to those of `b`, from where the map has them.
pub(super) fn overlap(a: &Surface, b: &Surface, start: &Pose2, params: &OverlapParams) -> Option<Overlap> {
    let samples: Vec<&SurfacePoint> = a.some(params.samples).collect();
    let mut pose = *start;
    for kernel_m in params.kernel_m {
        for _ in 0..params.steps {
            let normal = Normal::gather(&samples, b, &pose, kernel_m, params.near_m);
            let mut information = normal.information;
            // Along a bare wall nothing holds: there it stays where the map put it.
            (0..3).for_each(|i| information[(i, i)] += 1.0);
            let step = information.cholesky().map(|c| -c.solve(&normal.gradient))?;
            pose = Pose2::new(pose.x_m + step.x, pose.y_m + step.y, pose.yaw_rad + step.z);
            if step.xy().norm() < 1e-4 && step.z.abs() < 1e-5 {
                break;
            }
        }
    }
    let far = pose.distance_m(start) > params.max_shift_m
        || angle_between(pose.yaw_rad, start.yaw_rad) > params.max_turn_rad;
    let last = Normal::gather(&samples, b, &pose, params.kernel_m[2], params.near_m);
    if far || !pose.is_finite() || last.found < params.min_found {
        return None;
    }
    let variance = params.noise_m * params.noise_m * params.correlated;
    let information = last.information / variance;
    let row = |i: usize| [information[(i, 0)], information[(i, 1)], information[(i, 2)]];
    Some(Overlap { b_from_a: pose, information: [row(0), row(1), row(2)], found: last.found })
}

/// How far, along their normals, the points of `a` are from `b`'s surface: root of the mean square of those that are
/// found within `near_m`, and how many they are.
pub fn disagreement(
    a: &crate::align::PointCloud,
    b: &crate::align::PointCloud,
    b_from_a: &Pose2,
    near_m: f64,
) -> (f64, usize) {
    let (a, b) = (Surface::new(a), Surface::new(b));
    let (mut squares, mut found) = (0.0, 0usize);
    for point in &a.points {
        let (position, normal) = placed(point, b_from_a);
        if let Some(near) = b.nearest(&position, &normal) {
            let distance_m = near.normal.dot(&(position - near.position));
            if distance_m.abs() < near_m {
                squares += distance_m * distance_m;
                found += 1;
            }
        }
    }
    ((squares / found.max(1) as f64).sqrt(), found)
}

fn placed(point: &SurfacePoint, b_from_a: &Pose2) -> (Point3, Vector3) {
    let at = b_from_a.apply(&point.position.xy());
    let turned = b_from_a.rotate(&point.normal.xy());
    (Point3::new(at.x, at.y, point.position.z), Vector3::new(turned.x, turned.y, point.normal.z))
}

/// The normal equations at one pose, and how many points were found.
struct Normal {
    information: Matrix3<f64>,
    gradient: nalgebra::Vector3<f64>,
    found: usize,
}

impl Normal {
    fn gather(samples: &[&SurfacePoint], b: &Surface, pose: &Pose2, kernel_m: f64, near_m: f64) -> Normal {
        let mut normal = Normal { information: Matrix3::zeros(), gradient: nalgebra::Vector3::zeros(), found: 0 };
        let c2 = kernel_m * kernel_m;
        for sample in samples {
            let (position, facing) = placed(sample, pose);
            let Some(near) = b.nearest(&position, &facing) else { continue };
            let distance_m = near.normal.dot(&(position - near.position));
            let share = c2 / (c2 + distance_m * distance_m);
            let (rx, ry) = (position.x - pose.x_m, position.y - pose.y_m);
            let slope = nalgebra::Vector3::new(
                near.normal.x,
                near.normal.y,
                near.normal.y * rx - near.normal.x * ry,
            );
            normal.information += slope * slope.transpose() * (share * share);
            normal.gradient += slope * (distance_m * share * share);
            normal.found += usize::from(distance_m.abs() < near_m);
        }
        normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::align::{CloudPoint, PointCloud, label::Label};
    use proptest::prelude::*;

    /// Two walls that meet and a pillar.
    fn corner() -> PointCloud {
        let mut points = Vec::new();
        let mut add = |position_m: [f64; 3], normal: [f32; 3]| {
            let position_m = position_m.map(|c| c as f32);
            points.push(CloudPoint { position_m, normal, color: [9, 9, 9], label: Label::NONE });
        };
        for up in 0..40 {
            let z = f64::from(up) * 0.06;
            for along in 0..50 {
                let s = f64::from(along) * 0.06;
                add([s, 0.0, z], [0.0, 1.0, 0.0]);
                add([0.0, s, z], [1.0, 0.0, 0.0]);
            }
            for along in 0..6 {
                let s = f64::from(along) * 0.06;
                add([1.0 + s, 1.0, z], [0.0, -1.0, 0.0]);
                add([1.0, 1.0 + s, z], [-1.0, 0.0, 0.0]);
            }
        }
        PointCloud { points, voxel_m: 0.06 }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn a_moved_clip_is_found(
            x in -5.0..5.0f64, y in -5.0..5.0f64, yaw in -3.1..3.1f64,
            dx in -0.06..0.06f64, dy in -0.06..0.06f64, turn in -0.02..0.02f64,
        ) {
            let truth = Pose2::new(x, y, yaw);
            let there = corner().transformed(&crate::geometry::Pose3::new(
                Vector3::new(x, y, 0.0),
                Vector3::new(0.0, 0.0, yaw),
            ));
            let start = truth.compose(&Pose2::new(dx, dy, turn));
            let (a, b) = (Surface::new(&corner()), Surface::new(&there));
            let found = overlap(&a, &b, &start, &OverlapParams::default()).unwrap();
            prop_assert!(found.b_from_a.distance_m(&truth) < 2e-3, "{:?} {truth:?}", found.b_from_a);
            prop_assert!(angle_between(found.b_from_a.yaw_rad, yaw) < 1e-3);
        }
    }

    #[test]
    fn two_sides_of_a_wall_do_not_overlap() {
        let mut behind = corner();
        behind.points.iter_mut().for_each(|point| point.normal = point.normal.map(|c| -c));
        let (a, b) = (Surface::new(&corner()), Surface::new(&behind));
        assert_eq!(overlap(&a, &b, &Pose2::IDENTITY, &OverlapParams::default()), None);
    }
}
