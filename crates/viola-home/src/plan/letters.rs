//! Smooth letters out of a small bitmap font, for pictures without a font of their own.

use font8x8::{BASIC_FONTS, GREEK_FONTS, LATIN_FONTS, MISC_FONTS, UnicodeFonts};
use tiny_skia::{Color, Pixmap, PremultipliedColorU8};

/// A letter's cell is this much wider than its capitals are high.
const ADVANCE: f64 = 0.92;

pub fn width_px(words: &str, height_px: f64) -> f64 {
    words.chars().count() as f64 * height_px * ADVANCE
}

/// Writes a line around its middle. `height_px` is that of the capitals.
pub fn write(canvas: &mut Pixmap, middle: [f64; 2], height_px: f64, ink: [u8; 3], bold: bool, words: &str) {
    // Capitals are seven of the bitmap's eight rows.
    let cell = height_px * 8.0 / 7.0;
    let advance = height_px * ADVANCE;
    let left = middle[0] - width_px(words, height_px) / 2.0;
    let top = middle[1] - height_px / 2.0;
    for (place, letter) in words.chars().enumerate() {
        let at = [left + place as f64 * advance, top];
        // The font's own superscript is a speck.
        let (letter, size) = if letter == '\u{b2}' { ('2', 0.62) } else { (letter, 1.0) };
        draw(canvas, at, cell * size, advance * size, &glyph(letter), ink, bold);
    }
}

fn glyph(letter: char) -> [u8; 8] {
    let fonts: [&dyn UnicodeFonts; 4] = [&BASIC_FONTS, &LATIN_FONTS, &GREEK_FONTS, &MISC_FONTS];
    let found = fonts.iter().find_map(|font| font.get(letter));
    found.or_else(|| BASIC_FONTS.get('?')).unwrap_or_default()
}

/// One letter: its bitmap, blurred and cut off again, is round where the bitmap has steps.
fn draw(
    canvas: &mut Pixmap,
    at: [f64; 2],
    cell: f64,
    advance: f64,
    rows: &[u8; 8],
    ink: [u8; 3],
    bold: bool,
) {
    let (width, height) = (i64::from(canvas.width()), i64::from(canvas.height()));
    let set = |x: i64, y: i64| {
        f64::from(u8::from((0..8).contains(&x) && (0..8).contains(&y) && rows[y as usize] >> x & 1 == 1))
    };
    // Bilinear between the bitmap's centres.
    let smooth = |u: f64, v: f64| {
        let (x, y) = ((u - 0.5).floor(), (v - 0.5).floor());
        let (fx, fy) = (u - 0.5 - x, v - 0.5 - y);
        let (x, y) = (x as i64, y as i64);
        let row = |y: i64| set(x, y) * (1.0 - fx) + set(x + 1, y) * fx;
        row(y) * (1.0 - fy) + row(y + 1) * fy
    };
    let scale = [advance / 7.4, cell / 8.0];
    let threshold = if bold { 0.36 } else { 0.46 };
    let edge = 1.0 / scale[1].max(1.0);
    for y in (at[1].floor() as i64 - 1)..=(at[1] + cell).ceil() as i64 {
        for x in (at[0].floor() as i64 - 1)..=(at[0] + advance).ceil() as i64 {
            if !(0..width).contains(&x) || !(0..height).contains(&y) {
                continue;
            }
            // Four samples a pixel.
            let mut cover = 0.0;
            for (dx, dy) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
                let u = (x as f64 + dx - at[0]) / scale[0];
                let v = (y as f64 + dy - at[1]) / scale[1];
                cover += ((smooth(u, v) - threshold) / edge + 0.5).clamp(0.0, 1.0) / 4.0;
            }
            if cover > 0.0 {
                blend(canvas, (y * width + x) as usize, ink, cover);
            }
        }
    }
}

fn blend(canvas: &mut Pixmap, at: usize, ink: [u8; 3], cover: f64) {
    let below = canvas.pixels()[at].demultiply();
    let mix = |below: u8, ink: u8| (f64::from(below) * (1.0 - cover) + f64::from(ink) * cover).round() as u8;
    let color = Color::from_rgba8(
        mix(below.red(), ink[0]),
        mix(below.green(), ink[1]),
        mix(below.blue(), ink[2]),
        255,
    );
    let color = color.to_color_u8();
    let opaque = PremultipliedColorU8::from_rgba(color.red(), color.green(), color.blue(), 255);
    if let Some(opaque) = opaque {
        canvas.pixels_mut()[at] = opaque;
    }
}
