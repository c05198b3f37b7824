//! Converts a picture to a network's input: resized with its aspect ratio kept, padded, normalised.

use image::RgbImage;
use viola_network::manifest::{Channels, Input, Layout};
use viola_network::signature::{expect, one};
use viola_network::{Element, Network, Tensor};

/// Placement of a picture in a network's input: in its top left corner; the rest is padding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fit {
    pub input: Raster,
    pub content: Raster,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Raster {
    pub width: usize,
    pub height: usize,
}

/// The input of a network for pictures.
pub struct PictureInput {
    pub name: String,
    /// Conversion of a picture, by the network's entry.
    pub rule: Input,
    /// Size of the input if it is fixed.
    pub fixed: Option<Raster>,
}

impl PictureInput {
    /// Returns the input that an entry describes; an error is what the network has instead.
    pub fn of(network: &Network, rule: &Input) -> Result<PictureInput, String> {
        let info = one(network.inputs(), rule.name.as_deref(), "input")?;
        let (width, height) = (rule.width.pixels(), rule.height.pixels());
        let (axes, row_axis) = match rule.layout {
            Layout::Nchw => ([Some(1), Some(3), height, width], 2),
            Layout::Nhwc => ([Some(1), height, width, Some(3)], 1),
        };
        expect(info, "input", Element::F32, &axes)?;
        let fixed = match (height.or(info.axis(row_axis)), width.or(info.axis(row_axis + 1))) {
            (Some(height), Some(width)) if width > 0 && height > 0 => Some(Raster { width, height }),
            (None, None) => None,
            _ => return Err("its input has one side of fixed length and an open one".to_owned()),
        };
        Ok(PictureInput { name: info.name.clone(), rule: rule.clone(), fixed })
    }
}

impl Fit {
    /// Fits a picture into an input of a given size. If the raster of the output is known, the content ends
    /// on one of its cells, so that the padding can be cut off exactly; the aspect ratio holds to half such a
    /// cell.
    pub fn into_fixed(picture: Raster, input: Raster, output: Option<Raster>, align_corners: bool) -> Fit {
        let scale =
            (input.width as f64 / picture.width as f64).min(input.height as f64 / picture.height as f64);
        let side = |picture: usize, input: usize, output: Option<usize>| {
            let ideal = (picture as f64 * scale).clamp(1.0, input as f64);
            let Some(output) = output else { return ideal.round() as usize };
            let cells = cells(ideal, input, output, align_corners);
            let end = if align_corners {
                (cells - 1) as f64 * (input as f64 - 1.0) / (output as f64 - 1.0).max(1.0) + 1.0
            } else {
                cells as f64 * input as f64 / output as f64
            };
            (end.round() as usize).clamp(1, input)
        };
        let content = Raster {
            width: side(picture.width, input.width, output.map(|o| o.width)),
            height: side(picture.height, input.height, output.map(|o| o.height)),
        };
        Fit { input, content }
    }

    /// Fits a picture into an input of variable size, by the entry's rule.
    pub fn by_rule(picture: Raster, rule: &Input) -> Fit {
        let (short, long) =
            (picture.width.min(picture.height) as f64, picture.width.max(picture.height) as f64);
        let scale = (rule.shortest as f64 / short).min(rule.longest as f64 / long);
        let side = |n: usize| ((n as f64 * scale).round() as usize).max(1);
        let content = Raster { width: side(picture.width), height: side(picture.height) };
        let up = |n: usize| n.div_ceil(rule.multiple) * rule.multiple;
        Fit { input: Raster { width: up(content.width), height: up(content.height) }, content }
    }

    /// Returns the part of an output raster that shows the picture.
    pub fn crop(&self, output: Raster, align_corners: bool) -> Raster {
        let side =
            |content: usize, input: usize, output: usize| cells(content as f64, input, output, align_corners);
        Raster {
            width: side(self.content.width, self.input.width, output.width),
            height: side(self.content.height, self.input.height, output.height),
        }
    }
}

/// Returns the number of an output's cells that the first `content` pixels of the input cover.
fn cells(content: f64, input: usize, output: usize, align_corners: bool) -> usize {
    let cells = if align_corners {
        (content - 1.0) * (output as f64 - 1.0) / (input as f64 - 1.0).max(1.0) + 1.0
    } else {
        content * output as f64 / input as f64
    };
    (cells.round() as usize).clamp(1, output)
}

/// Returns the picture as the network's input. Padding is zero after normalisation.
pub fn tensor(picture: &RgbImage, fit: Fit, rule: &Input, align_corners: bool) -> Tensor {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let Raster { width: input_width, height: input_height } = fit.input;
    let rows = Taps::new(height, fit.content.height, align_corners);
    let columns = Taps::new(width, fit.content.width, align_corners);
    let pixels = picture.as_raw();
    let scale = rule.std.map(|std| 1.0 / (255.0 * std));
    let shift = [0, 1, 2].map(|c| -rule.mean[c] / rule.std[c]);
    let place = match rule.channels {
        Channels::Rgb => [0, 1, 2],
        Channels::Bgr => [2, 1, 0],
    };
    let mut values = vec![0.0f32; 3 * input_width * input_height];
    let mut row = vec![0.0f32; 3 * width];
    for y in 0..fit.content.height {
        // Columns first: this pass runs over whole rows and is fast.
        row.fill(0.0);
        for (from, weight) in rows.of(y) {
            let source = &pixels[from * 3 * width..][..3 * width];
            for (sum, value) in row.iter_mut().zip(source) {
                *sum += weight * f32::from(*value);
            }
        }
        for x in 0..fit.content.width {
            let mut sums = [0.0f32; 3];
            for (from, weight) in columns.of(x) {
                for (sum, value) in sums.iter_mut().zip(&row[3 * from..3 * from + 3]) {
                    *sum += weight * value;
                }
            }
            for c in 0..3 {
                let at = match rule.layout {
                    Layout::Nchw => (place[c] * input_height + y) * input_width + x,
                    Layout::Nhwc => (y * input_width + x) * 3 + place[c],
                };
                values[at] = sums[c] * scale[c] + shift[c];
            }
        }
    }
    let shape = match rule.layout {
        Layout::Nchw => vec![1, 3, input_height, input_width],
        Layout::Nhwc => vec![1, input_height, input_width, 3],
    };
    Tensor::f32(shape, values)
}

/// Resizes a raster of numbers with the same weights as pictures.
pub fn resized(values: &[f32], from: Raster, to: Raster) -> Vec<f32> {
    let rows = Taps::new(from.height, to.height, false);
    let columns = Taps::new(from.width, to.width, false);
    let mut resized = Vec::with_capacity(to.width * to.height);
    let mut row = vec![0.0f32; from.width];
    for y in 0..to.height {
        row.fill(0.0);
        for (source, weight) in rows.of(y) {
            for (sum, value) in row.iter_mut().zip(&values[source * from.width..][..from.width]) {
                *sum += weight * value;
            }
        }
        resized
            .extend((0..to.width).map(|x| columns.of(x).map(|(at, weight)| weight * row[at]).sum::<f32>()));
    }
    resized
}

/// Source pixels of each target pixel and their weights: a triangle as wide as one target pixel, or as one
/// source pixel if the picture grows.
struct Taps {
    /// Number of source pixels for each target pixel.
    count: usize,
    first: Vec<usize>,
    weights: Vec<f32>,
}

impl Taps {
    fn new(source: usize, target: usize, align_corners: bool) -> Taps {
        let support = (source as f64 / target as f64).max(1.0);
        let count = ((2.0 * support).ceil() as usize).clamp(1, source);
        let mut taps =
            Taps { count, first: Vec::with_capacity(target), weights: Vec::with_capacity(target * count) };
        for at in 0..target {
            let centre = if align_corners && target > 1 {
                at as f64 * (source as f64 - 1.0) / (target as f64 - 1.0)
            } else {
                (at as f64 + 0.5) * source as f64 / target as f64 - 0.5
            };
            let first = ((centre - support).floor() + 1.0).clamp(0.0, (source - count) as f64) as usize;
            let start = taps.weights.len();
            for tap in first..first + count {
                taps.weights.push((1.0 - (tap as f64 - centre).abs() / support).max(0.0) as f32);
            }
            let weights = &mut taps.weights[start..];
            let sum: f32 = weights.iter().sum();
            if sum > 0.0 {
                weights.iter_mut().for_each(|w| *w /= sum);
            } else {
                weights[0] = 1.0;
            }
            taps.first.push(first);
        }
        taps
    }

    fn of(&self, target: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let weights = &self.weights[target * self.count..(target + 1) * self.count];
        (self.first[target]..).zip(weights.iter().copied())
    }
}

#[cfg(test)]
mod tests;
