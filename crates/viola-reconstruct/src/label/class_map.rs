//! Class probabilities of a picture's pixels.

use viola_geometry::taxonomy::CLASSES;

/// Class probabilities of one picture, for every pixel of a (usually coarser) raster.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassMap {
    pub width: usize,
    pub height: usize,
    /// True if the centres of the raster's outermost pixels lie on those of the picture's, as in networks
    /// with `align_corners`; false if the outer edges coincide.
    pub align_corners: bool,
    /// Row by row, [`CLASSES`] values for each pixel; each is 0 to 1, and their sum is one.
    pub probabilities: Vec<f32>,
}

impl ClassMap {
    /// Samples the probabilities at a place of a `width` x `height` picture, whose pixel centres have integer
    /// coordinates. Bilinear, clamped to the edge.
    pub fn sample(&self, u: f32, v: f32, width: usize, height: usize, into: &mut [f32; CLASSES]) {
        let place = |at: f32, picture: usize, raster: usize| -> (usize, usize, f32) {
            let at = if self.align_corners {
                at * (raster - 1) as f32 / (picture - 1).max(1) as f32
            } else {
                (at + 0.5) * raster as f32 / picture as f32 - 0.5
            };
            let at = at.clamp(0.0, (raster - 1) as f32);
            let first = (at as usize).min(raster - 1);
            (first, (first + 1).min(raster - 1), at - first as f32)
        };
        let (x0, x1, fx) = place(u, width, self.width);
        let (y0, y1, fy) = place(v, height, self.height);
        into.fill(0.0);
        for (x, y, fraction) in [
            (x0, y0, (1.0 - fx) * (1.0 - fy)),
            (x1, y0, fx * (1.0 - fy)),
            (x0, y1, (1.0 - fx) * fy),
            (x1, y1, fx * fy),
        ] {
            let from = (y * self.width + x) * CLASSES;
            for (sum, p) in into.iter_mut().zip(&self.probabilities[from..from + CLASSES]) {
                *sum += fraction * p;
            }
        }
    }
}
