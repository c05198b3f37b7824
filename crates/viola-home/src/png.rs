//! Pictures as PNG files.

use image::{ImageFormat, RgbImage};
use std::io::Cursor;

pub fn png(picture: &RgbImage) -> Vec<u8> {
    let mut png = Cursor::new(Vec::new());
    // Writing into memory cannot fail.
    let _ = picture.write_to(&mut png, ImageFormat::Png);
    png.into_inner()
}
