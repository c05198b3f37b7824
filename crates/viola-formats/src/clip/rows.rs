//! Bare pixels as ROS has them: rows of a stride, in one of a few encodings (ros2/common_interfaces,
//! sensor_msgs/msg/Image.msg and image_encodings.hpp).

use super::depth;
use image::RgbImage;

/// The layout of a picture's bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rows {
    pub encoding: Encoding,
    pub is_big_endian: bool,
    pub width: u32,
    pub height: u32,
    /// Bytes from one row to the next.
    pub stride: u32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    /// Millimetres of 16 bits.
    Depth16,
    /// Metres as 32-bit floats.
    DepthFloat,
    /// Channels of a pixel, and the places of red, green and blue among them.
    Color { channels: usize, rgb: [usize; 3] },
}

impl Encoding {
    /// Returns the encoding of this name, or `None` if it is not read.
    pub fn of(name: &str) -> Option<Encoding> {
        Some(match name {
            "16UC1" | "mono16" => Encoding::Depth16,
            "32FC1" => Encoding::DepthFloat,
            "rgb8" | "8UC3" => Encoding::Color { channels: 3, rgb: [0, 1, 2] },
            "bgr8" => Encoding::Color { channels: 3, rgb: [2, 1, 0] },
            "rgba8" => Encoding::Color { channels: 4, rgb: [0, 1, 2] },
            "bgra8" => Encoding::Color { channels: 4, rgb: [2, 1, 0] },
            "mono8" | "8UC1" => Encoding::Color { channels: 1, rgb: [0, 0, 0] },
            _ => return None,
        })
    }

    pub fn is_depth(self) -> bool {
        !matches!(self, Encoding::Color { .. })
    }

    fn pixel_bytes(self) -> usize {
        match self {
            Encoding::Depth16 => 2,
            Encoding::DepthFloat => 4,
            Encoding::Color { channels, .. } => channels,
        }
    }
}

impl Rows {
    /// Returns the number of bytes of the picture; `None` if a row is longer than the stride.
    pub fn bytes(&self) -> Option<u64> {
        let row = u64::from(self.width) * self.encoding.pixel_bytes() as u64;
        (row <= u64::from(self.stride)).then(|| u64::from(self.stride) * u64::from(self.height))
    }

    /// Returns the depth in metres, row by row; `None` if the bytes are too few.
    pub fn depth_m(&self, bytes: &[u8], units_per_m: f32) -> Option<Vec<f32>> {
        let metres: fn(&Rows, &[u8], f32) -> Option<f32> = match self.encoding {
            Encoding::Depth16 => |rows, pixel, units_per_m| {
                let units = pixel.first_chunk().copied()?;
                let from = if rows.is_big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
                Some(depth::metres(from(units), units_per_m))
            },
            Encoding::DepthFloat => |rows, pixel, _| {
                let metres = pixel.first_chunk().copied()?;
                let from = if rows.is_big_endian { f32::from_be_bytes } else { f32::from_le_bytes };
                Some(depth::valid(from(metres)))
            },
            Encoding::Color { .. } => return None,
        };
        self.pixels(bytes)?.map(|pixel| metres(self, pixel, units_per_m)).collect()
    }

    /// Returns the colour picture; `None` if the bytes are too few.
    pub fn color(&self, bytes: &[u8]) -> Option<RgbImage> {
        let Encoding::Color { rgb, .. } = self.encoding else { return None };
        let pixels = self.pixels(bytes)?.flat_map(|pixel| rgb.map(|channel| pixel[channel]));
        RgbImage::from_raw(self.width, self.height, pixels.collect())
    }

    fn pixels<'a>(&self, bytes: &'a [u8]) -> Option<impl Iterator<Item = &'a [u8]>> {
        let (stride, pixel_bytes) = (self.stride as usize, self.encoding.pixel_bytes());
        let row_bytes = self.width as usize * pixel_bytes;
        let whole = bytes.get(..usize::try_from(self.bytes()?).ok()?)?;
        let rows = whole.chunks_exact(stride.max(1));
        Some(rows.flat_map(move |row| row[..row_bytes].chunks_exact(pixel_bytes)))
    }
}
