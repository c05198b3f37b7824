//! Holes of all inpainters: finds whether there is one, and keeps the picture outside of it.

use super::InpaintError;
use image::{GrayImage, Luma, RgbImage};

/// Returns whether there is a hole, after a check that picture and mask have the same size.
pub(super) fn any(picture: &RgbImage, hole: &GrayImage) -> Result<bool, InpaintError> {
    if picture.width() == 0 || picture.height() == 0 {
        return Err(InpaintError::NoPicture);
    }
    if picture.dimensions() != hole.dimensions() {
        let shown = |(width, height): (u32, u32)| format!("{width} x {height}");
        return Err(InpaintError::HoleSize {
            hole: shown(hole.dimensions()),
            picture: shown(picture.dimensions()),
        });
    }
    Ok(hole.pixels().any(is_hole))
}

pub(super) fn is_hole(value: &Luma<u8>) -> bool {
    value.0[0] >= 128
}

/// Returns the picture with `filled` in its holes. Networks blend over a hole's edge or repaint the whole
/// picture; pixels outside the holes stay to the bit.
pub(super) fn put_back(picture: &RgbImage, hole: &GrayImage, filled: &RgbImage) -> RgbImage {
    let mut whole = picture.clone();
    for ((pixel, hole), filled) in whole.pixels_mut().zip(hole.pixels()).zip(filled.pixels()) {
        if is_hole(hole) {
            *pixel = *filled;
        }
    }
    whole
}
