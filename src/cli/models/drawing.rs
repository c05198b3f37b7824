//! Classes drawn over a picture, with a legend beside it.

use image::{Rgb, RgbImage};
use viola_geometry::taxonomy::Class;
use viola_home::write_words;

/// Opacity of the class colours over the picture.
const COVER: f32 = 0.6;
/// Sizes in pixels: side of a letter, height of a legend's line, width of the legend.
const LETTER: u32 = 16;
const LINE: u32 = 24;
const LEGEND: u32 = 380;
const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const INK: Rgb<u8> = Rgb([32, 32, 32]);

/// Returns the picture with its classes, and with their shares beside it. `classes` has one entry for each pixel, row after row.
pub(super) fn drawing(picture: &RgbImage, classes: &[Class], shares: &[(Class, f64)]) -> RgbImage {
    let (width, height) = picture.dimensions();
    let mut canvas =
        RgbImage::from_pixel(width + LEGEND, height.max(LINE * shares.len() as u32 + LINE), PAPER);
    for (class, (x, y, pixel)) in classes.iter().zip(picture.enumerate_pixels()) {
        let color = class.color();
        let blend = [0, 1, 2]
            .map(|c| (COVER * f32::from(color[c]) + (1.0 - COVER) * f32::from(pixel.0[c])).round() as u8);
        canvas.put_pixel(x, y, Rgb(blend));
    }
    for (line, (class, share)) in shares.iter().enumerate() {
        let top = LINE / 2 + LINE * line as u32;
        square(&mut canvas, width + LETTER, top, Rgb(class.color()));
        let words = format!("{} {:.1}%", class.name().replace('_', " "), share * 100.0);
        write_words(&mut canvas, width + 3 * LETTER, top, LETTER, INK, &words);
    }
    canvas
}

fn square(canvas: &mut RgbImage, left: u32, top: u32, color: Rgb<u8>) {
    for y in 0..LETTER {
        for x in 0..LETTER {
            let edge = x == 0 || y == 0 || x == LETTER - 1 || y == LETTER - 1;
            canvas.put_pixel(left + x, top + y, if edge { INK } else { color });
        }
    }
}
