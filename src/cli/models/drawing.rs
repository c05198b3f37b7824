//! Classes drawn over a picture, with a legend beside it.

use image::{ImageResult, Rgb, RgbImage};
use std::path::Path;
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

pub(super) struct Drawing(RgbImage);

impl Drawing {
    /// `classes` has one entry for each pixel, row after row.
    pub(super) fn new(picture: &RgbImage, classes: &[Class], shares: &[(Class, f64)]) -> Drawing {
        let (width, height) = picture.dimensions();
        let mut canvas =
            RgbImage::from_pixel(width + LEGEND, height.max(LINE * shares.len() as u32 + LINE), PAPER);
        for (class, (x, y, pixel)) in classes.iter().zip(picture.enumerate_pixels()) {
            let color = class.color();
            let blend = [0, 1, 2]
                .map(|c| (COVER * f32::from(color[c]) + (1.0 - COVER) * f32::from(pixel.0[c])).round() as u8);
            canvas.put_pixel(x, y, Rgb(blend));
        }
        let mut drawing = Drawing(canvas);
        for (line, (class, share)) in shares.iter().enumerate() {
            let top = LINE / 2 + LINE * line as u32;
            drawing.square(width + LETTER, top, Rgb(class.color()));
            let words = format!("{} {:.1}%", class.name().replace('_', " "), share * 100.0);
            write_words(&mut drawing.0, width + 3 * LETTER, top, LETTER, INK, &words);
        }
        drawing
    }

    pub(super) fn save(&self, path: &Path) -> ImageResult<()> {
        self.0.save_with_format(path, image::ImageFormat::Png)
    }

    fn square(&mut self, left: u32, top: u32, color: Rgb<u8>) {
        for y in 0..LETTER {
            for x in 0..LETTER {
                let edge = x == 0 || y == 0 || x == LETTER - 1 || y == LETTER - 1;
                self.0.put_pixel(left + x, top + y, if edge { INK } else { color });
            }
        }
    }
}
