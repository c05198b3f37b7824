//! Depth in formats other than pictures, and confidence.

use super::{ClipError, DepthImage, picture};
use crate::container::Container;
use flate2::read::ZlibDecoder;
use lzfse_rust::LzfseRingDecoder;
use std::io::Read;
use viola_geometry::Pinhole;

/// Maximum size of a packed file of depth or confidence.
const MAX_PACKED_BYTES: u64 = 16 << 20;
/// Sizes of phones' depth, in portrait and landscape.
const KNOWN_SIZES: [(u32, u32); 8] =
    [(192, 256), (256, 192), (480, 640), (640, 480), (720, 960), (960, 720), (240, 320), (320, 240)];
/// 4:3 pictures up to 2300 x 1700, more than any phone's depth; 16 MiB of floats.
pub(super) const MAX_PIXELS: u64 = 4 << 20;

/// Converts a 16-bit reading to metres. The largest number means no reading: 7-Scenes writes it, and no
/// layout uses it as a depth.
pub(super) fn metres(units: u16, units_per_m: f32) -> f32 {
    if units == u16::MAX { 0.0 } else { f32::from(units) / units_per_m }
}

/// Returns a depth in metres, or 0 for a number that is no depth.
pub(super) fn valid(depth_m: f32) -> f32 {
    if depth_m.is_finite() && depth_m > 0.0 { depth_m } else { 0.0 }
}

/// Returns width and height of LZFSE-packed floats: as given, or else from the number of floats and from whether the
/// picture is wide.
pub(super) fn floats_size(
    container: &dyn Container,
    name: &str,
    told: Option<(u32, u32)>,
    is_wide: bool,
) -> Result<(u32, u32), ClipError> {
    let bad = |reason: String| ClipError::BadDepth { name: name.to_string(), reason };
    if let Some((width, height)) = told {
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > MAX_PIXELS {
            return Err(bad(format!("{width}x{height} is no size of a depth picture")));
        }
        return Ok((width, height));
    }
    let bytes = unpack(container, name, (960 * 720) * 4)?;
    let fits = |&(width, height): &(u32, u32)| {
        u64::from(width * height) * 4 == bytes.len() as u64 && (width > height) == is_wide
    };
    KNOWN_SIZES
        .into_iter()
        .find(fits)
        .ok_or_else(|| bad(format!("{} bytes are those of no depth picture that is known", bytes.len())))
}

/// Decodes LZFSE-packed 32-bit floats in metres, row by row.
pub(super) fn decode_floats(
    container: &dyn Container,
    name: &str,
    camera: &Pinhole,
) -> Result<DepthImage, ClipError> {
    let (width, height) = (camera.width, camera.height);
    let wanted = width as usize * height as usize * 4;
    let bytes = unpack(container, name, wanted)?;
    if bytes.len() != wanted {
        let reason = format!("{} bytes instead of those of {width}x{height} floats", bytes.len());
        return Err(ClipError::BadDepth { name: name.to_string(), reason });
    }
    let depth_m = bytes.as_chunks().0.iter().map(|bytes| valid(f32::from_le_bytes(*bytes))).collect();
    Ok(DepthImage { width, height, depth_m })
}

/// Drops the readings with the lowest of three confidences (0, 1, 2, or 0, 127, 255). The picture may have
/// another size than the depth.
pub(super) fn drop_doubtful(
    container: &dyn Container,
    name: &str,
    depth: &mut DepthImage,
) -> Result<(), ClipError> {
    let (width, height) = (depth.width, depth.height);
    let (confidence, (from_width, from_height)) = if name.to_ascii_lowercase().ends_with(".conf") {
        let bytes = unpack(container, name, depth.depth_m.len())?;
        if bytes.len() != depth.depth_m.len() {
            let reason = format!("{} bytes instead of those of {width}x{height} pixels", bytes.len());
            return Err(ClipError::BadDepth { name: name.to_string(), reason });
        }
        (bytes, (width, height))
    } else {
        let image = picture::decode_grey8(container, name)?;
        let size = image.dimensions();
        (image.into_raw(), size)
    };
    drop_zeros(&confidence, (from_width, from_height), depth);
    Ok(())
}

/// Returns width and height of bytes that RTAB-Map has packed: zlib, then rows, columns and the type 0 in 32 bits each
/// (introlab/rtabmap, Compression.cpp). `None` if they have another form.
pub(super) fn size_of_packed(packed: &[u8]) -> Option<(u32, u32)> {
    let (_, numbers) = packed.split_last_chunk::<12>()?;
    let numbers: Vec<u32> = numbers.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    let &[height, width, 0] = numbers.as_slice() else { return None };
    let pixels = u64::from(width) * u64::from(height);
    (1..=MAX_PIXELS).contains(&pixels).then_some((width, height))
}

/// Drops the readings with the lowest confidence, 0 of 100, of RTAB-Map's packed bytes.
pub(super) fn drop_doubtful_of(packed: &[u8], name: &str, depth: &mut DepthImage) -> Result<(), ClipError> {
    let bad = |reason: String| ClipError::BadDepth { name: name.to_string(), reason };
    let size = size_of_packed(packed).ok_or_else(|| bad("it has no size".into()))?;
    let pixels = size.0 as usize * size.1 as usize;
    let mut confidence = Vec::new();
    ZlibDecoder::new(packed)
        .take(pixels as u64 + 1)
        .read_to_end(&mut confidence)
        .map_err(|error| bad(format!("it is not zlib ({error})")))?;
    if confidence.len() != pixels {
        return Err(bad(format!("{} bytes instead of those of {pixels} pixels", confidence.len())));
    }
    drop_zeros(&confidence, size, depth);
    Ok(())
}

/// Drops the readings whose confidence is 0. Both pictures have the same view, in their own sizes.
fn drop_zeros(confidence: &[u8], (from_width, from_height): (u32, u32), depth: &mut DepthImage) {
    let (width, height) = (depth.width, depth.height);
    let column = |x: u32| (u64::from(x) * u64::from(from_width) / u64::from(width)) as usize;
    for (y, row) in depth.depth_m.chunks_mut(width as usize).enumerate() {
        let from_y = y * from_height as usize / height as usize;
        let trust = &confidence[from_y * from_width as usize..][..from_width as usize];
        for (x, depth_m) in row.iter_mut().enumerate() {
            if trust[column(x as u32)] == 0 {
                *depth_m = 0.0;
            }
        }
    }
}

/// Unpacks LZFSE to at most `max_bytes`.
fn unpack(container: &dyn Container, name: &str, max_bytes: usize) -> Result<Vec<u8>, ClipError> {
    let packed = container.read(name, MAX_PACKED_BYTES)?;
    let bad = |reason: String| ClipError::BadDepth { name: name.to_string(), reason };
    let mut decoder = LzfseRingDecoder::default();
    let mut bytes = Vec::new();
    decoder
        .reader_bytes(&packed)
        .take(max_bytes as u64 + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| bad(format!("it is not LZFSE ({error})")))?;
    if bytes.len() > max_bytes {
        return Err(bad(format!("it unpacks to more than {max_bytes} bytes")));
    }
    Ok(bytes)
}
