//! The up direction, by the layout or by the device's accelerometer.

use super::FrameHeader;
use viola_geometry::{Pose3, Vector3};

/// The up direction in a world, and its accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Up {
    /// A unit vector.
    pub direction: Vector3,
    /// Standard deviation of its angle.
    pub deviation_rad: f64,
}

/// Standard deviation of the up direction of devices' own sensor fusion.
const OF_DEVICES_RAD: f64 = 0.6 * std::f64::consts::PI / 180.0;
/// Standard deviation of an accelerometer's mounting: the Kinect of TUM's `freiburg1_rpy` is 4 degrees from
/// the motion capture's upright axis. The hand's acceleration averages out.
const MOUNTED_RAD: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Time in which a hand's acceleration reverses.
const SWING_S: f64 = 0.5;
/// Minimum length of the mean force as a fraction of the mean length; less means shaking or wrong poses.
const MIN_MEAN_FRACTION: f64 = 0.85;
const MIN_FRAMES: usize = 5;

impl Up {
    /// Returns the up direction of a layout's world.
    pub fn of_device(direction: Vector3) -> Up {
        Up { direction: direction.normalize(), deviation_rad: OF_DEVICES_RAD }
    }

    /// Returns the mean force in the world of the poses; `None` if forces are too few or contradictory.
    pub fn felt<'a>(frames: impl IntoIterator<Item = (&'a FrameHeader, &'a Pose3)>) -> Option<Up> {
        let mut times_s: Option<(f64, f64)> = None;
        let mut forces = Vec::new();
        for (header, world_from_camera) in frames {
            let Some(force) = header.force_in_camera else { continue };
            forces.push(world_from_camera.rotation * force);
            if let Some(time_s) = header.time_s {
                let (first, last) = times_s.unwrap_or((time_s, time_s));
                times_s = Some((first.min(time_s), last.max(time_s)));
            }
        }
        if forces.len() < MIN_FRAMES {
            return None;
        }
        let count = forces.len() as f64;
        let mean = forces.iter().sum::<Vector3>() / count;
        let size = forces.iter().map(|force| force.norm()).sum::<f64>() / count;
        if mean.norm() < MIN_MEAN_FRACTION * size || mean.norm() < f64::MIN_POSITIVE {
            return None;
        }
        let spread = forces.iter().map(|force| (force - mean).norm_squared()).sum::<f64>() / count;
        let swings = times_s.map_or(1.0, |(first, last)| ((last - first) / SWING_S).clamp(1.0, count));
        let shaken_rad = (spread / swings).sqrt() / mean.norm();
        Some(Up { direction: mean.normalize(), deviation_rad: MOUNTED_RAD.hypot(shaken_rad) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Returns a rotating camera in any world, and gravity and the hand's forces on its accelerometer.
    fn recording(world: &Pose3, shake_mps2: f64, unit: f64) -> (Vec<FrameHeader>, Vec<Pose3>) {
        let up_in_world = world.rotation * Vector3::z();
        let poses: Vec<Pose3> = (0..60)
            .map(|i| {
                let t = f64::from(i) / 10.0;
                world
                    * Pose3::new(Vector3::new(t, 0.0, 1.4), Vector3::new(0.9 * (0.7 * t).sin(), 0.5 * t, 0.3))
            })
            .collect();
        let headers = poses.iter().enumerate().map(|(i, pose)| {
            let hand =
                Vector3::new((i as f64).sin(), (1.7 * i as f64).cos(), (0.6 * i as f64).sin()) * shake_mps2;
            FrameHeader {
                number: i as u32,
                time_s: Some(i as f64 / 10.0),
                world_from_camera: None,
                force_in_camera: Some((pose.rotation.inverse() * (up_in_world * 9.81 + hand)) * unit),
            }
        });
        (headers.collect(), poses)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// In any world and any unit.
        #[test]
        fn a_swinging_hand_does_not_tilt_the_world(
            turn in prop::array::uniform3(-3.0..3.0f64), shake_mps2 in 0.0..2.0f64, unit in 0.1..2.0f64,
        ) {
            let world = Pose3::new(Vector3::new(2.0, -1.0, 0.5), Vector3::from(turn));
            let (headers, poses) = recording(&world, shake_mps2, unit);
            let up = Up::felt(headers.iter().zip(&poses)).unwrap();
            let off = up.direction.angle(&(world.rotation * Vector3::z()));
            prop_assert!(off < 1f64.to_radians() * (0.01 + shake_mps2), "{}", off.to_degrees());
            prop_assert!(off < 3.0 * up.deviation_rad && up.deviation_rad < 6f64.to_radians());
        }
    }

    /// Poses of another world than the forces, or too few of them.
    #[test]
    fn what_contradicts_itself_is_no_gravity() {
        let (headers, mut poses) = recording(&Pose3::identity(), 0.1, 1.0);
        for (i, pose) in poses.iter_mut().enumerate() {
            *pose *= Pose3::new(Vector3::zeros(), Vector3::new(0.3 * i as f64, 0.0, 0.0));
        }
        assert_eq!(Up::felt(headers.iter().zip(&poses)), None);
        assert_eq!(Up::felt(headers[..3].iter().zip(&poses)), None);
    }
}
