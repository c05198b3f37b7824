//! Description of a patch by histograms of gradients (Lowe, 2004), normalised by Hellinger's kernel (Arandjelovic
//! and Zisserman, 2012).

use super::corners::Smooth;
use super::patch::{Patch, SIDE_M};
use viola_geometry::{Pose3, Vector3};

/// Samples along a side of the patch, cells along a side, and directions of each cell.
const SAMPLES: usize = 16;
const CELLS: usize = 4;
const DIRECTIONS: usize = 8;
pub const DESCRIPTOR_BYTES: usize = CELLS * CELLS * DIRECTIONS;
/// Length of a description as a vector of bytes.
const LENGTH: f32 = 400.0;
/// Minimum mean gradient between neighbouring samples: less is noise.
const MIN_GRADIENT: f32 = 0.004;
/// Side of the sampled square: one more sample at each edge, for the gradients.
const WIDE: usize = SAMPLES + 2;

/// Description of a patch: a vector of a fixed length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Descriptor(pub [u8; DESCRIPTOR_BYTES]);

impl Descriptor {
    /// Returns the cosine between two descriptions.
    pub fn similarity(&self, other: &Descriptor) -> f32 {
        let product: u32 =
            self.0.iter().zip(&other.0).map(|(a, b)| u32::from(u16::from(*a) * u16::from(*b))).sum();
        product as f32 / (LENGTH * LENGTH)
    }
}

/// Returns the description of a patch; none if the picture does not show all of it, or nothing on it.
pub(super) fn describe(layers: &[Smooth], camera_from_clip: &Pose3, patch: &Patch) -> Option<Descriptor> {
    let grey = sampled(layers, camera_from_clip, patch)?;
    let mut histogram = [0f32; DESCRIPTOR_BYTES];
    let mut total = 0.0;
    for row in 0..SAMPLES {
        for column in 0..SAMPLES {
            let at = (row + 1) * WIDE + column + 1;
            let (dx, dy) = (grey[at + 1] - grey[at - 1], grey[at + WIDE] - grey[at - WIDE]);
            let size = dx.hypot(dy);
            total += size;
            add(&mut histogram, [column, row], size, dy.atan2(dx));
        }
    }
    if total < 2.0 * MIN_GRADIENT * (SAMPLES * SAMPLES) as f32 {
        return None;
    }
    let sum: f32 = histogram.iter().sum();
    Some(Descriptor(histogram.map(|value| ((value / sum).sqrt() * LENGTH).round().min(255.0) as u8)))
}

/// Adds a gradient to the nearest cells and directions.
fn add(histogram: &mut [f32; DESCRIPTOR_BYTES], sample: [usize; 2], size: f32, angle_rad: f32) {
    let middle = (SAMPLES as f32 - 1.0) / 2.0;
    let squared: f32 = sample.iter().map(|c| ((*c as f32 - middle) / (SAMPLES as f32 / 2.0)).powi(2)).sum();
    let size = size * (-0.5 * squared).exp();
    let turn = (angle_rad / std::f32::consts::TAU).rem_euclid(1.0) * DIRECTIONS as f32;
    let place = sample.map(|c| (c as f32 + 0.5) * CELLS as f32 / SAMPLES as f32 - 0.5);
    let [left, top] = place.map(f32::floor);
    for (row, fraction_y) in [(top, 1.0 - (place[1] - top)), (top + 1.0, place[1] - top)] {
        for (column, fraction_x) in [(left, 1.0 - (place[0] - left)), (left + 1.0, place[0] - left)] {
            let inside = |c: f32| (0.0..CELLS as f32).contains(&c);
            if !inside(row) || !inside(column) {
                continue;
            }
            let first = (row as usize * CELLS + column as usize) * DIRECTIONS;
            let (low, fraction) = (turn.floor(), turn - turn.floor());
            let low = low as usize % DIRECTIONS;
            histogram[first + low] += size * fraction_x * fraction_y * (1.0 - fraction);
            histogram[first + (low + 1) % DIRECTIONS] += size * fraction_x * fraction_y * fraction;
        }
    }
}

/// Returns the grey of the patch's samples, row by row from below.
fn sampled(layers: &[Smooth], camera_from_clip: &Pose3, patch: &Patch) -> Option<[f32; WIDE * WIDE]> {
    let step_m = SIDE_M / SAMPLES as f64;
    let centre = camera_from_clip * patch.centre;
    let [right, up] = [patch.right, patch.up].map(|side| camera_from_clip * side * step_m);
    // Of the layers, the coarsest whose pixels are no larger than the samples.
    let pixels = layers[0].camera.fx * step_m / centre.z;
    let level = (pixels.log2().floor().max(0.0) as usize).min(layers.len() - 1);
    let layer = &layers[level];
    let (width, height) = (layer.camera.width as usize, layer.camera.height as usize);
    let first = centre.coords - (right + up) * ((WIDE - 1) as f64 / 2.0);
    let mut grey = [0.0; WIDE * WIDE];
    for (at, value) in grey.iter_mut().enumerate() {
        let point: Vector3 = first + right * (at % WIDE) as f64 + up * (at / WIDE) as f64;
        if point.z < 0.1 {
            return None;
        }
        let u = (layer.camera.fx * point.x / point.z + layer.camera.cx) as f32;
        let v = (layer.camera.fy * point.y / point.z + layer.camera.cy) as f32;
        if u < 0.0 || v < 0.0 || u >= (width - 1) as f32 || v >= (height - 1) as f32 {
            return None;
        }
        let (x, y) = (u as usize, v as usize);
        let (dx, dy) = (u - x as f32, v - y as f32);
        let pixel = |x: usize, y: usize| layer.grey[y * width + x];
        let top = pixel(x, y) * (1.0 - dx) + pixel(x + 1, y) * dx;
        let bottom = pixel(x, y + 1) * (1.0 - dx) + pixel(x + 1, y + 1) * dx;
        *value = top * (1.0 - dy) + bottom * dy;
    }
    grey.iter().all(|value| value.is_finite()).then_some(grey)
}
