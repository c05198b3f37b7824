//! Pictures inside of a large file: raw pixels, packed pixels, or files of their own.

use super::files::{Coding, Part};
use super::{ClipError, DepthImage, depth, picture, rvl};
use flate2::read::ZlibDecoder;
use image::RgbImage;
use std::io::Read;
use viola_geometry::Pinhole;

impl Part {
    /// Decodes a colour picture: JPEG, PNG, or three bytes per pixel.
    pub(super) fn decode_color(&self, bytes: Vec<u8>, camera: &Pinhole) -> Result<RgbImage, ClipError> {
        let name = self.name("colour");
        let bad = |reason: String| ClipError::BadPicture { name: name.clone(), reason };
        match self.coding {
            Coding::Picture => picture::decode_color(&bytes, &name, camera),
            Coding::Raw((width, height)) => {
                let length = bytes.len();
                // The library also accepts too many bytes.
                let is_exact = length as u64 == u64::from(width) * u64::from(height) * 3;
                let image = if is_exact { RgbImage::from_raw(width, height, bytes) } else { None };
                image
                    .ok_or_else(|| bad(format!("{length} bytes instead of those of {width}x{height} pixels")))
            }
            Coding::Rows(rows) => {
                self.check_size("colour", (rows.width, rows.height), camera)?;
                let length = bytes.len();
                rows.color(&bytes).ok_or_else(|| bad(format!("{length} bytes are not those of {rows:?}")))
            }
            Coding::Zlib | Coding::Rvl(_) | Coding::FloatPicture | Coding::InversePicture { .. } => {
                Err(bad("it is packed as depth is".into()))
            }
        }
    }

    /// Decodes depth; numbers of 16 bits begin with the least significant byte.
    pub(super) fn decode_depth(
        &self,
        bytes: &[u8],
        camera: &Pinhole,
        units_per_m: f32,
    ) -> Result<DepthImage, ClipError> {
        let (width, height) = (camera.width, camera.height);
        let name = self.name("depth");
        let bad = |reason: String| ClipError::BadDepth { name: name.clone(), reason };
        let metres = |units| depth::metres(units, units_per_m);
        let of_bytes =
            |bytes: &[u8]| bytes.as_chunks().0.iter().map(|b| metres(u16::from_le_bytes(*b))).collect();
        let pixels = width as usize * height as usize;
        let depth_m: Vec<f32> = match self.coding {
            Coding::Raw(_) => of_bytes(bytes),
            Coding::Zlib => {
                let mut unpacked = Vec::new();
                let mut reader = ZlibDecoder::new(bytes).take(pixels as u64 * 2 + 1);
                reader
                    .read_to_end(&mut unpacked)
                    .map_err(|error| bad(format!("it is not zlib ({error})")))?;
                if unpacked.len() != pixels * 2 {
                    return Err(bad(format!(
                        "{} bytes instead of those of {width}x{height} readings",
                        unpacked.len()
                    )));
                }
                of_bytes(&unpacked)
            }
            Coding::Rvl(size) => {
                self.check_size("depth", size, camera)?;
                let readings = rvl::unpack(bytes, pixels);
                let readings = readings.ok_or_else(|| bad(format!("it is not RVL of {width}x{height}")))?;
                readings.into_iter().map(metres).collect()
            }
            Coding::Rows(rows) => {
                self.check_size("depth", (rows.width, rows.height), camera)?;
                let readings = rows.depth_m(bytes, units_per_m);
                readings.ok_or_else(|| bad(format!("{} bytes are not those of {rows:?}", bytes.len())))?
            }
            Coding::Picture => return picture::decode_depth(bytes, &name, camera, metres),
            Coding::FloatPicture => return picture::decode_float_depth(bytes, &name, camera),
            Coding::InversePicture { a, b } => {
                let inverse = |reading: u16| {
                    if reading == 0 { 0.0 } else { depth::valid(a / (f32::from(reading) - b)) }
                };
                return picture::decode_depth(bytes, &name, camera, inverse);
            }
        };
        if depth_m.len() != pixels {
            return Err(bad(format!("{} bytes instead of those of {width}x{height} readings", bytes.len())));
        }
        Ok(DepthImage { width, height, depth_m })
    }

    fn check_size(&self, kind: &str, size: (u32, u32), camera: &Pinhole) -> Result<(), ClipError> {
        picture::check_size(&self.name(kind), size, camera)
    }
}
