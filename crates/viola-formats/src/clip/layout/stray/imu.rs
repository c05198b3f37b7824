//! Check of the world's up axis by the accelerometer.

use crate::clip::ClipError;
use crate::clip::layout::text::{parse_row, read_table};
use crate::clip::layout::trajectory::{Timed, nearest};
use crate::container::Container;
use viola_geometry::{Pose3, Vector3};

/// Maximum time between a frame and its sample.
const MAX_GAP_S: f64 = 0.03;
/// Above this angle the file and the layout contradict each other.
const MAX_ANGLE_DEG: f64 = 15.0;

/// Compares gravity in `imu.csv` with the world's y and returns the result in words. Unit and sign do not
/// matter: the documentation says m/s2, but the app writes g.
pub(super) fn compare(
    container: &dyn Container,
    name: &str,
    poses: impl Iterator<Item = (f64, Pose3)>,
) -> Result<String, ClipError> {
    let mut samples: Vec<Timed<Vector3>> = Vec::new();
    for (_, text) in read_table(container, name)?.rows() {
        // The columns' names and truncated rows are skipped.
        let Some([time_s, ax, ay, az, ..]) = parse_row::<7>(text) else { continue };
        let acceleration = Vector3::new(ax, ay, az);
        if time_s.is_finite() && acceleration.norm().is_finite() && acceleration.norm() > 1e-6 {
            samples.push(Timed { time_s, value: acceleration.normalize() });
        }
    }
    samples.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let mut sum_in_world = Vector3::zeros();
    let mut frames = 0;
    for (time_s, world_from_camera) in poses {
        let sample = nearest(&samples, time_s).filter(|sample| sample.gap_s(time_s) < MAX_GAP_S);
        let Some(Timed { value: a, .. }) = sample else { continue };
        // Converts the device's axes (x right, y up, z out of the screen, held upright) to the camera's,
        // which records with the device on its side.
        let in_camera = Vector3::new(-a.y, -a.x, -a.z);
        sum_in_world += world_from_camera.rotation * in_camera;
        frames += 1;
    }
    if frames == 0 || sum_in_world.norm() < 0.5 * f64::from(frames) {
        return Ok("imu.csv does not tell gravity; the layout's world was taken as upright".to_string());
    }
    let angle_deg = sum_in_world.normalize().y.abs().min(1.0).acos().to_degrees();
    Ok(if angle_deg <= MAX_ANGLE_DEG {
        format!("gravity by imu.csv is {angle_deg:.1} degrees from the world's y, which agrees")
    } else {
        format!(
            "gravity by imu.csv is {angle_deg:.1} degrees from the world's y; the layout was believed, which has y up"
        )
    })
}
