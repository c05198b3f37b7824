//! RTAB-Map's model of a camera: eleven numbers of 32 bits (version, kind, size, lengths), matrices of doubles, and the
//! camera's pose on its base as floats (introlab/rtabmap, CameraModel.cpp, `serialize`).

use super::super::text::pose_from_rows;
use super::super::{Numbers, Of, body_from_optical};
use viola_geometry::Pose3;

const HEADER_BYTES: usize = 44;
/// Doubles of the longest lens model, and of each matrix.
const MAX_DOUBLES: i32 = 16;

pub(super) struct Camera {
    pub numbers: Numbers,
    /// From OpenCV's axes to the base's: x ahead, z up.
    pub base_from_camera: Pose3,
    pub is_distorted: bool,
}

impl Camera {
    /// Maximum bytes of the models of a recording with several cameras.
    pub const MAX_BYTES: u64 = 16 << 10;

    /// Parses the model of one camera, or returns the reason why it cannot be used.
    pub fn parse(bytes: &[u8]) -> Result<Camera, String> {
        let (header, rest) = bytes.split_at_checked(HEADER_BYTES).ok_or(
            "it is not a camera's model of RTAB-Map 0.18 or later; open the database there and save it again",
        )?;
        let header: Vec<i32> =
            header.as_chunks().0.iter().map(|number| i32::from_le_bytes(*number)).collect();
        let &[_, _, _, kind, width, height, k, d, r, p, local] = header.as_slice() else {
            return Err("its header is cut".into());
        };
        if kind != 0 {
            return Err("it is a stereo camera; only cameras with depth are read".into());
        }
        let is_possible = matches!(k, 0 | 9)
            && (k == 9 || p == 12)
            && [d, r, p].iter().all(|n| (0..=MAX_DOUBLES).contains(n))
            && matches!(local, 0 | 12);
        if !is_possible {
            return Err(format!("its matrices cannot have {k}, {d}, {r}, {p} and {local} numbers"));
        }
        let (doubles, floats) = rest.split_at_checked((k + d + r + p) as usize * 8).ok_or("it is cut")?;
        let doubles: Vec<f64> =
            doubles.as_chunks().0.iter().map(|value| f64::from_le_bytes(*value)).collect();
        let (floats, others) = floats.split_at_checked(local as usize * 4).ok_or("it is cut")?;
        if !others.is_empty() {
            return Err("the recording has several cameras; record with one".into());
        }
        let of = match (u32::try_from(width), u32::try_from(height)) {
            (Ok(width), Ok(height)) if width > 0 && height > 0 => Of::Size(width, height),
            _ => Of::Color,
        };
        // With a projection matrix P the stored pictures are those of P, without distortion.
        let (k, d, r, p) = (k as usize, d as usize, r as usize, p as usize);
        let rectified = doubles[k + d + r..].first_chunk::<12>().filter(|m| p == 12 && m[0] > 0.0);
        let numbers = match (rectified, doubles.first_chunk::<9>()) {
            (Some(m), _) => Numbers { fx: m[0], fy: m[5], cx: m[2], cy: m[6], of },
            (None, Some(m)) if k == 9 => Numbers { fx: m[0], fy: m[4], cx: m[2], cy: m[5], of },
            _ => return Err("it has no focal length".into()),
        };
        let rows: Vec<f64> =
            floats.as_chunks().0.iter().map(|value| f64::from(f32::from_le_bytes(*value))).collect();
        let base_from_camera = if local == 0 {
            body_from_optical()
        } else {
            pose_from_rows(&rows).ok_or("its pose on the device is not a rigid motion")?
        };
        let is_distorted = rectified.is_none() && doubles[k..k + d].iter().any(|value| *value != 0.0);
        Ok(Camera { numbers, base_from_camera, is_distorted })
    }
}
