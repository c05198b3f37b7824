//! Depth as NumPy's `.npy`, from early versions of Stray Scanner (strayrobots/scanner, NPYArrayWrapper.mm;
//! numpy/numpy, doc/neps/nep-0001-npy-format). Only 16-bit integers are read, because the app wrote nothing
//! else. The header's three values are found by key, without a parser of Python's literals.

use super::{ClipError, DepthImage, depth, picture};
use crate::container::Container;
use viola_geometry::Pinhole;

/// 4 : 3 pictures up to 2 300 x 1 700.
const MAX_PIXELS: u64 = 4 << 20;
/// Three values, and the padding after them.
const MAX_HEADER_BYTES: usize = 4 << 10;
const MAX_FILE_BYTES: u64 = MAX_PIXELS * 2 + MAX_HEADER_BYTES as u64 + 12;

/// The size in the header, and the readings after it.
struct Array<'a> {
    width: u32,
    height: u32,
    readings: &'a [[u8; 2]],
}

/// Returns width and height.
pub(super) fn size(container: &dyn Container, name: &str) -> Result<(u32, u32), ClipError> {
    let bytes = container.read(name, MAX_FILE_BYTES)?;
    let Array { width, height, .. } = parse(&bytes, name)?;
    Ok((width, height))
}

/// Decodes depth of the camera's size to metres.
pub(super) fn decode(
    container: &dyn Container,
    name: &str,
    camera: &Pinhole,
    units_per_m: f32,
) -> Result<DepthImage, ClipError> {
    let bytes = container.read(name, MAX_FILE_BYTES)?;
    let Array { width, height, readings } = parse(&bytes, name)?;
    picture::check_size(name, (width, height), camera)?;
    let depth_m =
        readings.iter().map(|units| depth::metres(u16::from_le_bytes(*units), units_per_m)).collect();
    Ok(DepthImage { width, height, depth_m })
}

fn parse<'a>(bytes: &'a [u8], name: &str) -> Result<Array<'a>, ClipError> {
    let bad = |reason: String| ClipError::BadDepth { name: name.to_string(), reason };
    let (text, rest) = split(bytes).ok_or_else(|| bad("it is not NumPy's .npy, or it was cut".into()))?;
    // The literals as NumPy and cnpy write them: 'descr': '<u2', 'fortran_order': False, 'shape': (192, 256).
    let value = |key: &str| {
        let (_, behind) = text.split_once(&format!("'{key}':"))?;
        Some(behind.trim_start())
    };
    let number = value("descr").and_then(|text| text.strip_prefix('\'')?.split_once('\''));
    let Some(("<u2", _)) = number else {
        let found = number.map_or("unknown", |(number, _)| number);
        return Err(bad(format!("its numbers are {found}; depth is in whole millimetres of 16 bits (<u2)")));
    };
    if !value("fortran_order").is_some_and(|text| text.starts_with("False")) {
        return Err(bad("it is not row after row (fortran_order)".into()));
    }
    let shape = value("shape").and_then(|text| text.strip_prefix('(')?.split_once(')'));
    let sides: Option<Vec<u32>> = shape.and_then(|(shape, _)| {
        let words = shape.split(',').map(str::trim).filter(|word| !word.is_empty());
        words.map(|word| word.parse().ok()).collect()
    });
    let Some(&[height, width]) = sides.as_deref() else {
        return Err(bad("it has not two sides (shape)".into()));
    };
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > MAX_PIXELS {
        return Err(bad(format!("{width}x{height} is no size of a depth picture")));
    }
    if rest.len() as u64 != pixels * 2 {
        return Err(bad(format!("{} bytes instead of those of {width}x{height} readings", rest.len())));
    }
    Ok(Array { width, height, readings: rest.as_chunks().0 })
}

/// Splits a file into the header's text and the data after it.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (version, rest) = bytes.strip_prefix(b"\x93NUMPY")?.split_first_chunk::<2>()?;
    let (length, rest) = match version[0] {
        1 => {
            let (length, rest) = rest.split_first_chunk()?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        }
        2 | 3 => {
            let (length, rest) = rest.split_first_chunk()?;
            (usize::try_from(u32::from_le_bytes(*length)).ok()?, rest)
        }
        _ => return None,
    };
    let (header, rest) = rest.split_at_checked(length).filter(|_| length <= MAX_HEADER_BYTES)?;
    Some((std::str::from_utf8(header).ok()?, rest))
}
