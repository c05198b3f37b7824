//! Record3D's `.r3d`: a zip of `metadata` (JSON) and `rgbd/N.{jpg,depth,conf}`, depth and confidence as LZFSE
//! (marek-simonik/record3d, issues 7, 24, 27, 43, 81, 83, 93, 99 and 108).

use super::json::{first_frames, read_json};
use super::numbered::number;
use super::text::pose_from_quaternion;
use super::{
    Cameras, ClipError, ColorAt, DepthAt, Intrinsics, Layout, Numbers, OPENGL, Of, Source, only_root,
    with_opencv_axes,
};
use crate::container::Container;
use nalgebra::Quaternion;
use serde::Deserialize;
use std::collections::BTreeMap;
use viola_geometry::{Pose3, Vector3};

/// 100 000 poses of seven long numbers.
const MAX_METADATA_BYTES: u64 = 48 << 20;
/// Maximum relative change of a frame's intrinsics from the first frame's: the lens moves to stabilise.
const MAX_DRIFT: f64 = 0.1;

/// Contents of `metadata`; only newer versions of the app write all of it, and some write `null` instead.
#[derive(Deserialize)]
struct Metadata {
    w: u32,
    h: u32,
    dw: Option<u32>,
    dh: Option<u32>,
    /// 3x3, column-major.
    #[serde(rename = "K")]
    intrinsics: [f64; 9],
    fps: Option<f64>,
    /// qx qy qz qw tx ty tz
    #[serde(default, deserialize_with = "first_frames")]
    poses: Vec<[f64; 7]>,
    #[serde(rename = "frameTimestamps", default, deserialize_with = "first_frames")]
    times_s: Vec<f64>,
    #[serde(rename = "perFrameIntrinsicCoeffs", default, deserialize_with = "first_frames")]
    own_intrinsics: Vec<[f64; 4]>,
}

/// Finds the recording in a container; returns `None` if there is none.
pub(super) fn find(container: &dyn Container) -> Result<Option<Layout>, ClipError> {
    let files = || {
        container.names().iter().filter_map(|name| {
            let (root, file) = name.rsplit_once("rgbd/")?;
            let (stem, extension) = file.split_once('.')?;
            (root.is_empty() || root.ends_with('/')).then_some((root, number(stem)?, extension, name))
        })
    };
    let has_metadata = |root: &&str| container.contains(&format!("{root}metadata"));
    let Some(root) = only_root(files().map(|(root, ..)| root).filter(has_metadata))? else { return Ok(None) };
    let by_number = |wanted: &str| -> BTreeMap<u32, &String> {
        let own =
            files().filter(|(of, _, extension, _)| *of == root && extension.eq_ignore_ascii_case(wanted));
        own.map(|(_, number, _, name)| (number, name)).collect()
    };
    let [color, depth, confidence] = ["jpg", "depth", "conf"].map(by_number);
    let name = format!("{root}metadata");
    let metadata: Metadata = read_json(container, &name, MAX_METADATA_BYTES)?;

    let mut notes = Vec::new();
    let [fx, _, _, _, fy, _, cx, cy, _] = metadata.intrinsics;
    let of = Of::Size(metadata.w, metadata.h);
    let shared = Numbers { fx, fy, cx, cy, of };
    let own_numbers = |&[fx, fy, cx, cy]: &[f64; 4]| Numbers { fx, fy, cx, cy, of };
    let own_are_plausible =
        metadata.own_intrinsics.iter().all(|own| own_numbers(own).is_near(&shared, MAX_DRIFT));
    if !own_are_plausible {
        notes.push("perFrameIntrinsicCoeffs are not [fx, fy, cx, cy] near K; K was used".to_string());
    }
    let depth_size = match (metadata.dw, metadata.dh) {
        (Some(width), Some(height)) => Some((width, height)),
        _ => {
            notes.push("metadata has no dw and dh: the depth's size was told from its length".to_string());
            None
        }
    };
    let is_wide = metadata.w > metadata.h;
    let fps = metadata.fps.filter(|fps| fps.is_finite() && *fps > 0.0);
    let mut sources = Vec::new();
    for (&number, &color) in &color {
        let Some(depth) = depth.get(&number) else { continue };
        let at = number as usize;
        let counted_s = || fps.map(|fps| f64::from(number) / fps);
        let own = metadata.own_intrinsics.get(at).filter(|_| own_are_plausible);
        sources.push(Source {
            number,
            time_s: metadata.times_s.get(at).copied().filter(|t| t.is_finite()).or_else(counted_s),
            world_from_camera: metadata.poses.get(at).and_then(pose).map(with_opencv_axes),
            color: ColorAt::File(color.clone()),
            depth: DepthAt::Floats { name: depth.to_string(), size: depth_size, is_wide },
            confidence: confidence.get(&number).map(|name| name.to_string()),
            numbers: own.map(own_numbers),
        });
    }
    let incomplete = color.len() + depth.len() - 2 * sources.len();
    let intrinsics = if metadata.own_intrinsics.is_empty() || !own_are_plausible {
        "metadata, K (of the first frame); depth is scaled to it"
    } else {
        "metadata, perFrameIntrinsicCoeffs as [fx, fy, cx, cy]; depth is scaled to them"
    };
    Ok(Some(Layout {
        pose_convention: OPENGL,
        pose_files: "metadata, poses",
        depth_unit: "metres (LZFSE of 32-bit floats)",
        depth_units_per_m: 1.0,
        gravity: "unknown: the world is that of the first camera".to_string(),
        color_pictures: color.len(),
        depth_pictures: depth.len(),
        incomplete,
        intrinsics: intrinsics.to_string(),
        notes,
        ..Layout::new("record3d", Cameras::One(Intrinsics { name, numbers: shared }), sources)
    }))
}

fn pose(&[qx, qy, qz, qw, tx, ty, tz]: &[f64; 7]) -> Option<Pose3> {
    pose_from_quaternion(Quaternion::new(qw, qx, qy, qz), Vector3::new(tx, ty, tz))
}
