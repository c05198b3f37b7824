//! Stray Scanner (strayrobots/scanner, docs/format.md), with colour as pictures in `rgb/`, from which an
//! external encoder can make the video.

use super::{WriteError, Writer, color_file, depth_units, encode, row};
use crate::clip::Frame;
use viola_geometry::Pinhole;

/// Frames are renumbered.
#[derive(Default)]
pub(super) struct Stray {
    /// The last frame's depth camera at the colour's size, as the app writes it.
    camera: Option<Pinhole>,
    odometry: String,
}

impl Writer for Stray {
    fn frame(&self, place: usize, frame: &Frame) -> Result<Vec<(String, Vec<u8>)>, WriteError> {
        let (width, height) = (frame.depth.width, frame.depth.height);
        // Readings of low confidence are dropped when a clip is read; the others are trusted.
        let trust: Vec<u8> =
            frame.depth.depth_m.iter().map(|depth_m| if *depth_m > 0.0 { 2 } else { 0 }).collect();
        let color = color_file(frame, format!("rgb/{place:06}.jpg"))?;
        let others = [
            (
                format!("depth/{place:06}.png"),
                encode::grey16_png(width, height, &depth_units(frame, 1000.0))?,
            ),
            (format!("confidence/{place:06}.png"), encode::grey8_png(width, height, &trust)?),
        ];
        Ok(color.into_iter().chain(others).collect())
    }

    fn record(&mut self, place: usize, frame: &Frame) {
        let size = frame.color.as_ref().map(|color| color.dimensions());
        let (width, height) = size.unwrap_or((frame.depth.width, frame.depth.height));
        self.camera = Some(frame.depth_camera.resized(width, height));
        let Some(pose) = frame.header.world_from_camera else { return };
        let (t, q) = (pose.translation.vector, pose.rotation);
        let time_s = frame.header.time_s.unwrap_or_default();
        let numbers = row(&[t.x, t.y, t.z, q.i, q.j, q.k, q.w], ", ");
        self.odometry += &format!("{time_s:.6}, {place:06}, {numbers}");
    }

    fn close(&mut self) -> Vec<(String, Vec<u8>)> {
        let Some(c) = self.camera else { return Vec::new() };
        let rows = [[c.fx, 0.0, c.cx], [0.0, c.fy, c.cy], [0.0, 0.0, 1.0]];
        let matrix: String = rows.iter().map(|r| row(r, ", ")).collect();
        let odometry = format!("timestamp, frame, x, y, z, qx, qy, qz, qw\n{}", self.odometry);
        vec![
            ("camera_matrix.csv".to_string(), matrix.into_bytes()),
            ("odometry.csv".to_string(), odometry.into_bytes()),
        ]
    }
}
