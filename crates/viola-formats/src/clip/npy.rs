//! Depth as NumPy's `.npy`, from early versions of Stray Scanner (strayrobots/scanner, NPYArrayWrapper.mm), which wrote only
//! 16-bit integers, and in files of Nerfstudio (numpy/numpy, doc/neps/nep-0001-npy-format). The header's three values are
//! found by key, without a parser of Python's literals.

use super::{ClipError, DepthImage, depth, picture};
use crate::container::Container;
use viola_geometry::Pinhole;

/// Three values, and the padding after them.
const MAX_HEADER_BYTES: usize = 4 << 10;
const MAX_FILE_BYTES: u64 = depth::MAX_PIXELS * 8 + MAX_HEADER_BYTES as u64 + 12;

/// The numbers that the arrays of a layout may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Allowed {
    Integers,
    IntegersAndFloats,
}

/// The size in the header, and the readings after it.
struct Array<'a> {
    width: u32,
    height: u32,
    readings: Readings<'a>,
}

enum Readings<'a> {
    /// Integers of 16 bits.
    Integers(&'a [[u8; 2]]),
    /// Floats of 16 bits.
    Halves(&'a [[u8; 2]]),
    /// Floats of 32 bits.
    Floats(&'a [[u8; 4]]),
    /// Floats of 64 bits, which NumPy makes of integers that are divided.
    Doubles(&'a [[u8; 8]]),
}

/// Returns width and height.
pub(super) fn size(container: &dyn Container, name: &str, allowed: Allowed) -> Result<(u32, u32), ClipError> {
    let bytes = container.read(name, MAX_FILE_BYTES)?;
    let Array { width, height, .. } = parse(&bytes, name, allowed)?;
    Ok((width, height))
}

/// Returns the largest finite number of an array of floats; `None` for integers.
pub(super) fn largest_float(container: &dyn Container, name: &str) -> Result<Option<f32>, ClipError> {
    let bytes = container.read(name, MAX_FILE_BYTES)?;
    let Array { readings, .. } = parse(&bytes, name, Allowed::IntegersAndFloats)?;
    let largest = |largest: f32, number: f32| if number.is_finite() { largest.max(number) } else { largest };
    Ok(match readings {
        Readings::Integers(_) => None,
        Readings::Halves(numbers) => Some(numbers.iter().map(half).fold(0.0, largest)),
        Readings::Floats(numbers) => Some(numbers.iter().map(|b| f32::from_le_bytes(*b)).fold(0.0, largest)),
        Readings::Doubles(numbers) => Some(numbers.iter().map(double).fold(0.0, largest)),
    })
}

/// Decodes depth of the camera's size to metres.
pub(super) fn decode(
    container: &dyn Container,
    name: &str,
    allowed: Allowed,
    camera: &Pinhole,
    units_per_m: f32,
) -> Result<DepthImage, ClipError> {
    let bytes = container.read(name, MAX_FILE_BYTES)?;
    let Array { width, height, readings } = parse(&bytes, name, allowed)?;
    picture::check_size(name, (width, height), camera)?;
    let metres = |number: f32| depth::valid(number / units_per_m);
    let depth_m = match readings {
        Readings::Integers(numbers) => {
            numbers.iter().map(|b| depth::metres(u16::from_le_bytes(*b), units_per_m)).collect()
        }
        Readings::Halves(numbers) => numbers.iter().map(|b| metres(half(b))).collect(),
        Readings::Floats(numbers) => numbers.iter().map(|b| metres(f32::from_le_bytes(*b))).collect(),
        Readings::Doubles(numbers) => numbers.iter().map(|b| metres(double(b))).collect(),
    };
    Ok(DepthImage { width, height, depth_m })
}

/// Returns a float of 64 bits, rounded to 32.
fn double(bytes: &[u8; 8]) -> f32 {
    f64::from_le_bytes(*bytes) as f32
}

/// Returns a float of 16 bits (IEEE 754, binary16), least significant byte first.
fn half(bytes: &[u8; 2]) -> f32 {
    let bits = u16::from_le_bytes(*bytes);
    let (exponent, fraction) = (i32::from((bits >> 10) & 0x1f), f32::from(bits & 0x3ff));
    let size = match exponent {
        0 => fraction * 2f32.powi(-24),
        0x1f if fraction == 0.0 => f32::INFINITY,
        0x1f => f32::NAN,
        _ => (1024.0 + fraction) * 2f32.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

fn parse<'a>(bytes: &'a [u8], name: &str, allowed: Allowed) -> Result<Array<'a>, ClipError> {
    let bad = |reason: String| ClipError::BadDepth { name: name.to_string(), reason };
    let (text, rest) = split(bytes).ok_or_else(|| bad("it is not NumPy's .npy, or it was cut".into()))?;
    // The literals as NumPy and cnpy write them: 'descr': '<u2', 'fortran_order': False, 'shape': (192, 256).
    let value = |key: &str| {
        let (_, behind) = text.split_once(&format!("'{key}':"))?;
        Some(behind.trim_start())
    };
    let number = value("descr").and_then(|text| text.strip_prefix('\'')?.split_once('\''));
    let number = number.map_or("unknown", |(number, _)| number);
    let (readings, bytes_each) = match (number, allowed) {
        ("<u2", _) => (Readings::Integers(rest.as_chunks().0), 2),
        ("<f2", Allowed::IntegersAndFloats) => (Readings::Halves(rest.as_chunks().0), 2),
        ("<f4", Allowed::IntegersAndFloats) => (Readings::Floats(rest.as_chunks().0), 4),
        ("<f8", Allowed::IntegersAndFloats) => (Readings::Doubles(rest.as_chunks().0), 8),
        (_, Allowed::Integers) => {
            return Err(bad(format!(
                "its numbers are {number}; depth is in whole millimetres of 16 bits (<u2)"
            )));
        }
        (_, Allowed::IntegersAndFloats) => {
            return Err(bad(format!(
                "its numbers are {number}; save depth as float32 (<f4), float16 (<f2) or uint16 (<u2), or as PNG of 16 bits"
            )));
        }
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
    if pixels == 0 || pixels > depth::MAX_PIXELS {
        return Err(bad(format!("{width}x{height} is no size of a depth picture")));
    }
    if rest.len() as u64 != pixels * bytes_each {
        return Err(bad(format!("{} bytes instead of those of {width}x{height} readings", rest.len())));
    }
    Ok(Array { width, height, readings })
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

#[cfg(test)]
mod tests {
    use super::half;

    #[test]
    fn floats_of_16_bits_are_those_of_ieee_754() {
        for (bits, number) in [
            (0x0000_u16, 0.0),
            (0x0001, 1.0 / 16_777_216.0),
            (0x03ff, 1023.0 / 16_777_216.0),
            (0x0400, 1.0 / 16_384.0),
            (0x3555, 1365.0 / 4096.0),
            (0x3c00, 1.0),
            (0x4248, 3.140_625),
            (0x7bff, 65_504.0),
            (0x7c00, f32::INFINITY),
            (0xc000, -2.0),
        ] {
            assert_eq!(half(&bits.to_le_bytes()), number, "{bits:x}");
        }
        assert!(half(&0x7e00_u16.to_le_bytes()).is_nan());
    }
}
