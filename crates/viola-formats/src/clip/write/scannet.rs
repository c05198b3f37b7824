//! ScanNet's export (ScanNet/ScanNet, SensReader): pictures, poses and intrinsics by frame.

use super::{WriteError, Writer, color_file, depth_units, encode, row};
use crate::clip::Frame;
use viola_geometry::Pinhole;

/// Frames keep their numbers.
#[derive(Default)]
pub(super) struct Scannet {
    cameras: Option<(Pinhole, Pinhole)>,
}

impl Writer for Scannet {
    fn frame(&self, _place: usize, frame: &Frame) -> Result<Vec<(String, Vec<u8>)>, WriteError> {
        let number = frame.header.number;
        let pose = frame.header.world_from_camera.ok_or(WriteError::NoPose)?.to_homogeneous();
        let text: String = pose.row_iter().map(|r| row(&[r[0], r[1], r[2], r[3]], " ")).collect();
        let (width, height) = (frame.depth.width, frame.depth.height);
        let color = color_file(frame, format!("color/{number}.jpg"))?;
        let others = [
            (format!("depth/{number}.png"), encode::grey16_png(width, height, &depth_units(frame, 1000.0))?),
            (format!("pose/{number}.txt"), text.into_bytes()),
        ];
        Ok(color.into_iter().chain(others).collect())
    }

    fn record(&mut self, _place: usize, frame: &Frame) {
        self.cameras.get_or_insert((frame.color_camera, frame.depth_camera));
    }

    fn close(&mut self) -> Vec<(String, Vec<u8>)> {
        let Some((color, depth)) = self.cameras else { return Vec::new() };
        let matrix = |c: &Pinhole| {
            let rows = [[c.fx, 0., c.cx, 0.], [0., c.fy, c.cy, 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]];
            rows.iter().map(|r| row(r, " ")).collect::<String>().into_bytes()
        };
        vec![
            ("intrinsic/intrinsic_color.txt".to_string(), matrix(&color)),
            ("intrinsic/intrinsic_depth.txt".to_string(), matrix(&depth)),
        ]
    }
}
