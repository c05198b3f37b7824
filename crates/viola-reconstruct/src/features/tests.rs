use super::*;
use viola_geometry::{Pinhole, Vector3};

/// Grey of a wall at (along, up): blotches of 7 cm.
fn grey(along_m: f64, up_m: f64) -> f32 {
    let cell = |value: f64| (value / 0.07).floor() as i64;
    let mixed = (cell(along_m) * 7_919 + cell(up_m) * 104_729).unsigned_abs();
    (mixed.wrapping_mul(2_654_435_761) >> 16 & 0xff) as f32 / 255.0
}

/// A picture of the wall x = 3, from `eye`, looking along x turned by `yaw_rad`.
fn picture(eye: [f64; 3], yaw_rad: f64) -> Picture {
    let camera = Pinhole { width: 256, height: 192, fx: 210.0, fy: 210.0, cx: 127.5, cy: 95.5 };
    let level = nalgebra::Rotation3::from_basis_unchecked(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad) * level;
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&turn);
    let world_from_camera = Pose3::from_parts(Vector3::from(eye).into(), rotation);
    let (mut shades, mut depth_m) = (Vec::new(), Vec::new());
    for y in 0..camera.height {
        for x in 0..camera.width {
            let ray = turn * camera.ray(f64::from(x), f64::from(y));
            let depth = (3.0 - eye[0]) / ray.x;
            let at = Vector3::from(eye) + ray * depth;
            shades.push(grey(at.y, at.z));
            depth_m.push(depth as f32);
        }
    }
    Picture { world_from_camera, layer: Layer { camera, grey: shades, depth_m } }
}

/// Fraction of the features of `a` that `b` has at the same place with a similar description.
fn found_again(a: &[Feature], b: &[Feature]) -> f64 {
    let again = |one: &&Feature| {
        b.iter().any(|other| {
            (other.position() - one.position()).norm() < 0.05
                && other.descriptor.similarity(&one.descriptor) > 0.85
        })
    };
    a.iter().filter(again).count() as f64 / a.len() as f64
}

#[test]
fn a_wall_is_described_alike_from_other_places() {
    let from = |eye, yaw_rad: f64| features(&[picture(eye, yaw_rad)], &Pose3::identity());
    let front = from([0.8, 0.0, 1.4], 0.0);
    assert!(front.len() > 60, "{}", front.len());
    let facing = front.iter().all(|one| (one.heading_rad.abs() - std::f32::consts::PI).abs() < 0.1);
    assert!(facing, "the patches face the room");
    for (name, other) in [("nearer", from([1.6, 0.0, 1.4], 0.0)), ("aside", from([0.8, -1.2, 1.2], 0.5))] {
        assert!(found_again(&other, &front) > 0.4, "{name}: {}", found_again(&other, &front));
    }
    // The same part of another wall.
    let elsewhere: Vec<Feature> = from([0.8, 40.0, 1.4], 0.0);
    let moved = |mut one: Feature| {
        one.position_m[1] -= 40.0;
        one
    };
    assert!(found_again(&elsewhere.into_iter().map(moved).collect::<Vec<_>>(), &front) < 0.02);
}

#[test]
fn features_of_several_pictures_are_joined() {
    let one = picture([0.8, 0.0, 1.4], 0.0);
    let twice = features(&[one.clone(), picture([0.9, 0.0, 1.4], 0.0)], &Pose3::identity());
    let once = features(&[one], &Pose3::identity());
    assert!(twice.len() < 3 * once.len() / 2, "{} {}", twice.len(), once.len());
    assert!(twice.len() <= MAX_FEATURES);
}
