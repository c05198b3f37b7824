//! Pictures as files.

use super::WriteError;
use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbImage};

/// A loss similar to that of phone apps.
const QUALITY: u8 = 92;

pub(super) fn jpeg(picture: &RgbImage) -> Result<Vec<u8>, WriteError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(picture)?;
    Ok(bytes)
}

/// Encodes 16 bits of grey.
pub(super) fn grey16_png(width: u32, height: u32, values: &[u16]) -> Result<Vec<u8>, WriteError> {
    let mut png = Vec::new();
    // The encoder takes 16-bit samples in the machine's byte order.
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    PngEncoder::new(&mut png).write_image(&bytes, width, height, ExtendedColorType::L16)?;
    Ok(png)
}

/// Encodes 8 bits of grey.
pub(super) fn grey8_png(width: u32, height: u32, values: &[u8]) -> Result<Vec<u8>, WriteError> {
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(values, width, height, ExtendedColorType::L8)?;
    Ok(png)
}
