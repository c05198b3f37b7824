//! Invariants of every clip.

use crate::{clip_files, zip_of};
use std::io::Write;
use viola_formats::clip::Clip;
use viola_formats::container::{self, Container, Zip};

/// Frames checked; a .sens file of 64 KiB can declare more frames without pictures.
const MAX_FRAMES: usize = 16;

/// Reads an input as the files of a target's layout.
pub fn check_layout(target: &str, input: &[u8]) {
    if let Ok(zip) = Zip::from_bytes(zip_of(clip_files::split(target, input))) {
        check_container(Box::new(zip));
    }
}

/// Reads an input as one file: an archive of any layout, or a .sens file.
pub fn check_file(input: &[u8]) {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(input).expect("room for a temporary file");
    if let Ok(container) = container::open(file.path()) {
        check_container(container);
    }
}

/// Opens a clip and loads its frames: metadata must match the frames, and all numbers must be finite.
fn check_container(container: Box<dyn Container>) {
    let Ok(clip) = Clip::from_container(container) else { return };
    let (info, frames) = (clip.info(), clip.frames());
    assert_eq!(info.frames, frames.len());
    assert_eq!(info.frames_with_pose + info.skipped_without_pose, info.frames);
    assert!(info.duration_s.is_none_or(|s| s.is_finite() && s >= 0.0), "{:?}", info.duration_s);
    assert!(clip.up_in_world().is_none_or(|up| (up.direction.norm() - 1.0).abs() < 1e-9));
    for header in frames {
        assert!(header.time_s.is_none_or(f64::is_finite));
        let pose = header.world_from_camera;
        assert!(pose.is_none_or(|pose| pose.to_homogeneous().iter().all(|v| v.is_finite())));
    }
    for index in 0..frames.len().min(MAX_FRAMES) {
        let Ok(frame) = clip.load(index) else { continue };
        let (color, depth) = (&frame.color_camera, &frame.depth_camera);
        assert!(color.is_plausible() && depth.is_plausible(), "{color:?} {depth:?}");
        let size = frame.color.as_ref().map_or((color.width, color.height), |picture| picture.dimensions());
        assert_eq!(size, (color.width, color.height));
        assert_eq!((frame.depth.width, frame.depth.height), (depth.width, depth.height));
        assert_eq!(frame.depth.depth_m.len() as u64, u64::from(depth.width) * u64::from(depth.height));
        assert!(frame.depth.depth_m.iter().all(|d| d.is_finite() && *d >= 0.0));
    }
}
