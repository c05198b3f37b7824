//! Converts a picture with holes to the networks' size, and back.

use super::super::hole;
use crate::complete::inpaint::InpaintError;
use image::{GrayImage, RgbImage};
use viola_network::Tensor;
use viola_network::manifest::Input;
use viola_reconstruct::label::picture::{self, Fit, Raster};

/// Input of the networks from a picture.
pub(super) struct Frame {
    fit: Fit,
    size: Raster,
    /// The picture from -1 to 1, 1 x 3 x height x width, zero in the holes.
    pub(super) masked: Tensor,
    /// 1 in the holes, 0 elsewhere, one value for each latent.
    pub(super) mask: Vec<f32>,
}

impl Frame {
    /// Fits picture and holes into `input`, with the aspect ratio kept; the padding repeats the picture's
    /// last rows and columns. `cell` is the side of a latent in pixels.
    pub(super) fn new(
        picture: &RgbImage,
        hole: &GrayImage,
        rule: &Input,
        input: Raster,
        cell: usize,
    ) -> Frame {
        let size = Raster { width: picture.width() as usize, height: picture.height() as usize };
        let fit = Fit::into_fixed(size, input, None, false);
        let holes = holes(hole, fit);
        let mut masked = picture::tensor(picture, fit, rule, false);
        if let viola_network::Data::F32(values) = &mut masked.data {
            for plane in values.chunks_exact_mut(input.width * input.height) {
                extend(plane, fit);
                for (value, hole) in plane.iter_mut().zip(&holes) {
                    if *hole {
                        *value = 0.0;
                    }
                }
            }
        }
        let (columns, rows) = (input.width / cell, input.height / cell);
        // The pixel in a cell's corner decides for the cell, as in the U-Net's training.
        let mask = (0..rows * columns)
            .map(|at| holes[at / columns * cell * input.width + at % columns * cell])
            .map(|hole| if hole { 1.0 } else { 0.0 })
            .collect();
        Frame { fit, size, masked, mask }
    }

    /// Returns the picture, at its own size, from the decoder's values, -1 to 1, 3 x height x width.
    pub(super) fn picture(&self, values: &[f32]) -> Result<RgbImage, InpaintError> {
        let Fit { input, content } = self.fit;
        let planes: Vec<Vec<f32>> = values
            .chunks_exact(input.width * input.height)
            .map(|plane| {
                let rows = plane.chunks_exact(input.width).take(content.height);
                let cut: Vec<f32> = rows.flat_map(|row| &row[..content.width]).copied().collect();
                picture::resized(&cut, content, self.size)
            })
            .collect();
        let byte = |value: f32| ((value * 0.5 + 0.5).clamp(0.0, 1.0) * 255.0).round_ties_even() as u8;
        let pixels = (0..self.size.width * self.size.height)
            .flat_map(|at| planes.iter().map(move |plane| byte(plane[at])))
            .collect();
        RgbImage::from_raw(self.size.width as u32, self.size.height as u32, pixels).ok_or_else(|| {
            InpaintError::Shape {
                got: format!("{} values", values.len()),
                want: format!("3 x {} x {}", input.height, input.width),
            }
        })
    }
}

/// Returns the holes at the network's size: a pixel is in a hole if any part of it is.
fn holes(hole: &GrayImage, fit: Fit) -> Vec<bool> {
    let Fit { input, content } = fit;
    let span = |at: usize, source: u32, target: usize| {
        let source = source as usize;
        at * source / target..((at + 1) * source).div_ceil(target)
    };
    let mut holes = vec![false; input.width * input.height];
    for y in 0..content.height {
        let rows = span(y, hole.height(), content.height);
        for x in 0..content.width {
            let mut columns = span(x, hole.width(), content.width);
            holes[y * input.width + x] = columns.any(|column| {
                rows.clone().any(|row| hole::is_hole(hole.get_pixel(column as u32, row as u32)))
            });
        }
    }
    holes
}

/// Repeats the last column and row of the content over the padding.
fn extend(plane: &mut [f32], fit: Fit) {
    let Fit { input, content } = fit;
    for row in plane.chunks_exact_mut(input.width).take(content.height) {
        let last = row[content.width - 1];
        row[content.width..].fill(last);
    }
    let start = (content.height - 1) * input.width;
    for y in content.height..input.height {
        plane.copy_within(start..start + input.width, y * input.width);
    }
}

#[cfg(test)]
mod tests;
