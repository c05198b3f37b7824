//! COLMAP's depth maps: `width&height&channels&` as text, then 32-bit floats, row by row
//! (colmap/colmap, src/colmap/mvs/mat.h).

use super::{ClipError, DepthImage, depth, picture};
use crate::container::Container;
use viola_geometry::Pinhole;

/// 32 MiB of floats: pictures up to 3300 x 2500.
const MAX_BYTES: u64 = 32 << 20;
/// Three numbers of at most five digits.
const MAX_HEAD_BYTES: usize = 24;

/// Returns width and height.
pub(super) fn size(container: &dyn Container, name: &str) -> Result<(u32, u32), ClipError> {
    let bytes = container.read(name, MAX_BYTES)?;
    DepthMap::of(&bytes, name).map(|map| (map.width, map.height))
}

/// Decodes depth of the camera's size, in the unit of the reconstruction.
pub(super) fn decode(
    container: &dyn Container,
    name: &str,
    camera: &Pinhole,
) -> Result<DepthImage, ClipError> {
    let bytes = container.read(name, MAX_BYTES)?;
    let DepthMap { width, height, floats } = DepthMap::of(&bytes, name)?;
    picture::check_size(name, (width, height), camera)?;
    let depth_m = floats.iter().map(|bytes| depth::valid(f32::from_le_bytes(*bytes))).collect();
    Ok(DepthImage { width, height, depth_m })
}

/// The parts of a file.
struct DepthMap<'a> {
    width: u32,
    height: u32,
    /// As many as pixels.
    floats: &'a [[u8; 4]],
}

impl<'a> DepthMap<'a> {
    fn of(bytes: &'a [u8], name: &str) -> Result<DepthMap<'a>, ClipError> {
        let bad = |reason: &str| ClipError::BadDepth { name: name.to_string(), reason: reason.to_string() };
        let mut ends = (0..bytes.len().min(MAX_HEAD_BYTES)).filter(|&at| bytes[at] == b'&');
        let end = ends.nth(2).ok_or_else(|| bad("it does not begin with width&height&channels&"))?;
        let head = std::str::from_utf8(&bytes[..end]).unwrap_or_default();
        let sizes: Vec<u32> = head.split('&').filter_map(|word| word.parse().ok()).collect();
        let [width, height, 1] = sizes[..] else {
            return Err(bad("it is not an array of one channel"));
        };
        let (floats, rest) = bytes[end + 1..].as_chunks::<4>();
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || floats.len() as u64 != pixels || !rest.is_empty() {
            return Err(bad("its length is not that of its pixels"));
        }
        Ok(DepthMap { width, height, floats })
    }
}
