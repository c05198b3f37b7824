//! Relative pose of two clips that saw the same place.

use super::surface::{Surface, SurfacePoint};
use nalgebra::{Matrix6, Translation3, UnitQuaternion, Vector6};
use serde::{Deserialize, Serialize};
use viola_geometry::{Point3, Pose3, Vector3};
use viola_reconstruct::PointCloud;

/// Points of one clip that are searched in the other.
const SAMPLES: usize = 3_000;
/// Scales of the robust kernel, wide to narrow, and the steps at each.
const KERNEL_M: [f64; 3] = [0.12, 0.06, 0.03];
const STEPS: usize = 5;
/// A point is found if its distance to the other surface, along the normal, is below this.
const NEAR_M: f64 = 0.05;
/// Minimum found points on upright surfaces of an overlap.
const MIN_FOUND: usize = 120;
/// Larger corrections mean that the clips do not see the same place.
const MAX_SHIFT_M: f64 = 0.25;
const MAX_TURN_RAD: f64 = 5f64.to_radians();
/// Standard deviation of a found point's distance, and the number of neighbouring points with the same error.
const NOISE_M: f64 = 0.02;
const CORRELATED: f64 = 20.0;

/// Relative pose of two clips.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Overlap {
    pub b_from_a: Pose3,
    /// Information of a small motion of `a` in `b`'s frame: translation, then rotation vector about `b`'s
    /// axes through `a`'s origin. Row-major.
    pub information: [[f64; 6]; 6],
    /// Upright points of `a` found in `b`.
    pub found: usize,
}

/// Registers the surface of `a` to that of `b` (point-to-plane), starting at `start`.
pub(super) fn overlap(a: &Surface, b: &Surface, start: &Pose3) -> Option<Overlap> {
    let samples: Vec<&SurfacePoint> = a.some(SAMPLES).collect();
    let mut pose = *start;
    for kernel_m in KERNEL_M {
        for _ in 0..STEPS {
            let normal = Normal::gather(&samples, b, &pose, kernel_m, NEAR_M);
            let mut information = normal.information;
            // Damping: directions without constraint, as along a bare wall, keep the start.
            (0..6).for_each(|i| information[(i, i)] += 1.0);
            let step = information.cholesky().map(|c| -c.solve(&normal.gradient))?;
            pose = moved(&pose, &step);
            if step.fixed_rows::<3>(0).norm() < 1e-4 && step.fixed_rows::<3>(3).norm() < 1e-5 {
                break;
            }
        }
    }
    let last = Normal::gather(&samples, b, &pose, KERNEL_M[2], NEAR_M);
    // Of the shared surface: it may be far from the first camera, which a small turn about it moves far.
    let shift_m = (pose * last.middle_of_a() - start * last.middle_of_a()).norm();
    let far = shift_m > MAX_SHIFT_M || pose.rotation.angle_to(&start.rotation) > MAX_TURN_RAD;
    if far || !pose.translation.vector.iter().all(|c| c.is_finite()) || last.found < MIN_FOUND {
        return None;
    }
    let variance = NOISE_M * NOISE_M * CORRELATED;
    let information = last.information / variance;
    let row = |i: usize| std::array::from_fn(|j| information[(i, j)]);
    Some(Overlap { b_from_a: pose, information: std::array::from_fn(row), found: last.found })
}

/// Returns a pose after a small motion: translation, and rotation about the pose's origin.
pub(super) fn moved(pose: &Pose3, step: &Vector6<f64>) -> Pose3 {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
    let shift = Vector3::new(step[0], step[1], step[2]);
    Pose3::from_parts(Translation3::from(pose.translation.vector + shift), turn * pose.rotation)
}

/// Returns the RMS distance, along normals, of the points of `a` from `b`'s surface, and their number. Only
/// points within `near_m` count.
pub fn disagreement(a: &PointCloud, b: &PointCloud, b_from_a: &Pose3, near_m: f64) -> (f64, usize) {
    let (a, b) = (Surface::new(a), Surface::new(b));
    let (mut squares, mut found) = (0.0, 0usize);
    for point in &a.points {
        let position = b_from_a * point.position;
        if let Some(near) = b.nearest(&position, &(b_from_a * point.normal)) {
            let distance_m = near.normal.dot(&(position - near.position));
            if distance_m.abs() < near_m {
                squares += distance_m * distance_m;
                found += 1;
            }
        }
    }
    ((squares / found.max(1) as f64).sqrt(), found)
}

/// The normal equations at one pose, and the number of upright points found.
struct Normal {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    found: usize,
    /// Sum of the found points, in `a`'s frame.
    sum_in_a: Vector3,
}

impl Normal {
    fn gather(samples: &[&SurfacePoint], b: &Surface, pose: &Pose3, kernel_m: f64, near_m: f64) -> Normal {
        let mut normal = Normal {
            information: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            found: 0,
            sum_in_a: Vector3::zeros(),
        };
        let c2 = kernel_m * kernel_m;
        for sample in samples {
            let position = pose * sample.position;
            let Some(near) = b.nearest(&position, &(pose.rotation * sample.normal)) else { continue };
            let distance_m = near.normal.dot(&(position - near.position));
            let kernel_weight = c2 / (c2 + distance_m * distance_m);
            let turn = (position.coords - pose.translation.vector).cross(&near.normal);
            let n = near.normal;
            let slope = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            normal.information += slope * slope.transpose() * (kernel_weight * kernel_weight);
            normal.gradient += slope * (distance_m * kernel_weight * kernel_weight);
            if sample.is_upright() && distance_m.abs() < near_m {
                normal.found += 1;
                normal.sum_in_a += sample.position.coords;
            }
        }
        normal
    }

    fn middle_of_a(&self) -> Point3 {
        Point3::from(self.sum_in_a / self.found.max(1) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use viola_reconstruct::{CloudPoint, Label};

    /// Two walls that meet, a pillar and a floor.
    fn corner() -> PointCloud {
        let mut points = Vec::new();
        let mut add = |position_m: [f64; 3], normal: [f32; 3]| {
            let position_m = position_m.map(|c| c as f32);
            points.push(CloudPoint { position_m, normal, color: [9, 9, 9], label: Label::NONE, weight: 1 });
        };
        for up in 0..50 {
            let z = f64::from(up) * 0.06;
            for along in 0..50 {
                let s = f64::from(along) * 0.06;
                add([s, 0.0, z], [0.0, 1.0, 0.0]);
                add([0.0, s, z], [1.0, 0.0, 0.0]);
                add([s, z, 0.0], [0.0, 0.0, 1.0]);
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
            x in -5.0..5.0f64, y in -5.0..5.0f64, z in -0.5..0.5f64, yaw in -3.1..3.1f64,
            off in prop::array::uniform3(-0.05..0.05f64), turn in prop::array::uniform3(-0.02..0.02f64),
        ) {
            let truth = Pose3::new(Vector3::new(x, y, z), Vector3::new(0.0, 0.0, yaw));
            let there = corner().transformed(&truth);
            let start = truth * Pose3::new(off.into(), turn.into());
            let (a, b) = (Surface::new(&corner()), Surface::new(&there));
            let found = overlap(&a, &b, &start).unwrap().b_from_a;
            prop_assert!((found.translation.vector - truth.translation.vector).norm() < 3e-3, "{found:?} {truth:?}");
            prop_assert!(found.rotation.angle_to(&truth.rotation) < 2e-3);
        }
    }

    /// The shared surface is 12 m from the first camera of both clips, which the correction moves by 0.4 m.
    #[test]
    fn a_turn_about_a_far_surface_is_a_small_correction() {
        let there = corner().transformed(&Pose3::translation(12.0, 0.0, 0.0));
        let middle = Vector3::new(13.0, 1.0, 1.0);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 2f64.to_radians()));
        let start = Pose3::from_parts((middle - turn * middle).into(), turn);
        let surface = Surface::new(&there);
        let found = overlap(&surface, &surface, &start).unwrap().b_from_a;
        let moved = found * Point3::from(middle) - Point3::from(middle);
        assert!(moved.norm() < 3e-3 && found.rotation.angle() < 2e-3, "{found:?}");
    }

    #[test]
    fn two_sides_of_a_wall_do_not_overlap() {
        let mut behind = corner();
        behind.points.iter_mut().for_each(|point| point.normal = point.normal.map(|c| -c));
        let (a, b) = (Surface::new(&corner()), Surface::new(&behind));
        assert_eq!(overlap(&a, &b, &Pose3::identity()), None);
    }
}
