//! Cross-correlation of rasters by FFT.

use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// FFT plans of one raster size. Results do not depend on the thread.
pub(super) struct Fft2 {
    pub(super) width: usize,
    pub(super) height: usize,
    rows: Arc<dyn RealToComplex<f32>>,
    rows_back: Arc<dyn ComplexToReal<f32>>,
    columns: Arc<dyn rustfft::Fft<f32>>,
    columns_back: Arc<dyn rustfft::Fft<f32>>,
}

/// A spectrum, column-major.
pub(super) type Spectrum = Vec<Complex32>;

/// Buffers of one thread, reused between rasters.
pub(super) struct Bench {
    /// Column-major, of the template and then of the product.
    spectrum: Spectrum,
    /// Rows between the two layouts.
    real: Vec<f32>,
    half: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

/// Rows transposed together: their values of one column fill two cache lines.
const ROWS: usize = 16;

const ZERO: Complex32 = Complex32 { re: 0.0, im: 0.0 };

impl Fft2 {
    /// Returns plans for rasters of at least `width` x `height`.
    pub(super) fn at_least(width: usize, height: usize) -> Fft2 {
        let (width, height) = (smooth(width), smooth(height));
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

    pub(super) fn bench(&self) -> Bench {
        let scratch = [
            self.rows.get_scratch_len(),
            self.rows_back.get_scratch_len(),
            self.columns.get_inplace_scratch_len(),
            self.columns_back.get_inplace_scratch_len(),
        ];
        Bench {
            spectrum: vec![ZERO; self.bins() * self.height],
            real: vec![0.0; self.width],
            half: vec![ZERO; self.bins() * ROWS],
            scratch: vec![ZERO; scratch.into_iter().max().unwrap_or(0)],
        }
    }

    fn bins(&self) -> usize {
        self.width / 2 + 1
    }

    /// Returns the spectrum of a raster of `width` columns, zero beyond its edges.
    pub(super) fn forward(&self, picture: &[f32], width: usize) -> Spectrum {
        let mut bench = self.bench();
        self.forward_rows(picture, width, &mut bench);
        self.columns.process_with_scratch(&mut bench.spectrum, &mut bench.scratch);
        bench.spectrum
    }

    /// Calls `row(y, values)` for the shifts' rows `0..rows`; `values[x]` is the sum over p of `template[p] *
    /// picture[p + (x, y)]`, cyclic. Shifts that keep the template inside the picture do not wrap around.
    pub(super) fn correlate(
        &self,
        picture: &Spectrum,
        template: &[f32],
        template_width: usize,
        rows: usize,
        bench: &mut Bench,
        mut row: impl FnMut(usize, &[f32]),
    ) {
        self.forward_rows(template, template_width, bench);
        let Bench { spectrum, real, half, scratch } = bench;
        // Column by column, so that both transforms stay in the cache.
        for (t, p) in spectrum.chunks_exact_mut(self.height).zip(picture.chunks_exact(self.height)) {
            self.columns.process_with_scratch(t, scratch);
            for (t, p) in t.iter_mut().zip(p) {
                *t = p * t.conj();
            }
            self.columns_back.process_with_scratch(t, scratch);
        }
        let bins = self.bins();
        let scale = 1.0 / (self.width * self.height) as f32;
        for first in (0..rows.min(self.height)).step_by(ROWS) {
            let count = ROWS.min(rows - first).min(self.height - first);
            for x in 0..bins {
                let column = &spectrum[x * self.height + first..][..count];
                for (r, value) in column.iter().enumerate() {
                    half[r * bins + x] = value * scale;
                }
            }
            for (r, line) in half.chunks_exact_mut(bins).take(count).enumerate() {
                // The first and last bins' imaginary parts are rounding errors; the plan requires zero.
                line[0].im = 0.0;
                line[bins - 1].im = 0.0;
                // Cannot fail: the lengths come from the plan.
                let done = self.rows_back.process_with_scratch(line, real, scratch);
                debug_assert!(done.is_ok());
                row(first + r, real);
            }
        }
    }

    fn forward_rows(&self, picture: &[f32], width: usize, bench: &mut Bench) {
        let Bench { spectrum, real, half, scratch } = bench;
        let bins = self.bins();
        let height = picture.len() / width;
        for (block, lines) in picture.chunks(ROWS * width).enumerate() {
            let count = lines.len() / width;
            for (line, into) in lines.chunks_exact(width).zip(half.chunks_exact_mut(bins)) {
                real[..width].copy_from_slice(line);
                real[width..].fill(0.0);
                let done = self.rows.process_with_scratch(real, into, scratch);
                debug_assert!(done.is_ok());
            }
            for x in 0..bins {
                let column = &mut spectrum[x * self.height + block * ROWS..][..count];
                for (r, value) in column.iter_mut().enumerate() {
                    *value = half[r * bins + x];
                }
            }
        }
        for column in spectrum.chunks_exact_mut(self.height) {
            column[height..].fill(ZERO);
        }
    }
}

/// Returns the next even number without prime factors above five: such lengths transform fastest.
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
        let fft = Fft2::at_least(37, 41);
        let (w, h) = (fft.width, fft.height);
        let value = |i: usize| ((i * 37 + 11) % 17) as f32 / 17.0;
        let picture: Vec<f32> = (0..37 * 41).map(value).collect();
        let at = |x: usize, y: usize| if x < 37 && y < 41 { picture[y * 37 + x] } else { 0.0 };
        let template: Vec<f32> = (0..5 * 19).map(|i| value(i * 3)).collect();
        let spectrum = fft.forward(&picture, 37);
        let mut bench = fft.bench();
        // Twice with the same buffers: the first run must not affect the second.
        for _ in 0..2 {
            let mut rows = 0;
            fft.correlate(&spectrum, &template, 5, h, &mut bench, |dy, got| {
                rows += 1;
                for (dx, got) in got.iter().enumerate() {
                    let want: f32 =
                        (0..5 * 19).map(|i| template[i] * at((i % 5 + dx) % w, (i / 5 + dy) % h)).sum();
                    assert!((got - want).abs() < 1e-4, "{dx} {dy}: {got} {want}");
                }
            });
            assert_eq!(rows, h);
        }
    }

    #[test]
    fn lengths_are_smooth() {
        for (n, want) in [(1, 2), (7, 8), (11, 12), (361, 384), (129, 144)] {
            assert_eq!(smooth(n), want);
        }
    }
}
