//! Words in pictures.

use font8x8::{BASIC_FONTS, UnicodeFonts};
use image::{Rgb, RgbImage};

/// Writes a line with letters `side` pixels wide and high; what does not fit is cut off.
pub fn write(canvas: &mut RgbImage, left: u32, top: u32, side: u32, ink: Rgb<u8>, words: &str) {
    let letters = words.chars().map(|letter| BASIC_FONTS.get(letter).unwrap_or_default());
    for (place, rows) in (0..).zip(letters) {
        for y in 0..side {
            for x in 0..side {
                let at = (left + place * side + x, top + y);
                let set = rows[(y * 8 / side) as usize] >> (x * 8 / side) & 1 == 1;
                if set && at.0 < canvas.width() && at.1 < canvas.height() {
                    canvas.put_pixel(at.0, at.1, ink);
                }
            }
        }
    }
}
