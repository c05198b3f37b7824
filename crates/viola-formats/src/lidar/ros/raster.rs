//! The image of a ROS map: decoded, and its grey values read as occupancy.

use super::{Description, Mode, Switch};
use crate::lidar::{Cell, LidarError, MAX_CELLS};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Maximum size of the decoded image.
const MAX_IMAGE_BYTES: u64 = 256 << 20;

/// Decodes a PGM or PNG image. Values of a PGM whose white is not 255 or 65535 are scaled up to that.
pub(super) fn decode(bytes: &[u8], name: &str) -> Result<DynamicImage, LidarError> {
    let bad = |reason: String| LidarError::BadImage { name: name.to_string(), reason };
    let (format, bytes_per_cell) = match bytes {
        [b'P', b'2' | b'5', ..] => (ImageFormat::Pnm, 1),
        [0x89, b'P', b'N', b'G', ..] => (ImageFormat::Png, 0),
        _ => return Err(bad("it is neither PGM nor PNG".to_string())),
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
    DynamicImage::from_decoder(decoder).map_err(|error| bad(error.to_string()))
}

/// Map savers' value for unknown, besides 254 for free and 0 for occupied.
const SAVED_UNKNOWN: u8 = 205;
const SAVED_VALUES: [u8; 3] = [0, SAVED_UNKNOWN, 254];

/// Returns whether a map saver wrote the image and the file's `free_thresh` would make unknown cells free.
/// nav2's saver writes 0.25 by default, and 205 is an occupancy of 0.196.
pub(super) fn is_saved_with_wide_threshold(image: &DynamicImage, description: &Description) -> bool {
    let DynamicImage::ImageLuma8(grey) = image else { return false };
    let saved_occupancy = 1.0 - f64::from(SAVED_UNKNOWN) / 255.0;
    description.mode == Mode::Trinary
        && !negates(description)
        && description.free_thresh > saved_occupancy
        && grey.as_raw().contains(&254)
        && grey.as_raw().iter().all(|value| SAVED_VALUES.contains(value))
}

fn negates(description: &Description) -> bool {
    match description.negate {
        Some(Switch::Bool(negate)) => negate,
        Some(Switch::Number(negate)) => negate != 0,
        None => false,
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
        negate: negates(description),
        occupied: description.occupied_thresh,
        free: description.free_thresh,
    };
    let row_values = image.width() as usize * channels;
    if let Some(samples) = image.as_flat_samples_u8() {
        rows(samples.samples, row_values, channels, &rule)
    } else if let Some(samples) = image.as_flat_samples_u16() {
        rows(samples.samples, row_values, channels, &rule)
    } else {
        // Neither PGM nor PNG decodes to floating point; such an image would be unknown everywhere.
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
            // map_server averages alpha in with red, green and blue here, and writers rely on it. A grey value is all
            // three.
            Mode::Trinary => match pixel {
                [grey, alpha] => self.by_threshold(mean(&[*grey, *grey, *grey, *alpha])),
                _ => self.by_threshold(mean(pixel)),
            },
            // Between the thresholds the occupancy is neither a wall's nor free floor's.
            Mode::Scale if is_opaque => self.by_threshold(mean(&pixel[..self.color_channels])),
            Mode::Scale => Cell::Unknown,
            // The value, of 255, is itself the occupancy in percent; above 100 it is unknown.
            Mode::Raw => {
                let percent = mean(&pixel[..self.color_channels]) * 255.0;
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
