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
    size_of(&bytes, name)
}

/// Returns width and height of a picture's file in memory.
pub(super) fn size_of(bytes: &[u8], name: &str) -> Result<(u32, u32), ClipError> {
    Ok(decoder(bytes, name)?.dimensions())
}

/// Returns whether a picture's file has four channels of 8 bits.
pub(super) fn has_four_channels(bytes: &[u8], name: &str) -> Result<bool, ClipError> {
    Ok(decoder(bytes, name)?.color_type() == ColorType::Rgba8)
}

/// Reads the bytes of a picture's file.
pub(super) fn read(container: &dyn Container, name: &str) -> Result<Vec<u8>, ClipError> {
    Ok(container.read(name, MAX_PICTURE_BYTES)?)
}

/// Returns whether a picture's file has 16 bits of grey.
pub(super) fn is_grey16(bytes: &[u8]) -> bool {
    decoder(bytes, "").is_ok_and(|decoder| decoder.color_type() == ColorType::L16)
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

/// Decodes a depth picture of the camera's size; `metres` converts its numbers, 0 for none.
pub(super) fn decode_depth(
    bytes: &[u8],
    name: &str,
    camera: &Pinhole,
    metres: impl Fn(u16) -> f32,
) -> Result<DepthImage, ClipError> {
    let decoder = decoder(bytes, name)?;
    check_size(name, decoder.dimensions(), camera)?;
    let found = decoder.color_type();
    if found != ColorType::L16 {
        return Err(ClipError::DepthNotGrey16 { name: name.to_string(), found: format!("{found:?}") });
    }
    let image = pixels(decoder, name)?.into_luma16();
    let (width, height) = image.dimensions();
    let depth_m = image.into_raw().into_iter().map(metres).collect();
    Ok(DepthImage { width, height, depth_m })
}

/// Decodes a picture whose blue, green, red and alpha are the bytes of a 32-bit float in metres.
pub(super) fn decode_float_depth(
    bytes: &[u8],
    name: &str,
    camera: &Pinhole,
) -> Result<DepthImage, ClipError> {
    let decoder = decoder(bytes, name)?;
    check_size(name, decoder.dimensions(), camera)?;
    let image = pixels(decoder, name)?.into_rgba8();
    let (width, height) = image.dimensions();
    let metres =
        |&[red, green, blue, alpha]: &[u8; 4]| depth::valid(f32::from_le_bytes([blue, green, red, alpha]));
    let depth_m = image.into_raw().as_chunks().0.iter().map(metres).collect();
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
    check_pixels(name, width, height)?;
    Ok(decoder)
}

/// Refuses the size of an empty picture, and of one that is too large to decode.
pub(super) fn check_pixels(name: &str, width: u32, height: u32) -> Result<(u32, u32), ClipError> {
    let name = name.to_string();
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(ClipError::PictureTooLarge { name, width, height, max_pixels: MAX_PIXELS });
    }
    if width == 0 || height == 0 {
        return Err(ClipError::BadPicture { name, reason: "it has no pixels".into() });
    }
    Ok((width, height))
}

/// Refuses a picture of another size than the camera's.
pub(super) fn check_size(name: &str, (width, height): (u32, u32), camera: &Pinhole) -> Result<(), ClipError> {
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
