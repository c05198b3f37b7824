//! Data kept of each fused frame.

use crate::tsdf::{MAX_DEPTH_M, MIN_DEPTH_M};
use viola_formats::clip::DepthImage;
use viola_geometry::{Pinhole, Point3, Pose3};

/// A frame that was fused.
#[derive(Debug, Clone)]
pub struct KeyFrame {
    /// Index of the frame in the clip.
    pub index: usize,
    pub number: u32,
    pub world_from_camera: Pose3,
    /// Sharpness of its colour picture, comparable within one clip.
    pub sharpness: f32,
    /// Subset of its depth readings, enough to derive the free space that the camera saw.
    pub readings: Readings,
}

/// Pose and readings of a key frame, in the clip frame.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    pub clip_from_camera: Pose3,
    pub readings: Readings,
}

impl View {
    /// Returns the memory that it takes.
    pub fn size_bytes(&self) -> usize {
        size_of::<View>() + size_of_val(self.readings.depth_mm.as_slice())
    }
}

/// A subsampled depth picture: a few thousand readings, because every key frame keeps one.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    camera: Pinhole,
    width: u16,
    /// In millimetres, row by row; 0 if there is no reading.
    depth_mm: Vec<u16>,
    stride: u16,
}

/// Readings of a row, and maximum readings of a column, which bounds pictures more than three times as high as wide.
const COLUMNS: u32 = 64;
const MAX_ROWS: u32 = 192;

/// Returns the first subsampled pixel along a side of the picture; the middle one of a side shorter than the stride.
fn first(stride: u32, side: u32) -> u32 {
    stride.min(side) / 2
}

impl Readings {
    /// Subsamples a depth picture to about 64 readings a row.
    pub fn thin(depth: &DepthImage, camera: Pinhole) -> Readings {
        let stride = depth.width.div_ceil(COLUMNS).max(depth.height.div_ceil(MAX_ROWS));
        let stride = stride.clamp(1, u32::from(u16::MAX));
        let (left, top) = (first(stride, depth.width), first(stride, depth.height));
        let mut depth_mm = Vec::new();
        let mut width = 0;
        for y in (top..depth.height).step_by(stride as usize) {
            width = 0;
            for x in (left..depth.width).step_by(stride as usize) {
                let depth_m = depth.at(x, y);
                let known = (MIN_DEPTH_M..=MAX_DEPTH_M).contains(&depth_m);
                depth_mm.push(if known { (depth_m * 1000.0) as u16 } else { 0 });
                width += 1;
            }
        }
        Readings { camera, width, depth_mm, stride: stride as u16 }
    }

    /// Returns readings from their parts; `None` if the parts are inconsistent.
    pub fn new(camera: Pinhole, width: u16, stride: u16, depth_mm: Vec<u16>) -> Option<Readings> {
        let rows_fit = width > 0 && depth_mm.len().is_multiple_of(usize::from(width));
        (camera.is_plausible() && stride > 0 && rows_fit).then_some(Readings {
            camera,
            width,
            depth_mm,
            stride,
        })
    }

    /// Returns the readings with depth multiplied by `factor`.
    fn scaled(mut self, factor: f64) -> Readings {
        self.depth_mm.iter_mut().for_each(|mm| *mm = (f64::from(*mm) * factor) as u16);
        self
    }

    pub fn width(&self) -> u16 {
        self.width
    }

    /// Returns the distance between two readings, in pixels of the camera's picture.
    pub fn stride(&self) -> u16 {
        self.stride
    }

    /// Returns the depths in millimetres, row by row; 0 if there is no reading.
    pub fn depth_mm(&self) -> &[u16] {
        &self.depth_mm
    }

    /// Returns the depth measured at a pixel, in metres; `None` if there is no reading.
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

    /// Returns the measured points, in the camera frame.
    pub fn points_in_camera(&self) -> impl Iterator<Item = Point3> + '_ {
        let stride = u32::from(self.stride);
        let (left, top) = (first(stride, self.camera.width), first(stride, self.camera.height));
        self.depth_mm.iter().enumerate().filter(|(_, mm)| **mm > 0).map(move |(i, &mm)| {
            let (x, y) = (i % usize::from(self.width), i / usize::from(self.width));
            let pixel = |at: usize, first: u32| at as f64 * f64::from(stride) + f64::from(first);
            self.camera.unproject(pixel(x, left), pixel(y, top), f64::from(mm) / 1000.0)
        })
    }
}

impl KeyFrame {
    /// Returns the key frame with position and depth multiplied by `factor`.
    pub fn scaled(mut self, factor: f64) -> KeyFrame {
        self.world_from_camera.translation.vector *= factor;
        self.readings = self.readings.scaled(factor);
        self
    }

    /// Returns a key frame with these readings, the first of its clip.
    pub fn first(world_from_camera: Pose3, readings: Readings) -> KeyFrame {
        KeyFrame { index: 0, number: 0, world_from_camera, sharpness: 0.0, readings }
    }

    /// Returns a key frame without readings.
    pub fn blind(world_from_camera: Pose3) -> KeyFrame {
        let camera = Pinhole { width: 4, height: 3, fx: 4.0, fy: 4.0, cx: 1.5, cy: 1.0 };
        let readings = Readings { camera, width: 4, depth_mm: Vec::new(), stride: 1 };
        KeyFrame::first(world_from_camera, readings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the readings of a picture that reads 2 m everywhere.
    fn thinned(width: u32, height: u32) -> Readings {
        let focal = f64::from(width.max(height));
        let middle = |side: u32| f64::from(side) / 2.0 - 0.5;
        let camera = Pinhole { width, height, fx: focal, fy: focal, cx: middle(width), cy: middle(height) };
        let depth_m = vec![2.0; width as usize * height as usize];
        Readings::thin(&DepthImage { width, height, depth_m }, camera)
    }

    /// A line of a laser scanner is a picture, too.
    #[test]
    fn pictures_of_any_shape_have_a_few_thousand_readings() {
        for (width, height) in
            [(640, 480), (192, 256), (2_048, 16), (16, 2_048), (1 << 22, 1), (1, 1 << 22), (1, 1)]
        {
            let readings = thinned(width, height);
            let count = readings.points_in_camera().count();
            assert!((1..=65 * 193).contains(&count), "{width} x {height}: {count}");
            for point in readings.points_in_camera() {
                let pixel = readings.camera().project(&point).unwrap();
                assert_eq!(readings.depth_at(pixel.x.round(), pixel.y.round()), Some(2.0));
            }
            // A file of them is read.
            let Readings { camera, width, depth_mm, stride } = readings.clone();
            assert_eq!(Readings::new(camera, width, stride, depth_mm), Some(readings));
        }
    }

    #[test]
    fn pictures_of_phones_have_64_readings_a_row() {
        for (size, stride) in [((640, 480), 10), ((480, 640), 8), ((256, 192), 4), ((192, 256), 3)] {
            let readings = thinned(size.0, size.1);
            assert_eq!((readings.stride(), readings.depth_at(0.0, 0.0)), (stride, Some(2.0)), "{size:?}");
            assert!((60..=64).contains(&readings.width()), "{size:?}");
        }
    }
}
