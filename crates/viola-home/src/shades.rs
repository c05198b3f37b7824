//! Depth pictures.

use image::{Rgb, RgbImage};

/// Returns a depth picture: dark at 0.5 m, bright at 5 m, black without depth. `depth_m` is row-major.
pub(super) fn shades(width: u32, height: u32, depth_m: &[f32]) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let depth_m = depth_m[(y * width + x) as usize];
        if depth_m <= 0.0 {
            return Rgb([0; 3]);
        }
        let fraction = ((depth_m - 0.5) / 4.5).clamp(0.0, 1.0);
        // From violet over green to yellow, with rising brightness.
        let channel = |low: f32, middle: f32, high: f32| {
            let (a, b, t) =
                if fraction < 0.5 { (low, middle, fraction) } else { (middle, high, fraction - 0.5) };
            (a + (b - a) * 2.0 * t) as u8
        };
        Rgb([channel(68.0, 33.0, 253.0), channel(10.0, 145.0, 231.0), channel(84.0, 140.0, 37.0)])
    })
}
