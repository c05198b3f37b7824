//! TUM RGB-D (Sturm et al., 2012): lists of pictures by time, 5000 units of depth per metre. The intrinsics
//! are in `camera-intrinsics.txt`; the data set itself gives them only on its pages.

use super::{WriteError, Writer, color_file, depth_units, encode, row};
use crate::clip::Frame;
use viola_geometry::Pinhole;

#[derive(Default)]
pub(super) struct Tum {
    camera: Option<Pinhole>,
    color: String,
    depth: String,
    poses: String,
}

fn time(frame: &Frame) -> String {
    format!("{:.6}", frame.header.time_s.unwrap_or_default())
}

impl Writer for Tum {
    fn frame(&self, _place: usize, frame: &Frame) -> Result<Vec<(String, Vec<u8>)>, WriteError> {
        let time = time(frame);
        let (width, height) = (frame.depth.width, frame.depth.height);
        let depth = encode::grey16_png(width, height, &depth_units(frame, 5000.0))?;
        let color = color_file(frame, format!("rgb/{time}.jpg"))?;
        Ok(color.into_iter().chain([(format!("depth/{time}.png"), depth)]).collect())
    }

    fn record(&mut self, _place: usize, frame: &Frame) {
        self.camera.get_or_insert(frame.depth_camera);
        let time = time(frame);
        if frame.color.is_some() {
            self.color += &format!("{time} rgb/{time}.jpg\n");
        }
        self.depth += &format!("{time} depth/{time}.png\n");
        if let Some(pose) = frame.header.world_from_camera {
            let (t, q) = (pose.translation.vector, pose.rotation);
            self.poses += &format!("{time} {}", row(&[t.x, t.y, t.z, q.i, q.j, q.k, q.w], " "));
        }
    }

    fn close(&mut self) -> Vec<(String, Vec<u8>)> {
        let Some(c) = self.camera else { return Vec::new() };
        let rows = [[c.fx, 0.0, c.cx], [0.0, c.fy, c.cy], [0.0, 0.0, 1.0]];
        let intrinsics: String = rows.iter().map(|r| row(r, " ")).collect();
        let list = |what: &str, text: &str| format!("# {what}\n{text}");
        [
            ("rgb.txt", list("timestamp filename", &self.color)),
            ("depth.txt", list("timestamp filename", &self.depth)),
            ("groundtruth.txt", list("timestamp tx ty tz qx qy qz qw", &self.poses)),
            ("camera-intrinsics.txt", intrinsics),
        ]
        .map(|(name, text)| (name.to_string(), text.into_bytes()))
        .into()
    }
}
