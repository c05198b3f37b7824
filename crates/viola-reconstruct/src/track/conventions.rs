//! Whether a recording's poses follow another convention than its format.
//!
//! Neighbouring key frames see mostly the same surface. If their readings lie in the same places only after the poses are
//! inverted, turned to another frame of the camera or divided, the recording has them so.

use crate::error::ReconstructError;
use crate::key_frame::{KeyFrame, Readings};
use crate::reason::Reason;
use crate::trajectory::Trajectory;
use nalgebra::UnitQuaternion;
use std::f64::consts::PI;
use std::ops::Range;
use viola_formats::clip::{Clip, ClipError, Frame, FrameHeader};
use viola_geometry::{Pose3, Vector3};

/// Maximum number of compared pairs, evenly over the clip, and minimum number.
const PAIRS: usize = 24;
const MIN_PAIRS: usize = 3;
/// Stride of a key frame's compared readings.
const EVERY: usize = 5;
/// Maximum distance between readings of one surface, and maximum depth at which the sensor is that accurate.
const SAME_SURFACE_M: f64 = 0.08;
const MAX_DEPTH_M: f64 = 4.0;
/// Minimum fraction of the readings that agree by another convention, and minimum difference to the fraction by the poses
/// as they are.
const MIN_AGREEING: f64 = 0.4;
const MIN_MORE: f64 = 0.25;

/// A frequent mistake in poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mistake {
    Inverted,
    /// The camera looks along its negative z axis, and its y axis points up, as in OpenGL.
    Graphics,
    InvertedGraphics,
    Millimetres,
    Centimetres,
}

impl Mistake {
    const ALL: [Mistake; 5] = [
        Mistake::Inverted,
        Mistake::Graphics,
        Mistake::InvertedGraphics,
        Mistake::Millimetres,
        Mistake::Centimetres,
    ];

    /// Returns the pose without the mistake.
    fn mended(self, pose: &Pose3) -> Pose3 {
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
        let divided = |by: f64| Pose3::from_parts((pose.translation.vector / by).into(), pose.rotation);
        match self {
            Mistake::Inverted => pose.inverse(),
            Mistake::Graphics => pose * half_turn,
            Mistake::InvertedGraphics => pose.inverse() * half_turn,
            Mistake::Millimetres => divided(1000.0),
            Mistake::Centimetres => divided(100.0),
        }
    }

    fn is_unit(self) -> bool {
        matches!(self, Mistake::Millimetres | Mistake::Centimetres)
    }

    /// Completes "the poses seem to be".
    fn description(self) -> &'static str {
        match self {
            Mistake::Inverted => "camera from world instead of world from camera; invert them",
            Mistake::Graphics => {
                "those of a camera that looks along its negative z axis (OpenGL); turn each by 180 degrees about its x axis"
            }
            Mistake::InvertedGraphics => {
                "camera from world, of a camera that looks along its negative z axis (OpenGL); invert them, then turn each by 180 degrees about its x axis"
            }
            Mistake::Millimetres => "in millimetres; divide their positions by 1000",
            Mistake::Centimetres => "in centimetres; divide their positions by 100",
        }
    }
}

/// Returns a reason if neighbouring key frames agree much better by another convention of the poses.
pub fn other_convention(keys: &[KeyFrame]) -> Option<Reason> {
    convention(keys, false)
}

/// Returns the reason of [`other_convention`]. A camera that moves too fast tells that its unit is wrong.
fn convention(keys: &[KeyFrame], is_too_fast: bool) -> Option<Reason> {
    let stride = keys.len().div_ceil(PAIRS).max(1);
    let pairs: Vec<&[KeyFrame]> = keys.windows(2).step_by(stride).collect();
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let agreeing = |mended: &dyn Fn(&Pose3) -> Pose3| {
        let of_pair = |pair: &&[KeyFrame]| agreeing(&pair[0], &pair[1], mended);
        let mut fractions: Vec<f64> = pairs.iter().map(of_pair).collect();
        fractions.sort_by(f64::total_cmp);
        fractions[fractions.len() / 2]
    };
    let as_they_are = agreeing(&|pose: &Pose3| *pose);
    let by_mistake = Mistake::ALL.map(|mistake| (agreeing(&|pose: &Pose3| mistake.mended(pose)), mistake));
    // Depth that is too small agrees with all cameras at one point, and then the unit of the poses is not the mistake.
    let at_one_point = |pose: &Pose3| Pose3::from_parts(Vector3::zeros().into(), pose.rotation);
    let least_of_unit = if is_too_fast { 0.0 } else { agreeing(&at_one_point) + MIN_MORE };
    let counts = |found: &(f64, Mistake)| !found.1.is_unit() || found.0 >= least_of_unit;
    let (most, mistake) = by_mistake.into_iter().filter(counts).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (most >= MIN_AGREEING && most >= as_they_are + MIN_MORE).then(|| {
        let detail = format!(
            "by the camera poses {:.0} % of what neighbouring frames see lies in one place, and {:.0} % if the poses are {}",
            100.0 * as_they_are,
            100.0 * most,
            mistake.description()
        );
        Reason::new("poses_disagree", detail)
    })
}

/// Returns a reason as [`other_convention`] for a clip that lost most of its poses as outliers, by all poses of the frames in
/// `range`: in another unit a camera moves too fast.
pub fn convention_of_dropped(
    clip: &Clip,
    range: Option<&Range<u32>>,
    kept: &Trajectory,
) -> Result<Option<Reason>, ReconstructError> {
    let wanted = |header: &FrameHeader| range.is_none_or(|range| range.contains(&header.number));
    let headers = clip.frames().iter().enumerate().filter(|(_, header)| wanted(header));
    let posed: Vec<(usize, Pose3)> =
        headers.filter_map(|(index, header)| Some((index, header.world_from_camera?))).collect();
    if 2 * kept.world_from_camera.iter().flatten().count() >= posed.len() {
        return Ok(None);
    }
    let stride = posed.len().div_ceil(PAIRS).max(2);
    let chosen: Vec<(usize, Pose3)> =
        posed.chunks_exact(stride).flat_map(|frames| [frames[0], frames[1]]).collect();
    let mut frames = clip.stream(chosen.iter().map(|(index, _)| *index).collect());
    let mut keys = Vec::new();
    for pair in chosen.chunks_exact(2) {
        let decoded: Result<Vec<Frame>, ClipError> = frames.next_batch(2).into_iter().collect();
        match decoded {
            Ok(decoded) => keys.extend(decoded.iter().zip(pair).map(|(frame, (_, world_from_camera))| {
                KeyFrame::first(*world_from_camera, Readings::thin(&frame.depth, frame.depth_camera))
            })),
            Err(error) if error.is_service_fault() => return Err(ReconstructError::Clip(error)),
            // The fusion counts broken frames.
            Err(_) => {}
        }
    }
    Ok(convention(&keys, true))
}

/// Returns the fraction of the readings of `a` that lie where `b` reads a surface.
fn agreeing(a: &KeyFrame, b: &KeyFrame, mended: &dyn Fn(&Pose3) -> Pose3) -> f64 {
    let b_from_a = mended(&b.world_from_camera).inverse() * mended(&a.world_from_camera);
    let camera = b.readings.camera();
    let (mut compared, mut same) = (0, 0);
    for point in a.readings.points_in_camera().filter(|point| point.z < MAX_DEPTH_M).step_by(EVERY) {
        compared += 1;
        let point = b_from_a * point;
        let depth_m = camera.project(&point).and_then(|pixel| b.readings.depth_at(pixel.x, pixel.y));
        same += usize::from(depth_m.is_some_and(|depth_m| (point.z - depth_m).abs() < SAME_SURFACE_M));
    }
    same as f64 / f64::from(compared.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Translation3;
    use viola_formats::clip::DepthImage;
    use viola_geometry::{Pinhole, Point3};

    /// Returns what a camera in a room of 5 x 4 x 2.5 m sees, with a table's side in it.
    fn key_frame(world_from_camera: &Pose3) -> KeyFrame {
        let camera = Pinhole { width: 64, height: 48, fx: 50.0, fy: 50.0, cx: 31.5, cy: 23.5 };
        let from = world_from_camera.translation.vector;
        let depth = |index: u32| {
            let (u, v) = (f64::from(index % 64), f64::from(index / 64));
            let ray = world_from_camera.rotation * camera.unproject(u, v, 1.0).coords;
            let side = |axis: usize, at: f64| {
                let along = (at - from[axis]) / ray[axis];
                if along > 0.0 { along } else { f64::INFINITY }
            };
            let walls = [(0, 0.0), (0, 5.0), (1, 0.0), (1, 4.0), (2, 0.0), (2, 2.5)];
            let wall = walls.into_iter().map(|(axis, at)| side(axis, at)).fold(f64::INFINITY, f64::min);
            let table = side(0, 3.5);
            let at = Point3::from(from + ray * table);
            let is_table = (1.0..2.5).contains(&at.y) && at.z < 0.8;
            (if is_table { table.min(wall) } else { wall }) as f32
        };
        let depth = DepthImage { width: 64, height: 48, depth_m: (0..64 * 48).map(depth).collect() };
        KeyFrame::first(*world_from_camera, Readings::thin(&depth, camera))
    }

    /// Returns key frames of a walk through the room.
    fn walk() -> Vec<KeyFrame> {
        let pose = |step: i32| {
            let turn = 0.12 * f64::from(step);
            let forward = Vector3::new(turn.cos(), turn.sin(), -0.3);
            let rotation = UnitQuaternion::face_towards(&forward, &-Vector3::z());
            let at = Translation3::new(1.2 + 0.08 * f64::from(step), 1.5 + 0.1 * f64::from(step), 1.4);
            Pose3::from_parts(at, rotation)
        };
        (0..12).map(|step| key_frame(&pose(step))).collect()
    }

    /// Checks whether poses with a mistake are told as those without it.
    fn check(mistake: impl Fn(&Pose3) -> Pose3, told: Option<&str>) {
        let posed = |key: KeyFrame| KeyFrame { world_from_camera: mistake(&key.world_from_camera), ..key };
        let keys: Vec<KeyFrame> = walk().into_iter().map(posed).collect();
        let reason = other_convention(&keys);
        let is_told = match (&reason, told) {
            (Some(reason), Some(told)) => reason.code == "poses_disagree" && reason.detail.contains(told),
            (None, None) => true,
            _ => false,
        };
        assert!(is_told, "{told:?} {reason:?}");
    }

    #[test]
    fn frequent_mistakes_are_told() {
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
        let multiplied = |by: f64| {
            move |pose: &Pose3| Pose3::from_parts((pose.translation.vector * by).into(), pose.rotation)
        };
        check(|pose| *pose, None);
        check(Pose3::inverse, Some("camera from world instead"));
        check(|pose| pose * half_turn, Some("are those of a camera that looks along its negative z axis"));
        check(|pose| (pose * half_turn).inverse(), Some("camera from world, of a camera"));
        check(multiplied(1000.0), Some("millimetres"));
        check(multiplied(100.0), Some("centimetres"));
        // Another world is no mistake.
        let other = Pose3::from_parts(
            Translation3::new(30.0, -7.0, 2.0),
            UnitQuaternion::from_euler_angles(1.0, 0.4, -2.0),
        );
        check(|pose| other * pose, None);
    }

    #[test]
    fn depth_in_another_unit_is_no_mistake_of_the_poses() {
        for factor in [0.2, 0.1] {
            let with_small_depth = |key: KeyFrame| {
                let world_from_camera = key.world_from_camera;
                KeyFrame { world_from_camera, ..key.scaled(factor) }
            };
            let keys: Vec<KeyFrame> = walk().into_iter().map(with_small_depth).collect();
            assert_eq!(other_convention(&keys), None, "{factor}");
        }
    }

    #[test]
    fn a_camera_that_stands_still_tells_nothing() {
        let keys = vec![key_frame(&walk()[0].world_from_camera); 5];
        assert_eq!(other_convention(&keys), None);
        assert_eq!(other_convention(&keys[..2]), None);
    }
}
