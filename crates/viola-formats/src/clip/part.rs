//! Pictures inside of a large file: raw pixels, packed pixels, or files of their own.

use super::files::{Coding, Part};
use super::{ClipError, DepthImage, depth, picture};
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
            Coding::Zlib => Err(bad("colour is not packed with zlib".into())),
        }
    }

    /// Decodes depth of 16 bits, least significant byte first.
    pub(super) fn decode_depth(
        &self,
        bytes: &[u8],
        camera: &Pinhole,
        units_per_m: f32,
    ) -> Result<DepthImage, ClipError> {
        let (width, height) = (camera.width, camera.height);
        let wanted = width as usize * height as usize * 2;
        let bad = |reason: String| ClipError::BadDepth { name: self.name("depth"), reason };
        let mut unpacked = Vec::new();
        let bytes = match self.coding {
            Coding::Raw(_) => bytes,
            Coding::Zlib => {
                let mut reader = ZlibDecoder::new(bytes).take(wanted as u64 + 1);
                reader
                    .read_to_end(&mut unpacked)
                    .map_err(|error| bad(format!("it is not zlib ({error})")))?;
                &unpacked
            }
            Coding::Picture => return Err(bad("depth is raw or packed with zlib".into())),
        };
        if bytes.len() != wanted {
            return Err(bad(format!("{} bytes instead of those of {width}x{height} readings", bytes.len())));
        }
        let metres = |bytes: &[u8; 2]| depth::metres(u16::from_le_bytes(*bytes), units_per_m);
        Ok(DepthImage { width, height, depth_m: bytes.as_chunks().0.iter().map(metres).collect() })
    }
}
