//! Cross-correlation of pictures through the fast Fourier transform.

use realfft::num_complex::Complex;
use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Plans for pictures of one size. Results do not depend on the thread that runs them.
pub(super) struct Fft2 {
    pub(super) width: usize,
    pub(super) height: usize,
    rows: Arc<dyn RealToComplex<f32>>,
    rows_back: Arc<dyn ComplexToReal<f32>>,
    columns: Arc<dyn rustfft::Fft<f32>>,
    columns_back: Arc<dyn rustfft::Fft<f32>>,
}

/// A spectrum, column after column.
pub(super) type Spectrum = Vec<Complex32>;

impl Fft2 {
    /// For pictures of at least `width` x `height`.
    pub(super) fn at_least(width: usize, height: usize) -> Fft2 {
        let (width, height) = (smooth(width + width % 2), smooth(height));
        let mut real = RealFftPlanner::new();
        let mut complex = rustfft::FftPlanner::new();
        Fft2 {
            width,
            height,
            rows: real.plan_fft_forward(width),
            rows_back: real.plan_fft_inverse(width),
            columns: complex.plan_fft_forward(height),
            columns_back: complex.plan_fft_inverse(height),
        }
    }

    pub(super) fn forward(&self, picture: &mut [f32]) -> Spectrum {
        let bins = self.width / 2 + 1;
        let zero = Complex::new(0.0, 0.0);
        let mut spectrum = vec![zero; bins * self.height];
        let mut line = vec![zero; bins];
        let mut scratch = self.rows.make_scratch_vec();
        for (y, row) in picture.chunks_exact_mut(self.width).enumerate() {
            // Lengths come from the plan itself, so this cannot fail.
            let done = self.rows.process_with_scratch(row, &mut line, &mut scratch);
            debug_assert!(done.is_ok());
            for (x, value) in line.iter().enumerate() {
                spectrum[x * self.height + y] = *value;
            }
        }
        self.columns.process(&mut spectrum);
        spectrum
    }

    /// `sum over p of template[p] * picture[p + d]` for every shift `d`, cyclic, row after row.
    pub(super) fn correlate(&self, picture: &Spectrum, template: Spectrum) -> Vec<f32> {
        let bins = self.width / 2 + 1;
        let mut product = template;
        for (t, p) in product.iter_mut().zip(picture) {
            *t = p * t.conj();
        }
        self.columns_back.process(&mut product);
        let mut out = vec![0f32; self.width * self.height];
        let mut line = vec![Complex::new(0.0, 0.0); bins];
        let mut scratch = self.rows_back.make_scratch_vec();
        for (y, row) in out.chunks_exact_mut(self.width).enumerate() {
            for (x, value) in line.iter_mut().enumerate() {
                *value = product[x * self.height + y];
            }
            // The imaginary parts of the first and the last bin are rounding; the plan insists on zero.
            line[0].im = 0.0;
            line[bins - 1].im = 0.0;
            let done = self.rows_back.process_with_scratch(&mut line, row, &mut scratch);
            debug_assert!(done.is_ok());
        }
        let scale = 1.0 / (self.width * self.height) as f32;
        out.iter_mut().for_each(|value| *value *= scale);
        out
    }
}

/// The next even number without prime factors above five: such lengths transform fastest.
fn smooth(at_least: usize) -> usize {
    (at_least.max(2)..)
        .find(|&n| {
            let mut rest = n;
            for factor in [2, 3, 5] {
                while rest % factor == 0 {
                    rest /= factor;
                }
            }
            rest == 1 && n % 2 == 0
        })
        .unwrap_or(at_least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_sum() {
        let fft = Fft2::at_least(11, 7);
        let (w, h) = (fft.width, fft.height);
        let value = |i: usize| ((i * 37 + 11) % 17) as f32 / 17.0;
        let picture: Vec<f32> = (0..w * h).map(value).collect();
        let template: Vec<f32> =
            (0..w * h).map(|i| if i % w < 3 && i / w < 2 { value(i * 3) } else { 0.0 }).collect();
        let spectrum = fft.forward(&mut picture.clone());
        let got = fft.correlate(&spectrum, fft.forward(&mut template.clone()));
        for dy in 0..h {
            for dx in 0..w {
                let want: f32 =
                    (0..w * h).map(|i| template[i] * picture[(i / w + dy) % h * w + (i % w + dx) % w]).sum();
                assert!((got[dy * w + dx] - want).abs() < 1e-4, "{dx} {dy}");
            }
        }
    }

    #[test]
    fn lengths_are_smooth() {
        for (n, want) in [(1, 2), (7, 8), (11, 12), (361, 384), (129, 144)] {
            assert_eq!(smooth(n), want);
        }
    }
}
