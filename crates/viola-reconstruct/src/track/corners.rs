//! Corners with binary descriptors for place recognition (Shi and Tomasi, 1994; Calonder et al., 2010).

use super::picture::Layer;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use viola_geometry::Point3;

/// Side of the cells with at most one corner each, in pixels, so that corners spread over the picture.
const CELL: usize = 9;
const MAX_CORNERS: usize = 400;
/// Approximate minimum change of grey around a corner, a pixel, in every direction.
const MIN_CHANGE: f32 = 0.004;
/// Half the side of the described patch.
const REACH: i32 = 12;
const BITS: usize = 256;

pub(super) type Bits = [u64; BITS / 64];

/// A corner with known depth.
#[derive(Debug, Clone)]
pub(super) struct Corner {
    pub point_m: Point3,
    pub bits: Bits,
}

/// Returns the Hamming distance of two descriptors.
pub(super) fn distance(a: &Bits, b: &Bits) -> u32 {
    a.iter().zip(b).map(|(a, b)| (a ^ b).count_ones()).sum()
}

/// The pairs of pixels that descriptors compare, the same for all pictures.
pub(super) struct Describer {
    pairs: Vec<[i32; 4]>,
}

impl Describer {
    pub fn new() -> Describer {
        let mut rng = ChaCha8Rng::seed_from_u64(0x0070_6c61_6365);
        // The sum of two uniform numbers prefers the middle, which the descriptor's authors found best.
        let mut at = || rng.random_range(-REACH / 2..=REACH / 2) + rng.random_range(-REACH / 2..=REACH / 2);
        Describer { pairs: (0..BITS).map(|_| [at(), at(), at(), at()]).collect() }
    }

    /// Returns the corners of a picture, the strongest first.
    pub fn corners(&self, layer: &Layer) -> Vec<Corner> {
        let (width, height) = (layer.width(), layer.height());
        let smooth = blurred(&layer.grey, width, height);
        let margin = REACH as usize + 2;
        let mut found: Vec<(f32, usize, usize)> = Vec::new();
        for top in (margin..height.saturating_sub(margin)).step_by(CELL) {
            for left in (margin..width.saturating_sub(margin)).step_by(CELL) {
                let rows = top..(top + CELL).min(height - margin);
                let cell = rows.flat_map(|y| (left..(left + CELL).min(width - margin)).map(move |x| (x, y)));
                let known = cell.filter(|(x, y)| layer.depth_m[y * width + x] > 0.0);
                let strongest = known
                    .map(|(x, y)| (change(&smooth, width, x, y), x, y))
                    .max_by(|a, b| a.0.total_cmp(&b.0).then((b.2, b.1).cmp(&(a.2, a.1))));
                found.extend(strongest.filter(|(change, ..)| *change > MIN_CHANGE * MIN_CHANGE));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.2, a.1).cmp(&(b.2, b.1))));
        found.truncate(MAX_CORNERS);
        let corner = |&(_, x, y): &(f32, usize, usize)| Corner {
            point_m: layer.camera.unproject(x as f64, y as f64, f64::from(layer.depth_m[y * width + x])),
            bits: self.describe(&smooth, width, x as i32, y as i32),
        };
        found.iter().map(corner).collect()
    }

    fn describe(&self, smooth: &[f32], width: usize, x: i32, y: i32) -> Bits {
        let at = |dx: i32, dy: i32| smooth[(y + dy) as usize * width + (x + dx) as usize];
        let mut bits = [0; BITS / 64];
        for (i, [ax, ay, bx, by]) in self.pairs.iter().enumerate() {
            bits[i / 64] |= u64::from(at(*ax, *ay) < at(*bx, *by)) << (i % 64);
        }
        bits
    }
}

/// Returns the lesser eigenvalue of the structure tensor around a pixel.
pub(crate) fn change(smooth: &[f32], width: usize, x: usize, y: usize) -> f32 {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for row in y - 1..=y + 1 {
        for at in row * width + x - 1..=row * width + x + 1 {
            let (dx, dy) = (smooth[at + 1] - smooth[at - 1], smooth[at + width] - smooth[at - width]);
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
    }
    let (half, apart) = ((xx + yy) / 2.0, (xx - yy) / 2.0);
    let value = (half - (apart * apart + xy * xy).sqrt()) / 9.0;
    if value.is_finite() { value } else { 0.0 }
}

/// Returns the mean over five by five pixels; margins are averaged along one axis only.
pub(crate) fn blurred(grey: &[f32], width: usize, height: usize) -> Vec<f32> {
    let mut rows = grey.to_vec();
    for y in 0..height {
        for x in 2..width.saturating_sub(2) {
            let at = y * width + x;
            rows[at] = grey[at - 2..=at + 2].iter().sum::<f32>() / 5.0;
        }
    }
    let mut out = rows.clone();
    for y in 2..height.saturating_sub(2) {
        for x in 0..width {
            let at = y * width + x;
            out[at] = (0..5).map(|row| rows[at + row * width - 2 * width]).sum::<f32>() / 5.0;
        }
    }
    out
}
