//! Conversion of luma and chroma to RGB (ITU-T H.273, section 8.3), in integers.

use super::VideoError;
use super::decoder::{Planes, Samples};
use super::parameters::Colour;
use image::RgbImage;

/// Fractional bits of the factors.
const BITS: u32 = 16;

/// Returns whether the matrix is supported; others are refused before decoding.
pub fn is_known(colour: Colour) -> bool {
    weights(colour.matrix).is_some()
}

/// Returns the fractions of red and blue in the luma. The default is BT.601, as in ffmpeg.
fn weights(matrix: u8) -> Option<(f64, f64)> {
    match matrix {
        1 => Some((0.2126, 0.0722)),
        2 | 5 | 6 => Some((0.299, 0.114)),
        4 => Some((0.30, 0.11)),
        7 => Some((0.212, 0.087)),
        9 => Some((0.2627, 0.0593)),
        _ => None,
    }
}

/// Converts planes to RGB. A chroma sample colours its four pixels.
pub fn to_rgb(planes: &Planes, colour: Colour) -> Result<RgbImage, VideoError> {
    picture(planes, colour).ok_or(VideoError::Unsupported { what: "planes of another size" })
}

fn picture(planes: &Planes, colour: Colour) -> Option<RgbImage> {
    let factors = Factors::new(colour, planes.bits)?;
    let (width, height) = (planes.width, planes.height);
    let pixels = match &planes.samples {
        Samples::Bytes(samples) => convert(samples, width as usize, height as usize, &factors)?,
        Samples::Words(samples) => convert(samples, width as usize, height as usize, &factors)?,
    };
    RgbImage::from_raw(width, height, pixels)
}

/// Factors in units of 1/65536; `added` rounds, and subtracts the offset of the luma.
struct Factors {
    luma: i32,
    added: i32,
    grey: i32,
    red: i32,
    green: (i32, i32),
    blue: i32,
}

impl Factors {
    fn new(colour: Colour, bits: u8) -> Option<Factors> {
        let (kr, kb) = weights(colour.matrix)?;
        let kg = 1.0 - kr - kb;
        let step = f64::from(1u32 << (bits - 8));
        // Limited range is 16 to 235 for luma and 16 to 240 for chroma.
        let (luma, chroma, offset) = match colour.full_range {
            true => (255.0 / (256.0 * step - 1.0), 255.0 / (256.0 * step - 1.0), 0.0),
            false => (255.0 / (219.0 * step), 255.0 / (224.0 * step), 16.0 * step),
        };
        let fixed = |value: f64| (value * f64::from(1u32 << BITS)).round() as i32;
        Some(Factors {
            luma: fixed(luma),
            added: fixed(0.5 - offset * luma),
            grey: 128 << (bits - 8),
            red: fixed(2.0 * (1.0 - kr) * chroma),
            green: (fixed(2.0 * (1.0 - kb) * kb / kg * chroma), fixed(2.0 * (1.0 - kr) * kr / kg * chroma)),
            blue: fixed(2.0 * (1.0 - kb) * chroma),
        })
    }
}

fn convert<T: Copy + Into<i32>>(
    [luma, blue, red]: &[Vec<T>; 3],
    width: usize,
    height: usize,
    f: &Factors,
) -> Option<Vec<u8>> {
    let half = width / 2;
    let chroma = half * (height / 2);
    if width == 0 || luma.len() < width * height || blue.len() < chroma || red.len() < chroma {
        return None;
    }
    let mut pixels = vec![0; 3 * width * height];
    for (y, (row, from)) in pixels.chunks_exact_mut(3 * width).zip(luma.chunks_exact(width)).enumerate() {
        let at = y / 2 * half;
        let (blue, red) = (&blue[at..at + half], &red[at..at + half]);
        let pairs = row.as_chunks_mut::<6>().0.iter_mut().zip(from.as_chunks::<2>().0);
        for ((pair, luma), (blue, red)) in pairs.zip(blue.iter().zip(red)) {
            let (b, r) = ((*blue).into() - f.grey, (*red).into() - f.grey);
            let tint = [f.red * r, -f.green.0 * b - f.green.1 * r, f.blue * b];
            for (x, luma) in luma.iter().enumerate() {
                let luma: i32 = (*luma).into();
                let luma = luma * f.luma + f.added;
                for (c, tint) in tint.iter().enumerate() {
                    pair[3 * x + c] = ((luma + tint) >> BITS).clamp(0, 255) as u8;
                }
            }
        }
    }
    Some(pixels)
}
