//! Colour and depth pictures: headers first, then pixels.

use super::{ClipError, DepthImage, depth};
use crate::container::Container;
use image::{ColorType, DynamicImage, GrayImage, ImageDecoder, ImageFormat, ImageReader, Limits, RgbImage};
use std::io::Cursor;
use viola_geometry::Pinhole;

/// Maximum size of a picture's file.
const MAX_PICTURE_BYTES: u64 = 64 << 20;
/// 4:3 pictures up to 4700 x 3500, more than phones record beside depth.
const MAX_PIXELS: u64 = 16 << 20;

/// Returns width and height, from the picture's header.
pub(super) fn size(container: &dyn Container, name: &str) -> Result<(u32, u32), ClipError> {
    let bytes = container.read(name, MAX_PICTURE_BYTES)?;
    Ok(decoder(&bytes, name)?.dimensions())
}

/// Reads the bytes of a picture's file.
pub(super) fn read(container: &dyn Container, name: &str) -> Result<Vec<u8>, ClipError> {
    Ok(container.read(name, MAX_PICTURE_BYTES)?)
}

/// Decodes a colour picture of the camera's size.
pub(super) fn decode_color(bytes: &[u8], name: &str, camera: &Pinhole) -> Result<RgbImage, ClipError> {
    let decoder = decoder(bytes, name)?;
    check_size(name, decoder.dimensions(), camera)?;
    if is_cut_jpeg(bytes) {
        return Err(ClipError::BadPicture { name: name.to_string(), reason: "it ends too early".into() });
    }
    Ok(pixels(decoder, name)?.into_rgb8())
}

/// Decodes a depth picture of the camera's size to metres.
pub(super) fn decode_depth(
    container: &dyn Container,
    name: &str,
    camera: &Pinhole,
    units_per_m: f32,
) -> Result<DepthImage, ClipError> {
    let bytes = container.read(name, MAX_PICTURE_BYTES)?;
    let decoder = decoder(&bytes, name)?;
    check_size(name, decoder.dimensions(), camera)?;
    let found = decoder.color_type();
    if found != ColorType::L16 {
        return Err(ClipError::DepthNotGrey16 { name: name.to_string(), found: format!("{found:?}") });
    }
    let image = pixels(decoder, name)?.into_luma16();
    let (width, height) = image.dimensions();
    let depth_m = image.into_raw().into_iter().map(|units| depth::metres(units, units_per_m)).collect();
    Ok(DepthImage { width, height, depth_m })
}

/// Decodes a picture with 8 bits of grey.
pub(super) fn decode_grey8(container: &dyn Container, name: &str) -> Result<GrayImage, ClipError> {
    let bytes = container.read(name, MAX_PICTURE_BYTES)?;
    let decoder = decoder(&bytes, name)?;
    let found = decoder.color_type();
    if found != ColorType::L8 {
        let reason = format!("it is {found:?}, not 8 bits of grey");
        return Err(ClipError::BadPicture { name: name.to_string(), reason });
    }
    Ok(pixels(decoder, name)?.into_luma8())
}

/// Reads the header, and refuses pictures that are too large to decode.
fn decoder<'a>(bytes: &'a [u8], name: &str) -> Result<impl ImageDecoder + 'a, ClipError> {
    let bad = |reason: String| ClipError::BadPicture { name: name.to_string(), reason };
    let format = match bytes {
        [0xff, 0xd8, ..] => ImageFormat::Jpeg,
        [0x89, b'P', b'N', b'G', ..] => ImageFormat::Png,
        _ => return Err(bad("it is neither JPEG nor PNG".into())),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    // Sixteen bits of four channels, and as much again for the decoder.
    limits.max_alloc = Some(MAX_PIXELS * 8 * 2);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|error| bad(error.to_string()))?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(ClipError::PictureTooLarge {
            name: name.to_string(),
            width,
            height,
            max_pixels: MAX_PIXELS,
        });
    }
    if width == 0 || height == 0 {
        return Err(bad("it has no pixels".into()));
    }
    Ok(decoder)
}

fn check_size(name: &str, (width, height): (u32, u32), camera: &Pinhole) -> Result<(), ClipError> {
    if (width, height) == (camera.width, camera.height) {
        return Ok(());
    }
    Err(ClipError::ImageSizeChanged {
        name: name.to_string(),
        width,
        height,
        first_width: camera.width,
        first_height: camera.height,
    })
}

fn pixels(decoder: impl ImageDecoder, name: &str) -> Result<DynamicImage, ClipError> {
    DynamicImage::from_decoder(decoder)
        .map_err(|error| ClipError::BadPicture { name: name.to_string(), reason: error.to_string() })
}

/// Returns whether a JPEG lacks its end marker. The decoder would silently fill the rest with grey.
fn is_cut_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xff, 0xd8]) && !bytes.windows(2).rev().any(|pair| pair == [0xff, 0xd9])
}
