//! The image of a ROS map: decoded, and its grey values read as occupancy.

use super::yaml::{Description, Mode};
use crate::lidar::{Cell, LidarError, MAX_CELLS};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Maximum size of the decoded image.
const MAX_IMAGE_BYTES: u64 = 256 << 20;

/// Decodes a PGM, PNG or BMP image. Values of a PGM whose white is not 255 or 65535 are scaled up to that.
pub(super) fn decode(bytes: &[u8], name: &str) -> Result<DynamicImage, LidarError> {
    let bad = |reason: String| LidarError::BadImage { name: name.to_string(), reason };
    let (format, bytes_per_cell) = match bytes {
        [b'P', b'2' | b'5', ..] => (ImageFormat::Pnm, 1),
        [0x89, b'P', b'N', b'G', ..] => (ImageFormat::Png, 0),
        [b'B', b'M', ..] => (ImageFormat::Bmp, 0),
        _ => return Err(bad("it is neither PGM, PNG nor BMP".to_string())),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_IMAGE_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|error| bad(error.to_string()))?;
    let (width, height) = decoder.dimensions();
    let cells = u64::from(width) * u64::from(height);
    if cells > MAX_CELLS as u64 {
        return Err(LidarError::TooManyCells { cells, max: MAX_CELLS });
    }
    if cells == 0 || decoder.total_bytes() > MAX_IMAGE_BYTES {
        return Err(bad(format!("it has {width}x{height} pixels of {:?}", decoder.color_type())));
    }
    // A PGM is not compressed, so its size is checked before anything is allocated.
    if (bytes.len() as u64) < cells * bytes_per_cell {
        return Err(bad(format!("it ends before its {width}x{height} pixels do")));
    }
    DynamicImage::from_decoder(decoder).map(without_opaque_alpha).map_err(|error| bad(error.to_string()))
}

/// Returns an image without an alpha channel that is opaque everywhere. Image editors add one, and the average of map_server
/// would make unknown cells free by it.
fn without_opaque_alpha(image: DynamicImage) -> DynamicImage {
    match &image {
        DynamicImage::ImageLumaA8(of) if of.pixels().all(|p| p.0[1] == u8::MAX) => image.to_luma8().into(),
        DynamicImage::ImageRgba8(of) if of.pixels().all(|p| p.0[3] == u8::MAX) => image.to_rgb8().into(),
        DynamicImage::ImageLumaA16(of) if of.pixels().all(|p| p.0[1] == u16::MAX) => image.to_luma16().into(),
        DynamicImage::ImageRgba16(of) if of.pixels().all(|p| p.0[3] == u16::MAX) => image.to_rgb16().into(),
        _ => image,
    }
}

/// Map savers' value for unknown, besides 254 for free and 0 for occupied.
const SAVED_UNKNOWN: u8 = 205;
const SAVED_FREE: u8 = 254;
/// nav2's saver writes this `free_thresh` by default.
const NAV2_FREE_THRESHOLD: f64 = 0.25;
/// Minimum fraction of 205 among the pixels of a saver's image that was edited; if it is lower, half of the border
/// has to be 205.
const MIN_UNKNOWN_FRACTION: f64 = 0.03;

/// Returns whether a map saver wrote the image and the file's `free_thresh` would make unknown cells free:
/// 205 is an occupancy of 0.196. Editors add other values and save grey as red, green and blue.
pub(super) fn is_saved_with_wide_threshold(image: &DynamicImage, description: &Description) -> bool {
    let saved_occupancy = 1.0 - f64::from(SAVED_UNKNOWN) / 255.0;
    if description.mode != Mode::Trinary || description.negate || description.free_thresh <= saved_occupancy {
        return false;
    }
    let Some(count) = Count::of(image) else { return false };
    let is_frequent = count.unknown as f64 >= MIN_UNKNOWN_FRACTION * count.pixels as f64
        || 2 * count.unknown_at_border > count.border;
    count.free > 0
        && count.unknown > 0
        && (count.edited == 0 || (description.free_thresh <= NAV2_FREE_THRESHOLD && is_frequent))
}

/// Numbers of pixels of an image by the values of map savers.
#[derive(Default)]
struct Count {
    pixels: usize,
    border: usize,
    free: usize,
    unknown: usize,
    unknown_at_border: usize,
    /// Pixels of no saver's value.
    edited: usize,
}

impl Count {
    /// Counts the pixels of an 8-bit image without alpha; `None` for other images.
    fn of(image: &DynamicImage) -> Option<Count> {
        let channels = match image {
            DynamicImage::ImageLuma8(_) => 1,
            DynamicImage::ImageRgb8(_) => 3,
            _ => return None,
        };
        let (width, height) = (image.width() as usize, image.height() as usize);
        let mut count = Count::default();
        for (index, pixel) in image.as_bytes().chunks_exact(channels).enumerate() {
            let (x, y) = (index % width, index / width);
            let is_border = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
            count.pixels += 1;
            count.border += usize::from(is_border);
            let is_grey = pixel.iter().all(|value| *value == pixel[0]);
            match pixel[0] {
                SAVED_UNKNOWN if is_grey => {
                    count.unknown += 1;
                    count.unknown_at_border += usize::from(is_border);
                }
                SAVED_FREE if is_grey => count.free += 1,
                0 if is_grey => {}
                _ => count.edited += 1,
            }
        }
        Some(count)
    }
}

/// Returns one cell per pixel, row by row from the bottom; the image begins at the top.
pub(super) fn classify(image: &DynamicImage, description: &Description) -> Vec<Cell> {
    let channels = usize::from(image.color().channel_count());
    let is_wide = image.as_flat_samples_u16().is_some();
    let rule = Rule {
        color_channels: if image.color().has_alpha() { channels - 1 } else { channels },
        max_value: if is_wide { 65_535.0 } else { 255.0 },
        mode: description.mode,
        negate: description.negate,
        occupied: description.occupied_thresh,
        free: description.free_thresh,
    };
    let row_values = image.width() as usize * channels;
    if let Some(samples) = image.as_flat_samples_u8() {
        rows(samples.samples, row_values, channels, &rule)
    } else if let Some(samples) = image.as_flat_samples_u16() {
        rows(samples.samples, row_values, channels, &rule)
    } else {
        // No format here decodes to floating point; such an image would be unknown everywhere.
        vec![Cell::Unknown; image.width() as usize * image.height() as usize]
    }
}

fn rows<T: Copy + Into<u32>>(samples: &[T], row_values: usize, channels: usize, rule: &Rule) -> Vec<Cell> {
    let rows_from_bottom = samples.chunks_exact(row_values).rev();
    rows_from_bottom.flat_map(|row| row.chunks_exact(channels)).map(|pixel| rule.cell(pixel)).collect()
}

/// map_server's interpretation of a pixel.
struct Rule {
    /// A channel after these is alpha.
    color_channels: usize,
    max_value: f64,
    mode: Mode,
    negate: bool,
    occupied: f64,
    free: f64,
}

impl Rule {
    fn cell<T: Copy + Into<u32>>(&self, pixel: &[T]) -> Cell {
        let mean = |values: &[T]| {
            values.iter().map(|&v| f64::from(v.into())).sum::<f64>() / values.len() as f64 / self.max_value
        };
        let is_opaque = pixel[self.color_channels..].iter().all(|&a| f64::from(a.into()) >= self.max_value);
        match self.mode {
            // map_server averages alpha in with red, green and blue here, and writers of transparent images rely on it. A
            // grey value is all three.
            Mode::Trinary => match pixel {
                [grey, alpha] => self.by_threshold(mean(&[*grey, *grey, *grey, *alpha])),
                _ => self.by_threshold(mean(pixel)),
            },
            // Between the thresholds the occupancy is neither a wall's nor free floor's.
            Mode::Scale if is_opaque => self.by_threshold(mean(&pixel[..self.color_channels])),
            Mode::Scale => Cell::Unknown,
            // The value, of 255, is itself the occupancy in whole percent; above 100 it is unknown.
            Mode::Raw => {
                let percent = (mean(&pixel[..self.color_channels]) * 255.0).round();
                match percent / 100.0 {
                    p if p > 1.0 => Cell::Unknown,
                    p if p >= self.occupied => Cell::Occupied,
                    p if p <= self.free => Cell::Free,
                    _ => Cell::Unknown,
                }
            }
        }
    }

    fn by_threshold(&self, shade: f64) -> Cell {
        let occupancy = if self.negate { shade } else { 1.0 - shade };
        if occupancy > self.occupied {
            Cell::Occupied
        } else if occupancy < self.free {
            Cell::Free
        } else {
            Cell::Unknown
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, Luma};

    /// Returns an image of 20 x 20 pixels: free with a wall, and `border` all around.
    fn drawn(border: u8, free: u8) -> GrayImage {
        GrayImage::from_fn(20, 20, |x, y| {
            let is_border = [x, y].iter().any(|v| [0, 19].contains(v));
            Luma([if is_border {
                border
            } else if x == 5 {
                0
            } else {
                free
            }])
        })
    }

    /// Grey values of 3 x 2 pixels, from the uppermost row.
    const GREYS: [u8; 6] = [0, 205, 254, 10, 20, 30];

    /// Returns a BMP of 3 x 2 pixels with these `stored` rows. Pixels of up to 8 bits are indices of a palette of
    /// the grey values.
    fn bmp(bits: u16, compression: u32, height: i32, stored: &[u8]) -> Vec<u8> {
        let palette = if bits <= 8 { GREYS.map(|grey| [grey, grey, grey, 0]).concat() } else { Vec::new() };
        let pixels_at = 54 + palette.len() as u32;
        let colours = palette.len() as u32 / 4;
        let mut bytes = [b"BM".to_vec(), vec![0; 8], pixels_at.to_le_bytes().to_vec()].concat();
        let planes_and_bits = (u32::from(bits) << 16) | 1;
        for word in [40, 3, height.cast_unsigned(), planes_and_bits, compression, 0, 0, 0, colours, 0] {
            bytes.extend(word.to_le_bytes());
        }
        [bytes, palette, stored.to_vec()].concat()
    }

    #[test]
    fn bmps_of_each_depth_and_order_are_read() {
        let rows = |bytes: usize, is_top_first: bool| {
            let [top, bottom] = [0, 1].map(|row| {
                let greys = &GREYS[3 * row..][..3];
                let mut row: Vec<u8> = greys.iter().flat_map(|grey| vec![*grey; bytes]).collect();
                row.resize(row.len().next_multiple_of(4), 0);
                row
            });
            if is_top_first { [top, bottom].concat() } else { [bottom, top].concat() }
        };
        for (what, bytes) in [
            ("4 bits", bmp(4, 0, 2, &[0x34, 0x50, 0, 0, 0x01, 0x20, 0, 0])),
            ("8 bits", bmp(8, 0, 2, &[3, 4, 5, 0, 0, 1, 2, 0])),
            ("8 bits, top first", bmp(8, 0, -2, &[0, 1, 2, 0, 3, 4, 5, 0])),
            ("run lengths", bmp(8, 1, 2, &[1, 3, 1, 4, 1, 5, 0, 0, 1, 0, 1, 1, 1, 2, 0, 1])),
            ("24 bits", bmp(24, 0, 2, &rows(3, false))),
            ("24 bits, top first", bmp(24, 0, -2, &rows(3, true))),
            ("32 bits", bmp(32, 0, 2, &rows(4, false))),
        ] {
            let image = decode(&bytes, "a.bmp").unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!(image.to_luma8().into_raw(), GREYS, "{what}");
        }
        let mut coloured = bmp(24, 0, -2, &rows(3, true));
        coloured[54..57].copy_from_slice(&[1, 2, 3]);
        let image = decode(&coloured, "a.bmp").unwrap().to_rgb8();
        assert_eq!(image.get_pixel(0, 0).0, [3, 2, 1], "blue comes first");
    }

    #[test]
    fn bmps_that_cannot_be_used_are_refused() {
        let good = bmp(8, 0, 2, &[3, 4, 5, 0, 0, 1, 2, 0]);
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
            ("a negative width", edited(18, &[0xff; 4]), "bad_image"),
            ("a wide image", edited(18, &[0xff, 0xff, 0, 0, 0xff, 0xff]), "too_many_cells"),
            ("a high image, top first", edited(22, &[1, 0, 0, 0x80]), "too_many_cells"),
            ("the lowest height", edited(22, &[0, 0, 0, 0x80]), "bad_image"),
            ("5 bits", edited(28, &[5]), "bad_image"),
            ("run lengths that end early", bmp(8, 1, 2, &[1, 3]), "bad_image"),
            ("a PNG inside", edited(30, &[5]), "bad_image"),
            ("257 colours", edited(46, &[1, 1]), "bad_image"),
        ] {
            let error = decode(&bytes, "a.bmp").unwrap_err();
            assert_eq!(error.code(), code, "{what}: {error}");
        }
    }

    fn edited(mut image: GrayImage, values: &[u8]) -> GrayImage {
        for (index, value) in values.iter().enumerate() {
            image.put_pixel(index as u32 % 10 + 6, index as u32 / 10 + 1, Luma([*value]));
        }
        image
    }

    fn description(free_thresh: f64, mode: Mode, negate: bool) -> Description {
        Description {
            image: String::new(),
            resolution: 0.05,
            origin: [0.0; 3],
            negate,
            occupied_thresh: 0.65,
            free_thresh,
            mode,
        }
    }

    #[test]
    fn the_percent_of_a_raw_image_is_rounded() {
        let raw = description(0.1, Mode::Raw, false);
        let colours = [[100, 100, 101], [101, 101, 100], [64, 65, 65], [10, 10, 11], [0, 0, 1]];
        let image = image::RgbImage::from_fn(5, 1, |x, _| image::Rgb(colours[x as usize]));
        assert_eq!(
            classify(&image.into(), &raw),
            [Cell::Occupied, Cell::Unknown, Cell::Occupied, Cell::Free, Cell::Free]
        );
    }

    #[test]
    fn alpha_counts_only_in_an_image_with_transparency() {
        let trinary = description(0.196, Mode::Trinary, false);
        let greys = [0, 205, 254];
        for (alpha, unknown) in [(255, Cell::Unknown), (254, Cell::Free)] {
            let grey = image::GrayAlphaImage::from_fn(3, 1, |x, _| image::LumaA([greys[x as usize], alpha]));
            let colour = image::RgbaImage::from_fn(3, 1, |x, _| {
                let grey = greys[x as usize];
                image::Rgba([grey, grey, grey, alpha])
            });
            let colour = DynamicImage::from(colour);
            let wide = DynamicImage::ImageRgba16(colour.to_rgba16());
            for (what, image) in [("grey", DynamicImage::from(grey)), ("colour", colour), ("16 bits", wide)] {
                let cells = classify(&without_opaque_alpha(image), &trinary);
                assert_eq!(cells, [Cell::Occupied, unknown, Cell::Free], "{what} {alpha}");
            }
        }
    }

    #[test]
    fn the_unknown_of_a_saver_is_found_in_an_edited_image() {
        let saved = drawn(205, 254);
        let rgb = |image: &GrayImage| DynamicImage::from(image.clone()).to_rgb8();
        let mut tinted = rgb(&saved);
        tinted.put_pixel(9, 9, image::Rgb([205, 205, 0]));
        // 11 and 13 of 400 pixels are 2.75 % and 3.25 %.
        let few = edited(drawn(254, 254), &[[205; 11].as_slice(), &[255]].concat());
        let enough = edited(drawn(254, 254), &[[205; 13].as_slice(), &[255]].concat());
        let one = edited(drawn(254, 254), &[205]);
        let cases: [(&str, DynamicImage, bool); 10] = [
            ("saved", saved.clone().into(), true),
            ("saved, one unknown", one.into(), true),
            ("no unknown", drawn(254, 254).into(), false),
            ("one eraser stroke", edited(saved.clone(), &[255; 40]).into(), true),
            ("one anti-aliased pixel", edited(saved.clone(), &[127]).into(), true),
            ("red, green and blue", rgb(&saved).into(), true),
            ("colour", tinted.into(), true),
            ("more than 3 % unknown", enough.into(), true),
            ("less than 3 % unknown", few.into(), false),
            ("another white", drawn(205, 250).into(), false),
        ];
        let nav2 = description(0.25, Mode::Trinary, false);
        for (what, image, expected) in cases {
            assert_eq!(is_saved_with_wide_threshold(&image, &nav2), expected, "{what}");
        }
        let stroke: DynamicImage = edited(saved, &[255]).into();
        for (free_thresh, mode, negate) in [
            (0.196, Mode::Trinary, false),
            (0.3, Mode::Trinary, false),
            (0.25, Mode::Scale, false),
            (0.25, Mode::Trinary, true),
        ] {
            let other = description(free_thresh, mode, negate);
            assert!(!is_saved_with_wide_threshold(&stroke, &other), "{free_thresh} {negate}");
        }
    }

    #[test]
    fn an_unknown_border_of_a_large_image_is_enough() {
        // The border has 796 of 40 000 pixels: 2 %.
        let large = |border: u8| {
            GrayImage::from_fn(200, 200, |x, y| {
                let is_border = [x, y].iter().any(|v| [0, 199].contains(v));
                Luma([if is_border {
                    border
                } else if x == 5 {
                    255
                } else {
                    254
                }])
            })
        };
        let nav2 = description(0.25, Mode::Trinary, false);
        assert!(is_saved_with_wide_threshold(&large(205).into(), &nav2));
        assert!(!is_saved_with_wide_threshold(&edited(large(254), &[205]).into(), &nav2));
    }
}
