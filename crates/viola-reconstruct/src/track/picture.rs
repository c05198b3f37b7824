//! Converts a frame for tracking: grey and depth on one raster, at several sizes.

use rayon::prelude::*;
use viola_formats::clip::Frame;
use viola_geometry::Pinhole;

/// Maximum width of the raster. Finer ones cost time without gain, because depth cameras blur over pixels.
const MAX_WIDTH: u32 = 360;
/// Minimum width of a layer.
const MIN_WIDTH: usize = 32;
const MAX_LAYERS: usize = 4;
/// Maximum ratio between the readings of one surface in a cell. Cells with several surfaces have no depth,
/// because with any choice slanted surfaces would seem to move along with the camera.
const ONE_SURFACE: f32 = 1.06;
/// The same for the four cells of a finer layer.
const ONE_COARSE_SURFACE: f32 = 1.2;
/// Range that depth cameras can measure in a home.
const DEPTH_M: std::ops::RangeInclusive<f32> = 0.15..=8.0;

/// Grey (0 to 1) and depth (metres, 0 if unknown) of a frame on the same rays.
#[derive(Debug, Clone)]
pub(crate) struct Layer {
    pub camera: Pinhole,
    pub grey: Vec<f32>,
    pub depth_m: Vec<f32>,
}

impl Layer {
    pub fn width(&self) -> usize {
        self.camera.width as usize
    }

    pub fn height(&self) -> usize {
        self.camera.height as usize
    }
}

/// The layers of a frame, the finest first.
#[derive(Debug, Clone)]
pub(crate) struct Pyramid {
    pub layers: Vec<Layer>,
}

impl Pyramid {
    pub fn new(frame: &Frame) -> Pyramid {
        let camera = &frame.depth_camera;
        let factor = camera.width.div_ceil(MAX_WIDTH).max(1);
        let size = (camera.width / factor, camera.height / factor);
        // Rows and columns that do not fill a cell are cut off, so that cells are whole numbers of pixels.
        let whole = Pinhole { width: size.0 * factor, height: size.1 * factor, ..*camera };
        let camera = whole.resized(size.0, size.1);
        let (grey, depth_m) = rayon::join(|| grey(frame, &camera), || depth(frame, &camera, factor as usize));
        Pyramid::from_layer(Layer { camera, grey, depth_m })
    }

    pub fn from_layer(finest: Layer) -> Pyramid {
        let mut layers = vec![finest];
        while let Some(last) = layers.last()
            && layers.len() < MAX_LAYERS
            && last.width() / 2 >= MIN_WIDTH
        {
            layers.push(halved(last));
        }
        Pyramid { layers }
    }

    pub fn finest(&self) -> &Layer {
        &self.layers[0]
    }
}

/// Returns the colour pixels that each column or row of the raster covers: first and last, the last not
/// included. Empty outside of the colour picture.
fn covered(size: u32, f: f64, c: f64, color_size: u32, color_f: f64, color_c: f64) -> Vec<(usize, usize)> {
    let scale = color_f / f;
    (0..size)
        .map(|at| {
            let middle = (f64::from(at) - c) * scale + color_c;
            let first = (middle - 0.5 * scale + 0.5).round();
            let last = (middle + 0.5 * scale + 0.5).round().max(first + 1.0);
            let inside = first >= 0.0 && last <= f64::from(color_size);
            if inside { (first as usize, last as usize) } else { (0, 0) }
        })
        .collect()
}

/// Returns the mean grey of the colour pixels behind each cell; NaN outside of the colour picture and without
/// one.
fn grey(frame: &Frame, camera: &Pinhole) -> Vec<f32> {
    let Some(picture) = &frame.color else {
        return vec![f32::NAN; camera.width as usize * camera.height as usize];
    };
    let color = &frame.color_camera;
    let columns = covered(camera.width, camera.fx, camera.cx, color.width, color.fx, color.cx);
    let rows = covered(camera.height, camera.fy, camera.cy, color.height, color.fy, color.cy);
    let width = camera.width as usize;
    let stride = picture.width() as usize * 3;
    let pixels = picture.as_raw();
    let mut grey = vec![f32::NAN; width * rows.len()];
    grey.par_chunks_mut(width).zip(&rows).for_each(|(out, &(top, bottom))| {
        if top == bottom {
            return;
        }
        for (value, &(left, right)) in out.iter_mut().zip(&columns) {
            if left == right {
                continue;
            }
            // A cell of a tiny depth sensor covers more pixels than 32 bits can sum.
            let mut sum = 0u64;
            for y in top..bottom {
                let row = &pixels[y * stride + left * 3..y * stride + right * 3];
                // Weights of ITU-R BT.601.
                sum += row
                    .chunks_exact(3)
                    .map(|p| u64::from(77 * u32::from(p[0]) + 150 * u32::from(p[1]) + 29 * u32::from(p[2])))
                    .sum::<u64>();
            }
            let count = ((bottom - top) * (right - left)) as f32;
            *value = sum as f32 / (count * 255.0 * 256.0);
        }
    });
    grey
}

/// Returns the depth in the middle of each cell; 0 if there is none.
fn depth(frame: &Frame, camera: &Pinhole, factor: usize) -> Vec<f32> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let stride = frame.depth.width as usize;
    let readings = &frame.depth.depth_m;
    let mut depth_m = vec![0.0; width * height];
    depth_m.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (x, value) in out.iter_mut().enumerate() {
            let row = |dy: usize| {
                let first = (y * factor + dy) * stride + x * factor;
                readings[first..first + factor].iter().copied()
            };
            let known = (0..factor).flat_map(row).filter(|depth| DEPTH_M.contains(depth));
            *value = middle(known, (factor * factor).div_ceil(2), ONE_SURFACE);
        }
    });
    depth_m
}

/// Returns the depth in the middle of readings of one surface, which are linear in inverse depth; 0 if they
/// are fewer than `least` or of several surfaces.
fn middle(depths_m: impl Iterator<Item = f32>, least: usize, one_surface: f32) -> f32 {
    let (mut nearest, mut farthest, mut sum, mut count) = (f32::INFINITY, 0f32, 0f32, 0);
    for depth_m in depths_m {
        nearest = nearest.min(depth_m);
        farthest = farthest.max(depth_m);
        sum += 1.0 / depth_m;
        count += 1;
    }
    if count >= least.max(1) && farthest <= nearest * one_surface { count as f32 / sum } else { 0.0 }
}

fn halved(layer: &Layer) -> Layer {
    let (width, height) = (layer.width() / 2, layer.height() / 2);
    let whole = Pinhole { width: 2 * width as u32, height: 2 * height as u32, ..layer.camera };
    let (mut grey, mut depth_m) = (Vec::new(), Vec::new());
    for y in 0..height {
        for x in 0..width {
            let first = 2 * y * layer.width() + 2 * x;
            let cell = [first, first + 1, first + layer.width(), first + layer.width() + 1];
            grey.push(cell.iter().map(|&at| layer.grey[at]).sum::<f32>() / 4.0);
            let known = cell.iter().map(|&at| layer.depth_m[at]).filter(|depth| *depth > 0.0);
            depth_m.push(middle(known, 4, ONE_COARSE_SURFACE));
        }
    }
    Layer { camera: whole.resized(width as u32, height as u32), grey, depth_m }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};
    use viola_formats::clip::{DepthImage, FrameHeader};

    #[test]
    fn a_cell_of_many_pixels_has_their_mean_grey() {
        let camera = |side: u32| {
            let middle = f64::from(side - 1) / 2.0;
            Pinhole { width: side, height: side, fx: side.into(), fy: side.into(), cx: middle, cy: middle }
        };
        let frame = Frame {
            header: FrameHeader { number: 0, time_s: None, world_from_camera: None, force_in_camera: None },
            color_camera: camera(600),
            color: Some(RgbImage::from_pixel(600, 600, Rgb([255; 3]))),
            depth_camera: camera(2),
            depth: DepthImage { width: 2, height: 2, depth_m: vec![2.0; 4] },
        };
        assert_eq!(Pyramid::new(&frame).finest().grey, [1.0; 4]);
    }
}
