//! Rectifies pictures of rolling shutters, as if all rows had been taken at once.
//!
//! A camera that turns by 100 degrees a second turns by three degrees between the first row and the last of a
//! Kinect's picture, so a room leans, and leans the other way when the camera turns back. Every row is
//! moved to its pixels in the camera of the middle row (Ringaby and Forssen, "Scan Rectification for
//! Structured Light Range Sensors with Rolling Shutters", 2011), by the motion since the previous frame.

use super::picture::{Layer, Pyramid};
use rayon::prelude::*;
use viola_formats::clip::Shutter;
use viola_geometry::Pose3;

/// Minimum offset of a picture's rows, in pixels; below it, the picture is not rectified.
const MIN_OFFSET_PIXELS: f64 = 0.3;

/// Readout times of a picture, as fractions of the time between two frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rolling {
    depth_fraction: f32,
    grey_fraction: f32,
}

impl Rolling {
    /// Returns the readout times; `None` if the shutter or the frames' times are unknown or implausible.
    pub fn new(shutter: Option<Shutter>, before_s: Option<f64>, now_s: Option<f64>) -> Option<Rolling> {
        let shutter = shutter?;
        let interval_s = now_s? - before_s?;
        let fraction = |readout_s: f64| (readout_s / interval_s) as f32;
        let rolling =
            Rolling { depth_fraction: fraction(shutter.depth_s), grey_fraction: fraction(shutter.color_s) };
        // A readout ends before the next one begins; other times are errors.
        let is_plausible = |fraction: f32| (0.0..1.2).contains(&fraction);
        (is_plausible(rolling.depth_fraction) && is_plausible(rolling.grey_fraction)).then_some(rolling)
    }

    /// Returns the frame as the camera of its middle row sees it; `None` if the difference is negligible.
    /// `motion` takes points from the previous frame's camera to that of this one.
    pub fn rectified(&self, pyramid: &Pyramid, motion: &Pose3) -> Option<Pyramid> {
        let finest = pyramid.finest();
        let fraction = f64::from(self.depth_fraction.max(self.grey_fraction)) / 2.0;
        // For points a metre away.
        let off = motion.rotation.angle() + motion.translation.vector.norm();
        (fraction * off * finest.camera.fx > MIN_OFFSET_PIXELS)
            .then(|| Pyramid::from_layer(self.rectified_layer(finest, motion)))
    }

    fn rectified_layer(&self, layer: &Layer, motion: &Pose3) -> Layer {
        let (width, height) = (layer.width(), layer.height());
        let rows = Rows::new(layer, motion);
        let mut grey = vec![f32::NAN; width * height];
        let mut depth_m = vec![0.0; width * height];
        let lines = grey.par_chunks_mut(width).zip(depth_m.par_chunks_mut(width)).enumerate();
        lines.for_each(|(v, (grey, depth_m))| {
            for u in 0..width {
                // Pixels without depth move as if they were far away.
                let inverse = rows.depth(layer, u, v, self.depth_fraction).unwrap_or(0.0);
                if inverse > 0.0 {
                    depth_m[u] = 1.0 / inverse;
                }
                let [x, y, _] = rows.settled(u, v, inverse, self.grey_fraction);
                grey[u] = between(layer, x, y);
            }
        });
        Layer { camera: layer.camera, grey, depth_m }
    }
}

/// Iterations to find the row of a point, which depends on itself.
const ROUNDS: usize = 2;

/// Maps pixels of the middle row's camera to pixels of the rolling rows.
struct Rows {
    focal: [f32; 2],
    centre: [f32; 2],
    height: f32,
    shift: [f32; 3],
    turn: [f32; 3],
}

impl Rows {
    fn new(layer: &Layer, motion: &Pose3) -> Rows {
        let camera = &layer.camera;
        let (shift, turn) = (motion.translation.vector, motion.rotation.scaled_axis());
        Rows {
            focal: [camera.fx as f32, camera.fy as f32],
            centre: [camera.cx as f32, camera.cy as f32],
            height: layer.height() as f32,
            shift: std::array::from_fn(|i| shift[i] as f32),
            turn: std::array::from_fn(|i| turn[i] as f32),
        }
    }

    /// Returns the pixel where row `row` sees a point of this inverse depth, and the ratio of its depth there
    /// to that here.
    fn seen(&self, u: usize, v: usize, inverse: f32, row: f32, fraction: f32) -> [f32; 3] {
        let late = fraction * (row / self.height - 0.5);
        let x = (u as f32 - self.centre[0]) / self.focal[0];
        let y = (v as f32 - self.centre[1]) / self.focal[1];
        let ([tx, ty, tz], [rx, ry, rz]) = (self.shift, self.turn);
        let z = 1.0 + late * (rx * y - ry * x + tz * inverse);
        let right = (x + late * (ry - rz * y + tx * inverse)) / z;
        let down = (y + late * (rz * x - rx + ty * inverse)) / z;
        [self.focal[0] * right + self.centre[0], self.focal[1] * down + self.centre[1], z]
    }

    fn settled(&self, u: usize, v: usize, inverse: f32, fraction: f32) -> [f32; 3] {
        (0..ROUNDS).fold([0.0, v as f32, 1.0], |[_, row, _], _| self.seen(u, v, inverse, row, fraction))
    }

    /// Returns the inverse depth at a pixel of the middle row's camera; `None` without a reading.
    fn depth(&self, layer: &Layer, u: usize, v: usize, fraction: f32) -> Option<f32> {
        let (width, height) = (layer.width(), layer.height());
        let here_m = layer.depth_m[v * width + u];
        let mut inverse = if here_m > 0.0 { 1.0 / here_m } else { 0.0 };
        let mut row = v as f32;
        let mut found = None;
        for _ in 0..ROUNDS {
            let [x, y, z] = self.seen(u, v, inverse, row, fraction);
            let (column, line) = (x.round(), y.round());
            let is_inside = column >= 0.0 && line >= 0.0 && column < width as f32 && line < height as f32;
            let depth_m =
                if is_inside { layer.depth_m[line as usize * width + column as usize] } else { 0.0 };
            found = (depth_m > 0.0).then(|| z / depth_m);
            inverse = found.unwrap_or(inverse);
            row = y;
        }
        found
    }
}

/// Returns the grey, interpolated between pixels; NaN outside.
fn between(layer: &Layer, x: f32, y: f32) -> f32 {
    let (width, height) = (layer.width(), layer.height());
    if !(x >= 0.0 && y >= 0.0 && x <= width as f32 - 1.0 && y <= height as f32 - 1.0) {
        return f32::NAN;
    }
    let (left, top) = ((x as usize).min(width - 2), (y as usize).min(height - 2));
    let (right, down) = (x - left as f32, y - top as f32);
    let first = top * width + left;
    let row = |first: usize| layer.grey[first] + right * (layer.grey[first + 1] - layer.grey[first]);
    row(first) + down * (row(first + width) - row(first))
}
