//! BMP images without compression, of 8, 24 or 32 bits for each pixel (Microsoft, `BITMAPINFOHEADER`).

use crate::lidar::{LidarError, MAX_CELLS};
use image::{DynamicImage, RgbImage};

const FILE_HEADER_BYTES: usize = 14;
/// Size of the oldest header that is read; later ones are longer.
const MIN_HEADER_BYTES: u32 = 40;

struct Header {
    /// First byte of the pixels.
    pixels_at: usize,
    /// Length of the header after the file's own; the palette follows.
    header_bytes: u32,
    width: u32,
    height: u32,
    is_top_first: bool,
    bits: u32,
    compression: u32,
}

impl Header {
    /// Reads the header; returns `None` if the file ends in it.
    fn parse(bytes: &[u8]) -> Option<Header> {
        let word = |at: usize| bytes.get(at..)?.first_chunk::<4>().copied().map(u32::from_le_bytes);
        // A negative height says that the first row is the uppermost.
        let height = word(22)?.cast_signed();
        Some(Header {
            pixels_at: word(10)? as usize,
            header_bytes: word(14)?,
            width: word(18)?,
            height: height.unsigned_abs(),
            is_top_first: height < 0,
            // The lower half of the word is the number of planes.
            bits: word(26)? >> 16,
            compression: word(30)?,
        })
    }
}

/// Decodes an image; the fourth byte of 32 bits is not used.
pub(super) fn decode(bytes: &[u8], name: &str) -> Result<DynamicImage, LidarError> {
    let bad = |reason: String| LidarError::BadImage { name: name.to_string(), reason };
    let header = Header::parse(bytes).ok_or_else(|| bad("it ends in its header".to_string()))?;
    let Header { header_bytes, width, height, bits, compression, .. } = header;
    if header_bytes < MIN_HEADER_BYTES || compression != 0 || ![8, 24, 32].contains(&bits) {
        return Err(bad(format!(
            "it is a BMP of {bits} bits with a header of {header_bytes} bytes and compression {compression}; save it \
             as PNG, or as a BMP of 24 bits without compression"
        )));
    }
    let cells = u64::from(width) * u64::from(height);
    if cells > MAX_CELLS as u64 {
        return Err(LidarError::TooManyCells { cells, max: MAX_CELLS });
    }
    if cells == 0 {
        return Err(bad(format!("it has {width}x{height} pixels")));
    }
    let (columns, rows, pixel_bytes) = (width as usize, height as usize, bits as usize / 8);
    let row_bytes = (columns * pixel_bytes).next_multiple_of(4);
    let pixels = bytes.get(header.pixels_at..).and_then(|rest| rest.get(..row_bytes * rows));
    let pixels = pixels.ok_or_else(|| bad(format!("it ends before its {width}x{height} pixels do")))?;
    let palette_at = FILE_HEADER_BYTES.saturating_add(header_bytes as usize);
    let (palette, _) = bytes.get(palette_at..header.pixels_at).unwrap_or_default().as_chunks::<4>();

    let mut rgb = Vec::with_capacity(3 * columns * rows);
    for row in 0..rows {
        let row = if header.is_top_first { row } else { rows - 1 - row };
        let row = &pixels[row * row_bytes..][..columns * pixel_bytes];
        for pixel in row.chunks_exact(pixel_bytes) {
            let colour = match pixel {
                [index] => {
                    palette.get(usize::from(*index)).map(|[blue, green, red, _]| [*red, *green, *blue])
                }
                [blue, green, red, ..] => Some([*red, *green, *blue]),
                _ => None,
            };
            rgb.extend(colour.ok_or_else(|| bad("a pixel has no colour in its palette".to_string()))?);
        }
    }
    let image = RgbImage::from_raw(width, height, rgb).map(DynamicImage::from);
    image.ok_or_else(|| bad(format!("it has {width}x{height} pixels")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::ros::raster;

    /// Returns a BMP of 3 x 2 pixels, the first row first; a negative height and a palette of greys if asked for.
    fn bmp(bits: u16, rows: [[u8; 3]; 2], is_top_first: bool) -> Vec<u8> {
        let palette: Vec<u8> =
            if bits == 8 { (0..=255u8).flat_map(|grey| [grey, grey, grey, 0]).collect() } else { Vec::new() };
        let height: i32 = if is_top_first { -2 } else { 2 };
        let mut bytes =
            [b"BM".to_vec(), vec![0; 8], (54 + palette.len() as u32).to_le_bytes().to_vec()].concat();
        for word in [40, 3, height.cast_unsigned(), (u32::from(bits) << 16) | 1, 0, 0, 0, 0, 0, 0] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(palette);
        let rows = if is_top_first { rows } else { [rows[1], rows[0]] };
        for row in rows {
            let row: Vec<u8> = row.iter().flat_map(|grey| vec![*grey; usize::from(bits) / 8]).collect();
            bytes.extend(&row);
            bytes.extend(vec![0; row.len().next_multiple_of(4) - row.len()]);
        }
        bytes
    }

    const ROWS: [[u8; 3]; 2] = [[0, 205, 254], [10, 20, 30]];

    #[test]
    fn images_of_each_depth_and_order_are_read() {
        for (bits, is_top_first) in [(8, false), (24, false), (32, false), (8, true), (24, true)] {
            let image = raster::decode(&bmp(bits, ROWS, is_top_first), "a.bmp").unwrap();
            assert_eq!(image.to_luma8().into_raw(), ROWS.concat(), "{bits} {is_top_first}");
        }
        let mut coloured = bmp(24, ROWS, true);
        coloured[54..57].copy_from_slice(&[1, 2, 3]);
        let image = decode(&coloured, "a.bmp").unwrap().to_rgb8();
        assert_eq!(image.get_pixel(0, 0).0, [3, 2, 1], "blue comes first");
    }

    #[test]
    fn images_that_cannot_be_used_are_refused() {
        let good = bmp(8, ROWS, false);
        let edited = |at: usize, with: &[u8]| {
            let mut bytes = good.clone();
            bytes[at..at + with.len()].copy_from_slice(with);
            bytes
        };
        for (what, bytes, code) in [
            ("half a header", good[..30].to_vec(), "bad_image"),
            ("half an image", good[..good.len() - 1].to_vec(), "bad_image"),
            ("pixels far away", edited(10, &[0xff; 4]), "bad_image"),
            ("a short header", edited(14, &[12]), "bad_image"),
            ("a long header", edited(14, &[0xff; 4]), "bad_image"),
            ("no width", edited(18, &[0]), "bad_image"),
            ("a wide image", edited(18, &[0xff; 4]), "too_many_cells"),
            ("the lowest height", edited(22, &[0, 0, 0, 0x80]), "too_many_cells"),
            ("4 bits", edited(28, &[4]), "bad_image"),
            ("run lengths", edited(30, &[1]), "bad_image"),
        ] {
            let error = decode(&bytes, "a.bmp").unwrap_err();
            assert_eq!(error.code(), code, "{what}: {error}");
        }
    }
}
