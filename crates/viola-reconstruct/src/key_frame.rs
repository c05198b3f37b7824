//! What is kept of a fused frame.

use crate::tsdf::MAX_DEPTH_M;
use crate::tsdf::MIN_DEPTH_M;
use viola_formats::clip::DepthImage;
use viola_geometry::{Pinhole, Point3, Pose3};

/// A frame that was fused.
#[derive(Debug, Clone)]
pub struct KeyFrame {
    /// Its place in the clip.
    pub index: usize,
    pub number: u32,
    pub world_from_camera: Pose3,
    /// How sharp its colour picture is, to compare it with others of the clip.
    pub sharpness: f32,
    /// Some of its readings, as points in the camera frame: enough to know what the camera saw through.
    pub readings: Readings,
}

/// What a key frame saw, as the clip's other answers have it.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    pub clip_from_camera: Pose3,
    pub readings: Readings,
}

/// A thinned depth picture: a few thousand numbers, because every key frame keeps one.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    camera: Pinhole,
    width: u16,
    /// Millimetres, row after row; 0 where there is none.
    depth_mm: Vec<u16>,
    stride: u16,
}

impl Readings {
    /// Every so many-th reading of a depth picture, about 64 in a row.
    pub fn thin(depth: &DepthImage, camera: Pinhole) -> Readings {
        let stride = (depth.width / 64).max(1);
        let mut depth_mm = Vec::new();
        let mut width = 0;
        for y in (stride / 2..depth.height).step_by(stride as usize) {
            width = 0;
            for x in (stride / 2..depth.width).step_by(stride as usize) {
                let depth_m = depth.at(x, y);
                let known = (MIN_DEPTH_M..=MAX_DEPTH_M).contains(&depth_m);
                depth_mm.push(if known { (depth_m * 1000.0) as u16 } else { 0 });
                width += 1;
            }
        }
        Readings { camera, width, depth_mm, stride: stride as u16 }
    }

    /// Readings from their parts, none when these do not belong together.
    pub fn new(camera: Pinhole, width: u16, stride: u16, depth_mm: Vec<u16>) -> Option<Readings> {
        let rows_fit = width > 0 && depth_mm.len().is_multiple_of(usize::from(width));
        (camera.is_plausible() && stride > 0 && rows_fit).then_some(Readings {
            camera,
            width,
            depth_mm,
            stride,
        })
    }

    pub fn width(&self) -> u16 {
        self.width
    }

    /// Pixels of the camera's picture from one reading to the next.
    pub fn stride(&self) -> u16 {
        self.stride
    }

    /// Millimetres, row after row; 0 where there is none.
    pub fn depth_mm(&self) -> &[u16] {
        &self.depth_mm
    }

    /// The depth measured at a place of the picture, in metres; none where nothing was measured.
    pub fn depth_at(&self, u: f64, v: f64) -> Option<f64> {
        if u < 0.0 || v < 0.0 || u >= f64::from(self.camera.width) || v >= f64::from(self.camera.height) {
            return None;
        }
        let (x, y) = (u as usize / usize::from(self.stride), v as usize / usize::from(self.stride));
        let at = y * usize::from(self.width) + x.min(usize::from(self.width) - 1);
        self.depth_mm.get(at).filter(|mm| **mm > 0).map(|mm| f64::from(*mm) / 1000.0)
    }

    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// What was hit, in the camera frame.
    pub fn points_in_camera(&self) -> impl Iterator<Item = Point3> + '_ {
        let first = self.stride / 2;
        self.depth_mm.iter().enumerate().filter(|(_, mm)| **mm > 0).map(move |(i, &mm)| {
            let (x, y) = (i % usize::from(self.width), i / usize::from(self.width));
            let pixel = |at: usize| at as f64 * f64::from(self.stride) + f64::from(first);
            self.camera.unproject(pixel(x), pixel(y), f64::from(mm) / 1000.0)
        })
    }
}

impl KeyFrame {
    /// A key frame with these readings, the first of its clip.
    pub fn first(world_from_camera: Pose3, readings: Readings) -> KeyFrame {
        KeyFrame { index: 0, number: 0, world_from_camera, sharpness: 0.0, readings }
    }

    /// A key frame that read nothing.
    pub fn blind(world_from_camera: Pose3) -> KeyFrame {
        let camera = Pinhole { width: 4, height: 3, fx: 4.0, fy: 4.0, cx: 1.5, cy: 1.0 };
        let readings = Readings { camera, width: 4, depth_mm: Vec::new(), stride: 1 };
        KeyFrame::first(world_from_camera, readings)
    }
}
