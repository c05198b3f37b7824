//! Captions of pictures.

use super::svg::{FONT_FAMILY, escape, hex, render};
use image::{Rgb, RgbImage};

/// Writes a line with letters `height` pixels high; the part beyond the picture is cut off.
pub fn write(canvas: &mut RgbImage, left: u32, top: u32, height: u32, ink: Rgb<u8>, words: &str) {
    let Some(width) = canvas.width().checked_sub(left).filter(|width| *width > 0) else { return };
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{}\" font-family=\"{FONT_FAMILY}\">\
         <text y=\"{height}\" font-size=\"{height}\" fill=\"{}\">{}</text></svg>",
        height * 3 / 2,
        hex(ink.0),
        escape(words)
    );
    let line = render(&svg, 1.0);
    for (place, pixel) in (0..).zip(line.pixels()) {
        let (x, y) = (left + place % line.width(), top + place / line.width());
        if pixel.alpha() == 0 || x >= canvas.width() || y >= canvas.height() {
            continue;
        }
        // The colours of `line` are premultiplied.
        let under = 255 - u32::from(pixel.alpha());
        let over = [pixel.red(), pixel.green(), pixel.blue()];
        let Rgb(channels) = canvas.get_pixel_mut(x, y);
        for (channel, over) in channels.iter_mut().zip(over) {
            *channel = (u32::from(over) + under * u32::from(*channel) / 255) as u8;
        }
    }
}
